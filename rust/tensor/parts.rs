//! Strain, stress and tangent in two parts: deviator and volume.
//!
//! The parts stay apart from the fields of the form to the stress. In one tensor, the round-off of the
//! deviator would reach the mean stress multiplied by K.

use super::symmetric::{deviator, mean, Sym, Tangent};
use crate::space::COMPONENTS;

/// A strain, or an increment of one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    /// Deviator (xx, yy, zz, gamma_xy).
    pub deviator: Sym,
    /// Volumetric strain, positive for expansion.
    pub volume: f64,
}

/// A stress.
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
    /// The parts of a tangent d stress / d strain: `s = dev(C e)`, `sigma_m = mean(C e)` with
    /// `e = deviator + volume/3 I`. A part that acts on deviators is itself deviatoric.
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
