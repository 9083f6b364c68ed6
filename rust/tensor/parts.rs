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

/// Response of a law to a deviatoric strain increment at a given mean stress.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct AtMean {
    /// Deviator s [Pa].
    pub deviator: Sym,
    /// Plastic volumetric strain of the step.
    pub plastic_volume: f64,
    /// d s_i / d deviator_j [Pa].
    pub dev_dev: Tangent,
    /// d s_i / d sigma_m.
    pub dev_mean: Sym,
    /// d plastic volume / d deviator_j.
    pub volume_dev: Sym,
    /// d plastic volume / d sigma_m [1/Pa].
    pub volume_mean: f64,
}

impl AtMean {
    /// From the response of a law of the total strain that has the given mean stress.
    ///
    /// The total volumetric strain v follows from `sigma_m(deviator, v) = given`, and the plastic one is
    /// `v - sigma_m / K`. `c.mean_vol` is not 0.
    #[must_use]
    pub fn of_total(deviator: Sym, plastic_volume: f64, c: &Moduli, bulk: f64) -> Self {
        let dev_mean = c.dev_vol.map(|d| d / c.mean_vol);
        let volume_dev = c.mean_dev.map(|m| -m / c.mean_vol);
        let row =
            |i: usize| std::array::from_fn(|j| c.dev_dev[i][j] + c.dev_vol[i] * volume_dev[j]);
        Self {
            deviator,
            plastic_volume,
            dev_dev: std::array::from_fn(row),
            dev_mean,
            volume_dev,
            volume_mean: 1.0 / c.mean_vol - 1.0 / bulk,
        }
    }
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
