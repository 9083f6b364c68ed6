//! Tensors of second order: component order and sign convention, stated once.
//!
//! Tension is positive. Plane strain is three-dimensional with `eps_zz = 0`, so a symmetric tensor
//! has the four components **xx, yy, zz, xy**. A stress carries `sigma_xy`; a strain carries the
//! engineering shear `gamma_xy = 2 eps_xy`. Then `stress . strain` is the work, and a tangent
//! `C[i][j] = d stress_i / d strain_j` is symmetric where the material has a potential.
//! Symmetric tensors in space keep the order without zz: **xx, yy, xy**. Gradients have the order
//! **xx, xy, yx, yy**: d u_x/dx, d u_x/dy, and so on.

pub mod hencky;
pub mod matrix;
mod parts;
mod principal;
mod symmetric;

pub use matrix::Matrix;
pub use parts::{AtMean, Moduli, Strain, Stress};
pub(crate) use principal::Principal;
pub(crate) use symmetric::symmetric_part;
pub use symmetric::{deviator, dot, mean, trace, Sym, Tangent, IN_SPACE, UNIT};
pub(crate) use symmetric::{deviatoric_stiffness, norm, small_strain, UNIT_DEVIATORS};
