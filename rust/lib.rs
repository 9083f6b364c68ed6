//! Particle side of tawami: an implicit material point method with the mixed
//! displacement - volumetric strain (u-eps_v) formulation.
//!
//! Everything here is plain Rust on slices and `ndarray`; only [`python`] knows PyO3.
//! Symbols and equation numbers are those of the paper of Okagawa, Hashimoto and Higo.

#![warn(clippy::pedantic)]
#![allow(
    clippy::many_single_char_names,
    clippy::similar_names,
    clippy::cast_precision_loss,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_possible_wrap,
    clippy::module_name_repetitions,
    clippy::doc_markdown,
    clippy::needless_pass_by_value
)]

pub mod active;
pub mod adjoint;
#[cfg(feature = "python")]
mod assembly;
pub mod basis;
pub mod constitutive;
pub mod error;
pub mod finite_strain;
pub mod grid;
pub mod interpolation;
pub mod kinematics;
pub mod material;
pub mod particles;
pub mod plane;
#[cfg(feature = "python")]
mod python;
pub mod quadrature;
pub mod tensor;
