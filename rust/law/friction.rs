//! Parameters of frictional laws: angles and cohesion.

use super::Parameter;
use crate::error::{Error, Result};

/// A friction angle below this is rejected, since it was probably given in radians.
const RADIANS: f64 = 1.6;

/// Parameters of a frictional law besides its elastic ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Friction {
    /// Friction angle phi [degrees].
    pub phi: f64,
    /// Cohesion c [Pa].
    pub c: f64,
    /// Dilatancy angle psi [degrees].
    pub psi: f64,
    /// Plastic volumetric strain at which dilatancy ends.
    pub eps_v_max: f64,
    /// Accept a friction angle between 0 and 1.6 degrees.
    pub tiny: bool,
}

impl Friction {
    /// The parameters of frictional laws.
    pub(super) const PARAMETERS: &'static [Parameter] = &[
        Parameter::Required("phi"),
        Parameter::Optional("c", 0.0),
        Parameter::Optional("psi", 0.0),
        Parameter::Optional("eps_v_max", f64::INFINITY),
        Parameter::Switch("tiny_angle"),
    ];

    /// From values in the order of [`Self::PARAMETERS`].
    pub(super) fn of(given: &[f64]) -> Self {
        let [phi, c, psi, eps_v_max, tiny] = std::array::from_fn(|i| given[i]);
        Self { phi, c, psi, eps_v_max, tiny: tiny > 0.0 }
    }

    /// Check that every parameter is in its range.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the first that is not.
    pub(super) fn check(&self) -> Result<()> {
        let Self { phi, c, psi, eps_v_max, tiny } = *self;
        let refuse = |name, value, expected| Err(Error::Parameter { name, value, expected });
        if !(0.0..90.0).contains(&phi) {
            return refuse("phi", phi, "a friction angle in degrees, 0 <= phi < 90");
        }
        if phi > 0.0 && phi < RADIANS && !tiny {
            let expected =
                "degrees: below 1.6 it looks like radians. With tiny_angle=True it is accepted";
            return refuse("phi", phi, expected);
        }
        if !(0.0..=phi).contains(&psi) {
            return refuse("psi", psi, "a dilatancy angle in degrees, 0 <= psi <= phi");
        }
        if !(c >= 0.0 && c.is_finite()) {
            return refuse("c", c, "a cohesion of at least 0 Pa");
        }
        if phi == 0.0 && c == 0.0 {
            return refuse(
                "c",
                c,
                "a positive cohesion where phi = 0: the material would have no strength",
            );
        }
        if eps_v_max.is_nan() || eps_v_max < 0.0 {
            return refuse("eps_v_max", eps_v_max, "a plastic volumetric strain of at least 0");
        }
        Ok(())
    }
}
