//! Particles -> quadrature points: the adjoint of the evaluation of a polynomial at the particles.
//!
//! A finite-element kernel integrates every cell with one fixed rule. With the densities
//!
//! ```text
//! D_q = ( sum_p V_p D_p l_q(xi_p) ) / ( w_q |J| )
//! ```
//!
//! on the tensor Gauss points with k + 1 points per axis, `sum_q w_q |J| D_q f(xi_q) = sum_p V_p D_p f(xi_p)`
//! holds to round-off for every f in Q_k (documentation, Theory).

use ndarray::ArrayView2;
use rayon::prelude::*;

use crate::grid::{Location, Rule, MAX_POINTS};
use crate::space::{volume_of_cell, Index, DIM};

/// Columns of the particle data, and the points of a tensor rule that receive their densities.
#[derive(Debug, Clone, Copy)]
pub struct Densities<'a> {
    /// One-dimensional rule of the points.
    pub rule: &'a Rule,
    /// `points[q]`: position along each axis, in that rule, of quadrature point q.
    pub points: &'a [Index],
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
        let measure = volume_of_cell(location.grid.h);
        let n = self.rule.points.len();
        let mut along = [[0.0; MAX_POINTS]; DIM];
        let mut weighted = vec![0.0; self.columns.len()];
        out.fill(0.0);
        for &p in location.particles_of(a) {
            let p = p as usize;
            for (t, l) in location.xi[p].iter().zip(&mut along) {
                self.rule.lagrange(*t, &mut l[..n]);
                l.iter_mut().zip(&self.rule.weights).for_each(|(l, w)| *l /= w);
            }
            let (row, v) = (data.row(p), volume[p] / measure);
            for (d, &c) in weighted.iter_mut().zip(self.columns) {
                *d = v * row[c];
            }
            for (point, index) in out.chunks_exact_mut(weighted.len()).zip(self.points) {
                let l: f64 = along.iter().zip(index).map(|(l, &i)| l[i]).product();
                for (o, d) in point.iter_mut().zip(&weighted) {
                    *o += l * d;
                }
            }
        }
    }
}

/// Fill entries `offset..offset + length` of each row of a packed coefficient array, which has `width`
/// entries per row. Row r belongs to the active cell `rows[r]`; `fill` writes it.
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
