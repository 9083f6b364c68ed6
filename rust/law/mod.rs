//! Material laws. One law is one file here, and one `impl` of [`Elastic`] and [`Law`].
//!
//! A law is a pure function: strain increment, old stress and history in; new stress, history and
//! consistent tangent out. It is three-dimensional, and its parameters are checked when it is made.

mod drucker_prager;
mod friction;
mod linear_elastic;
mod mohr_coulomb;
mod neo_hookean;
mod von_mises;

pub use drucker_prager::DruckerPrager;
pub use friction::Friction;
pub use linear_elastic::LinearElastic;
pub use mohr_coulomb::MohrCoulomb;
pub use neo_hookean::NeoHookean;
pub use von_mises::VonMises;

use crate::tensor::{deviatoric_stiffness, Moduli, Strain, Stress};

/// A stress beyond the yield surface by no more than this share of its size counts as lying on it. A stored
/// stress was returned to the surface; when it is unloaded, it starts elastic.
pub(crate) const ROUND_OFF: f64 = 1e-13;

/// Most history variables that a law may have.
pub const MAX_HISTORY: usize = 8;

/// The isotropic elastic part that every law has.
pub trait Elastic: std::fmt::Debug + Send + Sync {
    /// The linear law of the elastic part, or of its limit at small strain.
    fn linear(&self) -> &LinearElastic;

    /// Shear modulus mu [Pa].
    fn shear_modulus(&self) -> f64 {
        self.linear().mu
    }

    /// Bulk modulus K [Pa]; infinite where the material is incompressible.
    fn bulk_modulus(&self) -> f64 {
        self.linear().bulk
    }

    /// The elastic strain of a stress; here for a stress linear in the strain.
    fn elastic_strain(&self, stress: &Stress) -> Strain {
        let stiffness = deviatoric_stiffness(self.shear_modulus());
        Strain {
            deviator: std::array::from_fn(|i| stress.deviator[i] / stiffness[i]),
            volume: stress.mean / self.bulk_modulus(),
        }
    }

    /// Energy of an elastic strain [J/m3], `mu e : e + K/2 v^2`; its derivative is the stress.
    fn elastic_energy(&self, strain: &Strain) -> f64 {
        let stiffness = deviatoric_stiffness(self.shear_modulus());
        let twice: f64 = stiffness.iter().zip(strain.deviator).map(|(c, e)| c * e * e).sum();
        0.5 * twice + volumetric_energy(self.bulk_modulus(), strain.volume)
    }
}

/// A material law.
pub trait Law: Elastic {
    /// Name of the law in driver scripts.
    fn name(&self) -> &'static str;

    /// Whether the deviator depends on the mean stress, which the form u-p does not give to the law.
    fn pressure_dependent(&self) -> bool {
        false
    }

    /// Whether the law exists at finite strain only.
    fn finite_only(&self) -> bool {
        false
    }

    /// Names of the history variables, which are zero at first; at most [`MAX_HISTORY`].
    fn history(&self) -> &'static [&'static str] {
        &[]
    }

    /// Stress at the end of the step and its tangent, from the strain increment and the old stress.
    /// `new` receives the history variables at the end of the step.
    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli);
}

/// `K/2 v^2`; without a change of volume there is no such energy, even if K is infinite.
pub(crate) fn volumetric_energy(bulk: f64, volume: f64) -> f64 {
    if volume == 0.0 {
        return 0.0;
    }
    0.5 * bulk * volume * volume
}
