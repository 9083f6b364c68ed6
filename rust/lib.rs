//! Particle side of tawami: an implicit material point method with the mixed
//! displacement - volumetric strain (u-eps_v) formulation.
//!
//! | module       | content                                                              |
//! |--------------|----------------------------------------------------------------------|
//! | [`space`]    | the dimension, and every number that follows from it                 |
//! | [`tensor`]   | tensors, component order, sign convention, Hencky strains            |
//! | [`grid`]     | background grid, bases, quadrature rules, location of particles      |
//! | [`transfer`] | from the grid to the particles, from the particles to grid and rules |
//! | [`law`]      | material laws                                                        |
//! | [`particles`]| storage of the particles, their strains and responses of the laws    |
//! | `assembly`   | kernels of the form over the cells, into the reduced matrix          |
//! | `python`     | bindings                                                             |
//!
//! Everything is plain Rust on slices and `ndarray`; only `python` knows PyO3. A module uses only those above
//! it in the table. Symbols and equation numbers are those of the paper of Okagawa, Hashimoto and Higo.

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

#[cfg(feature = "python")]
mod assembly;
pub mod error;
pub mod grid;
pub mod law;
pub mod particles;
#[cfg(feature = "python")]
mod python;
pub mod space;
pub mod tensor;
pub mod transfer;
