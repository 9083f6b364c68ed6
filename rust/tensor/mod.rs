//! Tensors of second order: component order and sign convention, stated once.
//!
//! Tension is positive. Plane strain is three-dimensional with `eps_zz = 0`, so a symmetric tensor
//! has the four components **xx, yy, zz, xy**. A stress carries `sigma_xy`; a strain carries the
//! engineering shear `gamma_xy = 2 eps_xy`. Then `stress . strain` is the work, and a tangent
//! `C[i][j] = d stress_i / d strain_j` is symmetric where the material has a potential.
//! Symmetric tensors in space keep the order without zz: **xx, yy, xy**. Gradients have the order
//! **xx, xy, yx, yy**: d u_x/dx, d u_x/dy, and so on. In axisymmetry x is the radius and zz the hoop
//! direction, whose component is last in both.

mod gradient;
pub mod hencky;
pub mod matrix;
mod parts;
mod principal;
mod symmetric;

pub use gradient::{Gradient, MAX_GRADIENT};
pub use matrix::Matrix;
pub use parts::{AtMean, Moduli, Strain, Stress};
pub(crate) use principal::Principal;
pub use symmetric::{deviator, dot, mean, trace, Sym, Tangent, MAX_STRAINS, STRAINS, UNIT};
pub(crate) use symmetric::{deviatoric_stiffness, norm, UNIT_DEVIATORS};
