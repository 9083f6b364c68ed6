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

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::basis::Basis;
use crate::grid::Location;
use crate::quadrature::Rule;

/// Particle data on the points of a rule: what of it, and at which points.
#[derive(Debug, Clone)]
pub struct Densities<'a> {
    /// One-dimensional rule of the points.
    pub rule: &'a Rule,
    /// `points[q]` gives the indices along x and y of quadrature point q.
    pub points: &'a [[usize; 2]],
    /// Column of the particle data for each of the k densities.
    pub columns: &'a [usize],
}

impl Densities<'_> {
    /// Number of entries in one cell: `q * columns.len() + k` for point q and column k.
    #[must_use]
    pub fn len(&self) -> usize {
        self.points.len() * self.columns.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Densities of the particle data `data` (particles x columns) in the a-th active cell.
    ///
    /// # Panics
    /// If a column or point reaches outside its array; callers check at the border.
    pub fn of_cell(
        &self,
        location: &Location,
        a: usize,
        volume: &[f64],
        data: ArrayView2<f64>,
        out: &mut [f64],
    ) {
        let area = location.grid.h * location.grid.h;
        let (mut lx, mut ly) = ([0.0; MAX_POINTS], [0.0; MAX_POINTS]);
        let n = self.rule.points.len();
        let mut weighted = vec![0.0; self.columns.len()];
        out.fill(0.0);
        for &p in location.particles_of(a) {
            let p = p as usize;
            for (t, l) in location.xi[p].iter().zip([&mut lx, &mut ly]) {
                self.rule.lagrange(*t, &mut l[..n]);
                l.iter_mut().zip(&self.rule.weights).for_each(|(l, w)| *l /= w);
            }
            let (row, v) = (data.row(p), volume[p] / area);
            for (d, &c) in weighted.iter_mut().zip(self.columns) {
                *d = v * row[c];
            }
            for (point, &[i, j]) in out.chunks_exact_mut(weighted.len()).zip(self.points) {
                let l = lx[i] * ly[j];
                for (o, d) in point.iter_mut().zip(&weighted) {
                    *o += l * d;
                }
            }
        }
    }
}

/// Largest number of points per axis of a rule.
pub const MAX_POINTS: usize = 8;

/// Volume-weighted mean over the particles of the a-th active cell, one value per column.
///
/// # Panics
/// As [`Densities::of_cell`].
pub fn cell_mean(
    location: &Location,
    a: usize,
    volume: &[f64],
    data: ArrayView2<f64>,
    columns: &[usize],
    out: &mut [f64],
) {
    let particles = location.particles_of(a);
    let total: f64 = particles.iter().map(|&p| volume[p as usize]).sum();
    for (mean, &c) in out.iter_mut().zip(columns) {
        let weighted = particles.iter().map(|&p| volume[p as usize] * data[[p as usize, c]]);
        *mean = weighted.sum::<f64>() / total;
    }
}

/// Fill entries `offset..offset + length` of the rows of a packed coefficient array, `width` entries
/// each; row r belongs to the active cell `location.active[rows[r]]`, and `fill` writes it.
///
/// # Panics
/// If the rows are shorter than `offset + length`; callers check at the border.
pub fn pack(
    rows: &[u32],
    (offset, length): (usize, usize),
    width: usize,
    packed: &mut [f64],
    fill: impl Fn(usize, &mut [f64]) + Sync,
) {
    packed.par_chunks_exact_mut(width).zip(rows).for_each(|(row, &a)| {
        fill(a as usize, &mut row[offset..offset + length]);
    });
}

/// Sums `sum_p V_p D_p N_i(x_p)` over the functions of a basis: functions x columns, the function
/// along x fastest. Rows of cells are summed apart and then added in their order, so results repeat
/// whatever the number of threads.
#[must_use]
pub fn nodal_sums(
    location: &Location,
    volume: &[f64],
    data: ArrayView2<f64>,
    basis: Basis,
) -> ndarray::Array2<f64> {
    let [nx, ny] = location.grid.cells;
    let (width, columns) = (basis.len(nx), data.ncols());
    let of_row = |cells: &[usize]| {
        let mut sums = vec![0.0; basis.per_cell() * width * columns];
        for &p in cells.iter().flat_map(|&a| location.particles_of(a)) {
            let p = p as usize;
            let [i, j] = location.grid.cell_ij(location.cell[p] as usize);
            let [x, y] = location.xi[p];
            let (bx, by) = (basis.at(nx, i, x), basis.at(ny, j, y));
            for b in 0..basis.per_cell() {
                for a in 0..basis.per_cell() {
                    let weight = volume[p] * bx.value[a] * by.value[b];
                    let slot = columns * (bx.first + a + b * width);
                    for (s, d) in sums[slot..slot + columns].iter_mut().zip(data.row(p)) {
                        *s += weight * d;
                    }
                }
            }
        }
        sums
    };
    let all: Vec<usize> = (0..location.active.len()).collect();
    let row_of = |a: usize| location.grid.cell_ij(location.active[a] as usize)[1];
    let rows: Vec<&[usize]> = all.chunk_by(|&a, &b| row_of(a) == row_of(b)).collect();
    let of_rows: Vec<Vec<f64>> = rows.par_iter().map(|cells| of_row(cells)).collect();
    let mut sums = vec![0.0; width * basis.len(ny) * columns];
    for (cells, part) in rows.iter().zip(&of_rows) {
        let first = basis.first(row_of(cells[0])) * width * columns;
        for (s, d) in sums[first..].iter_mut().zip(part) {
            *s += d;
        }
    }
    ndarray::Array2::from_shape_fn((width * basis.len(ny), columns), |(i, k)| sums[i * columns + k])
}
