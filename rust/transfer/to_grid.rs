//! Particles -> grid: sums over the particles weighted by the functions of a basis.

use std::ops::Range;

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use crate::grid::{products, Basis, Functions, Location};
use crate::space::{indices, Index, Point, FUNCTIONS};

/// Sums `sum_p V_p D_p N_i(x_p)` for the functions of a basis, or with the squares of the functions:
/// functions x columns.
///
/// Each row of cells along x is summed by itself, then the rows are added in their order: the result does
/// not depend on the number of threads.
#[must_use]
pub fn nodal_sums(
    location: &Location,
    volume: &[f64],
    data: ArrayView2<f64>,
    basis: Basis,
    squared: bool,
) -> Array2<f64> {
    let columns = data.ncols();
    let functions = Functions { basis, cells: location.grid.cells };
    // a grid of one row: its functions are those that do not vanish on a row of the whole grid
    let strip = Functions { basis, cells: along_x(functions.cells[0], 1) };
    let of_row = |row: &Range<usize>| {
        let mut sums = vec![0.0; strip.len() * columns];
        for a in row.clone() {
            let cell = location.active_index(a);
            let numbers = strip.on_cell(along_x(cell[0], 0));
            for &p in location.particles_of(a) {
                let p = p as usize;
                let weights = weighted(&functions, cell, location.xi[p], volume[p], squared);
                for (&function, weight) in numbers.iter().zip(weights) {
                    let of_function = &mut sums[columns * function..][..columns];
                    for (s, d) in of_function.iter_mut().zip(data.row(p)) {
                        *s += weight * d;
                    }
                }
            }
        }
        sums
    };
    let rows = location.rows();
    let of_rows: Vec<Vec<f64>> = rows.par_iter().map(of_row).collect();
    let mut sums = vec![0.0; functions.len() * columns];
    // the functions of a row of cells, line by line along x
    let mut lines = strip.size().map(|n| [0, n - 1]);
    lines[0] = [0, 0];
    let (lines, length) = (indices(lines), columns * strip.size()[0]);
    for (row, part) in rows.iter().zip(&of_rows) {
        let mut first = location.active_index(row.start).map(|i| basis.first(i));
        first[0] = 0;
        for (line, part) in lines.clone().zip(part.chunks_exact(length.max(1))) {
            let index = std::array::from_fn(|axis| first[axis] + line[axis]);
            let of_line = &mut sums[columns * functions.number(index)..][..length];
            of_line.iter_mut().zip(part).for_each(|(s, d)| *s += d);
        }
    }
    Array2::from_shape_vec((functions.len(), columns), sums).unwrap_or_default()
}

/// An index along x; the same `others` along the other axes.
fn along_x(x: usize, others: usize) -> Index {
    std::array::from_fn(|axis| if axis == 0 { x } else { others })
}

/// The functions of a cell at a position in it, or their squares, times a weight.
fn weighted(
    functions: &Functions,
    cell: Index,
    xi: Point,
    weight: f64,
    squared: bool,
) -> [f64; FUNCTIONS] {
    let mut along = functions.at(cell, xi).map(|local| local.value);
    if squared {
        along.iter_mut().flatten().for_each(|value| *value *= *value);
    }
    along[0].iter_mut().for_each(|value| *value *= weight);
    products(along.each_ref(), functions.basis.per_cell())
}
