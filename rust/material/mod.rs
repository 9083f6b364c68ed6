//! Material laws. One law is one file here: strain increment and old stress in; stress and
//! consistent tangent out; pure; three-dimensional; parameters validated when it is made.
//!
//! Deviatoric and volumetric parts travel separately (see [`crate::kinematics`]).

mod drucker_prager;
mod friction;
mod linear_elastic;
mod mohr_coulomb;
mod neo_hookean;
mod principal;
mod von_mises;

pub use drucker_prager::DruckerPrager;
pub use friction::Friction;
pub use linear_elastic::LinearElastic;
pub use mohr_coulomb::MohrCoulomb;
pub use neo_hookean::NeoHookean;
pub use von_mises::VonMises;

use crate::tensor::{deviator, mean, Sym, Tangent, COMPONENTS};

/// Beyond the yield surface by no more than this share of the stress is on it: a stored stress that
/// was returned to the surface, and is unloaded, starts elastic.
pub(crate) const ROUND_OFF: f64 = 1e-13;

/// A strain increment in its two parts; order and signs as in [`crate::tensor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    /// Deviatoric part (xx, yy, zz, gamma_xy).
    pub deviator: Sym,
    /// Volumetric part, positive for expansion.
    pub volume: f64,
}

/// A stress in its two parts.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stress {
    /// Deviator s [Pa].
    pub deviator: Sym,
    /// Mean stress sigma_m [Pa], tension positive.
    pub mean: f64,
}

/// Consistent tangent of [`Stress`] with respect to [`Strain`] [Pa].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Moduli {
    /// d s_i / d deviator_j, applied to deviatoric increments only.
    pub dev_dev: Tangent,
    /// d s_i / d volume.
    pub dev_vol: Sym,
    /// d sigma_m / d deviator_j.
    pub mean_dev: Sym,
    /// d sigma_m / d volume.
    pub mean_vol: f64,
}

impl From<&Sym> for Stress {
    fn from(stress: &Sym) -> Self {
        Self { deviator: deviator(stress), mean: mean(stress) }
    }
}

impl From<&Tangent> for Moduli {
    /// The parts of a tangent d stress / d strain: `s = dev(C e)`, `sigma_m = mean(C e)`, with
    /// `e = deviator + volume/3 I`; what acts on deviators is itself deviatoric.
    fn from(c: &Tangent) -> Self {
        let column = |j: usize| std::array::from_fn(|i| c[i][j]);
        let columns: Tangent = std::array::from_fn(column);
        let of_unit: Sym = std::array::from_fn(|i| mean(&c[i]));
        let dev: [Sym; COMPONENTS] = columns.each_ref().map(deviator);
        Self {
            dev_dev: std::array::from_fn(|i| deviator(&std::array::from_fn(|j| dev[j][i]))),
            dev_vol: deviator(&of_unit),
            mean_dev: deviator(&columns.each_ref().map(mean)),
            mean_vol: mean(&of_unit),
        }
    }
}

/// A material law.
pub trait Material: std::fmt::Debug + Send + Sync {
    /// What driver scripts call it.
    fn name(&self) -> &'static str;

    /// Shear modulus mu [Pa] of the elastic part.
    fn shear_modulus(&self) -> f64;

    /// Bulk modulus K [Pa] of the elastic part; infinite where the material is incompressible.
    fn bulk_modulus(&self) -> f64;

    /// Whether the deviator depends on the mean stress: not where the form alone knows it (u-p).
    fn pressure_dependent(&self) -> bool {
        false
    }

    /// Whether the law exists at finite strain only.
    fn finite_only(&self) -> bool {
        false
    }

    /// Names of the history variables, all zero at first.
    fn history(&self) -> &'static [&'static str] {
        &[]
    }

    /// Stress at the end of the step and its tangent, from the increment and the old stress; `new` are
    /// the history variables at the end.
    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli);

    /// The elastic strain behind a stress; where stress is linear in it, as here, it is enough.
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

/// `s = 2 mu e` component by component: the strain holds gamma_xy = 2 eps_xy, hence mu for the shear.
pub(crate) fn deviatoric_stiffness(mu: f64) -> Sym {
    [2.0 * mu, 2.0 * mu, 2.0 * mu, mu]
}

/// `K/2 v^2`; an incompressible material has no volume change, and no energy of it.
pub(crate) fn volumetric_energy(bulk: f64, volume: f64) -> f64 {
    if volume == 0.0 {
        return 0.0;
    }
    0.5 * bulk * volume * volume
}

/// `sqrt(s : s)` of a stress.
pub(crate) fn norm(s: &Sym) -> f64 {
    (s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * s[3] * s[3]).sqrt()
}
