//! Extraction: values of the functions of a cell at nodes of the cell.
//!
//! Every basis is biquadratic on a cell, so the field problem is assembled on Lagrange nodes:
//! `nodal values = extraction x coefficients`. This is the one place that computes it.

use super::{CellFunctions, Functions};
use crate::space::{Index, Point, FUNCTIONS};

/// Values at `N` nodes of the functions that do not vanish on a cell.
#[derive(Debug, Clone, Copy)]
pub struct Extraction<const N: usize> {
    /// Numbers of the functions.
    pub functions: CellFunctions,
    /// `values[node][function]`; entries past the functions are zero.
    pub values: [[f64; FUNCTIONS]; N],
}

/// The extraction of one cell for nodes at the given positions in it (0 to 1 along each axis).
#[must_use]
pub fn extraction<const N: usize>(
    functions: &Functions,
    cell: Index,
    nodes: &[Point; N],
) -> Extraction<N> {
    Extraction {
        functions: functions.on_cell(cell),
        values: nodes.map(|xi| functions.values(cell, xi)),
    }
}
