//! One-dimensional bases on a row of cells. The functions of a grid are their products.

use std::str::FromStr;

use crate::error::Error;
use crate::space::FUNCTIONS_1D;

/// A family of functions on a row of `n` unit cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Basis {
    /// Quadratic B-splines, C1, knots on the cell edges, open (clamped) at both ends.
    QuadraticSpline,
    /// Linear Lagrange.
    Bilinear,
    /// Quadratic Lagrange, nodes on cell edges and middles.
    Biquadratic,
}

/// The functions `first`, `first + 1`, ... that do not vanish in a cell, at one position. Entries past
/// [`Basis::per_cell`] are zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Local {
    /// Index of the first function.
    pub first: usize,
    /// Values.
    pub value: [f64; FUNCTIONS_1D],
    /// Derivatives with respect to the position in the cell (0 to 1); divide by h for those per metre.
    pub derivative: [f64; FUNCTIONS_1D],
    /// Second derivatives, likewise; divide by h^2.
    pub second: [f64; FUNCTIONS_1D],
}

impl Basis {
    /// Number of functions on `n` cells.
    #[must_use]
    pub fn len(self, n: usize) -> usize {
        match self {
            Self::QuadraticSpline => n + 2,
            Self::Bilinear => n + 1,
            Self::Biquadratic => 2 * n + 1,
        }
    }

    /// Number of functions that do not vanish in a cell.
    #[must_use]
    pub fn per_cell(self) -> usize {
        match self {
            Self::Bilinear => 2,
            Self::QuadraticSpline | Self::Biquadratic => 3,
        }
    }

    /// Index of the first function that does not vanish in `cell`.
    #[must_use]
    pub fn first(self, cell: usize) -> usize {
        match self {
            Self::QuadraticSpline | Self::Bilinear => cell,
            Self::Biquadratic => 2 * cell,
        }
    }

    /// First and last cell of the support of a function on `n` cells.
    #[must_use]
    pub fn support(self, n: usize, function: usize) -> [usize; 2] {
        match self {
            Self::QuadraticSpline => [function.saturating_sub(2), function.min(n - 1)],
            Self::Bilinear => [function.saturating_sub(1), function.min(n - 1)],
            Self::Biquadratic => {
                let first =
                    if function % 2 == 0 { (function / 2).saturating_sub(1) } else { function / 2 };
                [first, (function / 2).min(n - 1)]
            }
        }
    }

    /// How many cells apart two cells with a common function can be.
    #[must_use]
    pub fn reach(self) -> usize {
        match self {
            Self::QuadraticSpline => 2,
            Self::Bilinear | Self::Biquadratic => 1,
        }
    }

    /// First and last function that do not vanish on a run of cells.
    #[must_use]
    pub fn on(self, [first, last]: [usize; 2]) -> [usize; 2] {
        [self.first(first), self.first(last) + self.per_cell() - 1]
    }

    /// The functions at position `t` (0 to 1) of `cell` among `n` cells.
    ///
    /// Quadratic splines: the first function of a cell is `l (1-t)^2`, the last `r t^2`, and they
    /// sum to 1; l = r = 1/2 inside (C1 across the edge), 1 at an open end.
    #[must_use]
    #[inline]
    pub fn at(self, n: usize, cell: usize, t: f64) -> Local {
        let s = 1.0 - t;
        let (value, derivative, second) = match self {
            Self::QuadraticSpline => {
                let l = if cell == 0 { 1.0 } else { 0.5 };
                let r = if cell + 1 == n { 1.0 } else { 0.5 };
                let (a, b) = (l * s * s, r * t * t);
                let (da, db) = (-2.0 * l * s, 2.0 * r * t);
                ([a, 1.0 - a - b, b], [da, -da - db, db], [2.0 * l, -2.0 * (l + r), 2.0 * r])
            }
            Self::Bilinear => ([s, t, 0.0], [-1.0, 1.0, 0.0], [0.0; FUNCTIONS_1D]),
            Self::Biquadratic => (
                [s * (s - t), 4.0 * s * t, t * (t - s)],
                [t - 3.0 * s, 4.0 * (s - t), 3.0 * t - s],
                [4.0, -8.0, 4.0],
            ),
        };
        Local { first: self.first(cell), value, derivative, second }
    }
}

impl FromStr for Basis {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "quadratic_spline" => Ok(Self::QuadraticSpline),
            "bilinear" => Ok(Self::Bilinear),
            "biquadratic" => Ok(Self::Biquadratic),
            _ => Err(Error::UnknownName {
                what: "basis",
                name: name.to_owned(),
                expected: "'quadratic_spline', 'bilinear', 'biquadratic'",
            }),
        }
    }
}
