//! Material laws. One law is one file here: its [`Maker`] and one `impl` of [`Elastic`] and [`Law`].
//!
//! A law is a pure function: strain increment, old stress and history in; new stress, history and
//! consistent tangent out. It is three-dimensional, and its parameters are checked when it is made.

use std::sync::Arc;

use crate::error::Result;
use crate::tensor::{deviatoric_stiffness, AtMean, Moduli, Strain, Stress, Sym};

mod external;
mod friction;

pub use external::{interned, External};
pub use friction::Friction;

/// The modules of the laws, and the list of their makers.
macro_rules! laws {
    ($($file:ident::$law:ident,)*) => {
        $(mod $file; pub use $file::$law;)*

        /// All laws.
        pub const LAWS: &[Maker] = &[$($file::MAKER),*];
    };
}

laws! {
    linear_elastic::LinearElastic,
    neo_hookean::NeoHookean,
    von_mises::VonMises,
    drucker_prager::DruckerPrager,
    mohr_coulomb::MohrCoulomb,
    cam_clay::CamClay,
}

/// A law, shared by the particles that have it.
pub type Shared = Arc<dyn Law>;

/// Maker of a law for driver scripts.
pub struct Maker {
    /// Name of the law in driver scripts.
    pub name: &'static str,
    /// Its parameters besides the elastic ones.
    pub parameters: &'static [Parameter],
    /// The law of its elastic part and the values of its parameters, in their order.
    pub make: fn(LinearElastic, &[f64]) -> Result<Shared>,
}

/// A parameter of a law.
pub enum Parameter {
    /// A number that must be given.
    Required(&'static str),
    /// A number, and its value where none is given.
    Optional(&'static str, f64),
    /// True (1) or False (0, where nothing is given).
    Switch(&'static str),
}

/// A stress beyond the yield surface by no more than this share of its size counts as lying on it. A stored
/// stress was returned to the surface; when it is unloaded, it starts elastic.
pub(crate) const ROUND_OFF: f64 = 1e-13;

/// Resistance to opening beyond the apex of a frictional law at a given mean stress, as a share of mu.
///
/// A mean stress m beyond that of the apex is not clipped, since its tangent would be zero. The material
/// opens by `(m - m_apex) / (SOFT mu)` in the step instead, so that the excess is SOFT mu times the
/// volumetric strain of the step.
pub(crate) const SOFT: f64 = 0.1;

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
    /// Name of the law in driver scripts: that of its [`Maker`].
    fn name(&self) -> &'static str;

    /// Whether the strength depends on the mean stress, so that plastic flow may change the volume.
    fn pressure_dependent(&self) -> bool {
        false
    }

    /// Whether the law exists at finite strain only.
    fn finite_only(&self) -> bool {
        false
    }

    /// Whether the caller computes its responses, as for a law in NumPy.
    fn external(&self) -> bool {
        false
    }

    /// Names of the history variables, which are zero at first; at most [`MAX_HISTORY`].
    fn history(&self) -> &[&'static str] {
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

    /// Deviator and plastic volumetric strain at the end of the step, from the deviatoric strain increment,
    /// the old deviator and the **new** mean stress [Pa]: the law as forms with a field for the mean stress
    /// use it. Here for laws whose deviator does not depend on the mean stress and whose flow preserves
    /// the volume.
    fn respond_at_mean(
        &self,
        increment: &Sym,
        old: &Sym,
        mean: f64,
        history: &[f64],
        new: &mut [f64],
    ) -> AtMean {
        let increment = Strain { deviator: *increment, volume: 0.0 };
        let old = Stress { deviator: *old, mean };
        let (stress, moduli) = self.respond(&increment, &old, history, new);
        AtMean { deviator: stress.deviator, dev_dev: moduli.dev_dev, ..AtMean::default() }
    }
}

/// `K/2 v^2`; without a change of volume there is no such energy, even if K is infinite.
pub(crate) fn volumetric_energy(bulk: f64, volume: f64) -> f64 {
    if volume == 0.0 {
        return 0.0;
    }
    0.5 * bulk * volume * volume
}
