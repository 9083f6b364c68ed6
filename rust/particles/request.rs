//! Quantities of the laws that a weak form needs: the columns of its particle data.

use std::str::FromStr;

use crate::error::Error;
use crate::law::interned;
use crate::space::Geometry;

/// A quantity of the law that a form may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// Stress (xx, yy, xy, and in axisymmetry zz) [Pa].
    Sigma,
    /// The same components of the three-dimensional deviator [Pa].
    Deviator,
    /// Mean stress [Pa].
    Mean,
    /// P = tau f^-T (xx, xy, yx, yy, and in axisymmetry zz) [Pa]; finite strain only.
    Nominal,
    /// P_s = s f^-T [Pa], the part of P from the deviator; finite strain only.
    NominalDeviator,
    /// Mean Kirchhoff stress [Pa]; finite strain only.
    MeanKirchhoff,
    /// ln J_f; finite strain only.
    LnJ,
    /// Plastic volumetric strain of the step, where the form has a field for the mean stress.
    PlasticVolume,
    /// A history variable of the laws at the end of the step, by its name; 0 with laws that do not have it.
    History(&'static str),
}

impl Operator {
    /// Number of components.
    #[must_use]
    pub fn components(self, geometry: Geometry) -> usize {
        match self {
            Self::Nominal | Self::NominalDeviator => geometry.gradients(),
            Self::Sigma | Self::Deviator => geometry.strains(),
            Self::Mean
            | Self::MeanKirchhoff
            | Self::LnJ
            | Self::PlasticVolume
            | Self::History(_) => 1,
        }
    }

    /// Whether it belongs to finite strain; `None` if to both.
    #[must_use]
    pub fn finite(self) -> Option<bool> {
        match self {
            Self::PlasticVolume | Self::History(_) => None,
            _ => Some(!matches!(self, Self::Sigma | Self::Deviator | Self::Mean)),
        }
    }
}

/// Value of an operator, or one of its derivatives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its value.
    Value,
    /// Its derivative with respect to the strain of the displacement (xx, yy, gamma_xy, and in axisymmetry
    /// zz), strain fastest; small strain only.
    Strain,
    /// Its derivative with respect to grad u (xx, xy, yx, yy, and in axisymmetry zz), gradient fastest; finite
    /// strain only.
    Gradient,
    /// Its derivative with respect to the volumetric field of the form: eps_v, or p.
    Volume,
}

impl Part {
    /// Numbers per component.
    #[must_use]
    pub fn width(self, geometry: Geometry) -> usize {
        match self {
            Self::Value | Self::Volume => 1,
            Self::Strain => geometry.strains(),
            Self::Gradient => geometry.gradients(),
        }
    }
}

/// An entry of the particle data: `part` of `operator`, from `column` on.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The operator.
    pub operator: Operator,
    /// Value or derivative.
    pub part: Part,
    /// First column of the particle data that is written.
    pub column: usize,
    /// Factor of each particle, where the form multiplies the quantity by constants.
    pub factor: Option<Vec<f64>>,
}

impl Request {
    /// A request without a factor.
    #[must_use]
    pub fn new(operator: Operator, part: Part, column: usize) -> Self {
        Self { operator, part, column, factor: None }
    }

    /// Whether it is a derivative of a history variable.
    #[must_use]
    pub fn history_slope(&self) -> bool {
        matches!(self.operator, Operator::History(_)) && self.part != Part::Value
    }

    /// Number of columns that are written.
    #[must_use]
    pub fn width(&self, geometry: Geometry) -> usize {
        self.operator.components(geometry) * self.part.width(geometry)
    }
}

impl FromStr for Operator {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        if let Some(variable) = name.strip_prefix("history:") {
            return Ok(Self::History(interned(variable)));
        }
        Ok(match name {
            "sigma" => Self::Sigma,
            "s" => Self::Deviator,
            "sigma_m" => Self::Mean,
            "P" => Self::Nominal,
            "P_s" => Self::NominalDeviator,
            "tau_m" => Self::MeanKirchhoff,
            "ln_J" => Self::LnJ,
            "eps_p" => Self::PlasticVolume,
            _ => {
                return Err(Error::UnknownName {
                    what: "operator",
                    name: name.to_owned(),
                    expected: "'sigma', 's', 'sigma_m', 'P', 'P_s', 'tau_m', 'ln_J', 'eps_p', \
                               'history:<variable>'",
                })
            }
        })
    }
}

impl FromStr for Part {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        Ok(match name {
            "value" => Self::Value,
            "strain" => Self::Strain,
            "gradient" => Self::Gradient,
            "volume" => Self::Volume,
            _ => {
                return Err(Error::UnknownName {
                    what: "part",
                    name: name.to_owned(),
                    expected: "'value', 'strain', 'gradient', 'volume'",
                })
            }
        })
    }
}
