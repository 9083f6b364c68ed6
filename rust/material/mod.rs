//! Material laws. One law is one file here: strain increment and old stress in; stress and
//! consistent tangent out; pure; three-dimensional; parameters validated when it is made.
//!
//! Deviatoric and volumetric parts travel separately (see [`crate::kinematics`]).

mod linear_elastic;

pub use linear_elastic::LinearElastic;

use crate::tensor::{Sym, Tangent};

/// A strain increment in its two parts; order and signs as in [`crate::tensor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strain {
    /// Deviatoric part (xx, yy, zz, gamma_xy).
    pub deviator: Sym,
    /// Volumetric part, positive for expansion.
    pub volume: f64,
}

/// A stress in its two parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stress {
    /// Deviator s [Pa].
    pub deviator: Sym,
    /// Mean stress sigma_m [Pa], tension positive.
    pub mean: f64,
}

/// Consistent tangent of [`Stress`] with respect to [`Strain`] [Pa].
#[derive(Debug, Clone, Copy, PartialEq)]
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

/// A material law.
pub trait Material: Send + Sync {
    /// Shear modulus mu [Pa] of the elastic part.
    fn shear_modulus(&self) -> f64;

    /// Bulk modulus K [Pa] of the elastic part; infinite where the material is incompressible.
    fn bulk_modulus(&self) -> f64;

    /// Stress at the end of the step and its tangent, from the increment and the old stress.
    fn respond(&self, increment: &Strain, old: &Stress) -> (Stress, Moduli);
}
