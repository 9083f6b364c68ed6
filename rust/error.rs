//! The error type of the crate: every variant is a message to the user.

use thiserror::Error;

use crate::space::{Extent, Position};

/// Errors in the input. In Python each of these is a `tawami.InputError`.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum Error {
    /// A scalar parameter out of its range.
    #[error("{name} = {value}: expected {expected}")]
    Parameter {
        /// Name of the parameter as the user typed it.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Expected value, as the end of a sentence.
        expected: &'static str,
    },
    /// Particles outside the grid.
    #[error(
        "{count} of {total} particles lie outside the grid; the first is particle {index} at \
         {position}, the grid covers {extent}. Enlarge the grid or move the body"
    )]
    OutsideGrid {
        /// How many are outside.
        count: usize,
        /// How many particles there are.
        total: usize,
        /// Index of the first one outside.
        index: usize,
        /// Its position [m].
        position: Position,
        /// Where the grid is [m].
        extent: Extent,
    },
    /// A NaN or an infinity in an array.
    #[error(
        "{name}: {count} entries are not finite; the first is {value} at particle {index}. \
         Check where the array was made"
    )]
    NotFinite {
        /// Name of the array.
        name: String,
        /// How many entries are not finite.
        count: usize,
        /// The first such entry.
        value: f64,
        /// Its particle.
        index: usize,
    },
    /// A volume that is zero or negative.
    #[error("volume of particle {index} is {value} m2: expected a positive number")]
    Volume {
        /// The particle.
        index: usize,
        /// Its volume per metre depth.
        value: f64,
    },
    /// An array with the wrong shape.
    #[error("{name} has shape {got:?}: expected {expected}")]
    Shape {
        /// Name of the array.
        name: &'static str,
        /// Its shape.
        got: Vec<usize>,
        /// Expected shape.
        expected: String,
    },
    /// A body without particles.
    #[error("the body has no particles: expected at least one; check its region and the number of particles per cell")]
    NoParticles,
    /// A particle with the number of a material that does not exist.
    #[error("particle {index} names material {material}, but there are {count} materials (numbered from 0)")]
    UnknownMaterial {
        /// The particle.
        index: usize,
        /// Its material number.
        material: usize,
        /// How many materials there are.
        count: usize,
    },
    /// A name outside a fixed set.
    #[error("{what} '{name}' is unknown: expected one of {expected}")]
    UnknownName {
        /// Kind of the name.
        what: &'static str,
        /// The name.
        name: String,
        /// Names that exist.
        expected: &'static str,
    },
    /// An incompressible material with kinematics that need K.
    #[error(
        "the material of particle {index} is incompressible (nu = 0.5, K infinite): \
         it needs a form with the kinematics 'deviatoric'. Use form 'u_p', or nu < 0.5"
    )]
    Incompressible {
        /// The first such particle.
        index: usize,
    },
    /// A law of finite strain with a form of small strain.
    #[error(
        "the law of particle {index} exists at finite strain only, and the form has small strains: \
         expected a form with strain = 'finite'. Use form 'u_epsv_finite' or 'u_finite'"
    )]
    FiniteOnly {
        /// The first such particle.
        index: usize,
    },
    /// An iterate that turns a particle inside out.
    #[error("the increment turns particle {index} inside out (det f <= 0)")]
    Inverted {
        /// The first such particle.
        index: usize,
    },
}

impl Error {
    /// The same error with the number of its particle in the body.
    #[must_use]
    pub(crate) fn of_body(mut self, number: &[u32]) -> Self {
        if let Self::NotFinite { index, .. } = &mut self {
            *index = number[*index] as usize;
        }
        self
    }
}

/// Result with this crate's [`enum@Error`].
pub type Result<T> = std::result::Result<T, Error>;

/// Check that all entries are finite; the error has the first entry that is not, and their number.
pub(crate) fn check_finite(name: &str, values: &[f64], per_particle: usize) -> Result<()> {
    let mut bad = values.iter().enumerate().filter(|(_, v)| !v.is_finite());
    match bad.next() {
        None => Ok(()),
        Some((entry, &value)) => Err(Error::NotFinite {
            name: name.to_owned(),
            count: 1 + bad.count(),
            value,
            index: entry / per_particle,
        }),
    }
}
