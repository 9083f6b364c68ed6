//! Particles -> quadrature points: the adjoint of evaluating a polynomial at the particles.
//!
//! A finite-element kernel integrates every cell with one fixed rule. With the densities
//!
//! ```text
//! D_q = ( sum_p V_p D_p l_q(xi_p) ) / ( w_q |J| )
//! ```
//!
//! on the tensor Gauss points, `sum_q w_q |J| D_q f(xi_q) = sum_p V_p D_p f(xi_p)` holds to round-off
//! for every f in Q_k, k + 1 points per axis (README, The method).

use ndarray::{ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use crate::basis::Basis;
use crate::grid::Location;
use crate::quadrature::Rule;

/// Where densities go in the rows of a packed coefficient array: one row per active cell, entry
/// `offset + q * columns.len() + k` for point q and column k.
#[derive(Debug, Clone)]
pub struct Packing<'a> {
    /// Row r belongs to the active cell `location.active[rows[r]]`.
    pub rows: &'a [u32],
    /// `points[q]` gives the indices along x and y of quadrature point q.
    pub points: &'a [[usize; 2]],
    /// Column of the particle data for each of the k densities.
    pub columns: &'a [usize],
    /// First entry of a row that is written.
    pub offset: usize,
}

/// Write the densities of the particle data `data` (particles x columns) into `out` (one row per
/// active cell). Entries outside the packing are left alone.
///
/// # Panics
/// If a row index, a column or the packing reaches outside its array; callers check at the border.
pub fn densities(
    location: &Location,
    volume: &[f64],
    data: ArrayView2<f64>,
    rule: &Rule,
    packing: &Packing,
    mut out: ArrayViewMut2<f64>,
) {
    let n = rule.points.len();
    let nc = packing.columns.len();
    let area = location.grid.h * location.grid.h;
    let scale: Vec<f64> = packing
        .points
        .iter()
        .map(|&[a, b]| 1.0 / (rule.weights[a] * rule.weights[b] * area))
        .collect();
    let used = packing.offset..packing.offset + packing.points.len() * nc;
    out.outer_iter_mut().into_par_iter().zip(packing.rows).for_each(|(mut row, &a)| {
        let row = &mut row.as_slice_mut().expect("rows are contiguous")[used.clone()];
        row.fill(0.0);
        let (mut lx, mut ly) = (vec![0.0; n], vec![0.0; n]);
        let mut values = vec![0.0; nc];
        for &p in location.particles_of(a as usize) {
            let p = p as usize;
            rule.lagrange(location.xi[p][0], &mut lx);
            rule.lagrange(location.xi[p][1], &mut ly);
            for (v, &c) in values.iter_mut().zip(packing.columns) {
                *v = volume[p] * data[[p, c]];
            }
            for ((point, &[a, b]), &s) in row.chunks_exact_mut(nc).zip(packing.points).zip(&scale) {
                let l = lx[a] * ly[b] * s;
                for (d, v) in point.iter_mut().zip(&values) {
                    *d += l * v;
                }
            }
        }
    });
}

/// Volume-weighted mean over the particles of each active cell, into the same packing (one value
/// per cell and column).
///
/// # Panics
/// As [`densities`].
pub fn cell_means(
    location: &Location,
    volume: &[f64],
    data: ArrayView2<f64>,
    packing: &Packing,
    mut out: ArrayViewMut2<f64>,
) {
    for (mut row, &a) in out.outer_iter_mut().zip(packing.rows) {
        let particles = location.particles_of(a as usize);
        let total: f64 = particles.iter().map(|&p| volume[p as usize]).sum();
        for (k, &c) in packing.columns.iter().enumerate() {
            let sum: f64 =
                particles.iter().map(|&p| volume[p as usize] * data[[p as usize, c]]).sum();
            row[packing.offset + k] = sum / total;
        }
    }
}

/// Sums `sum_p V_p D_p N_i(x_p)` over the functions of a basis: functions x columns, the function
/// along x fastest. The order of summation is that of the particles, so results repeat.
#[must_use]
pub fn nodal_sums(
    location: &Location,
    volume: &[f64],
    data: ArrayView2<f64>,
    basis: Basis,
) -> ndarray::Array2<f64> {
    let [nx, ny] = location.grid.cells;
    let width = basis.len(nx);
    let mut sums = ndarray::Array2::zeros((width * basis.len(ny), data.ncols()));
    for (p, (&cell, xi)) in location.cell.iter().zip(&location.xi).enumerate() {
        let [i, j] = location.grid.cell_ij(cell as usize);
        let (bx, by) = (basis.at(nx, i, xi[0]), basis.at(ny, j, xi[1]));
        for b in 0..basis.per_cell() {
            for a in 0..basis.per_cell() {
                let weight = volume[p] * bx.value[a] * by.value[b];
                let mut row = sums.row_mut(bx.first + a + (by.first + b) * width);
                row.scaled_add(weight, &data.row(p));
            }
        }
    }
    sums
}
