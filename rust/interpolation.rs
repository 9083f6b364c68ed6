//! Grid -> particles: values and gradients of grid fields.

use crate::basis::{Basis, Local};
use crate::grid::{Grid, Location};

/// Coefficients of a field with `C` components: function index (x fastest), then component.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a, const C: usize> {
    /// Grid of the basis.
    pub grid: Grid,
    /// Functions in x and y.
    pub basis: Basis,
    /// `C` coefficients per function.
    pub coefficients: &'a [f64],
}

impl<const C: usize> Field<'_, C> {
    fn local(&self, cell: usize, xi: [f64; 2]) -> [Local; 2] {
        let [i, j] = self.grid.cell_ij(cell);
        let [nx, ny] = self.grid.cells;
        [self.basis.at(nx, i, xi[0]), self.basis.at(ny, j, xi[1])]
    }

    /// `sum_i c_i fx_i fy_i` with the given factors along x and y.
    fn sum(&self, [bx, by]: &[Local; 2], fx: &[f64; 3], fy: &[f64; 3]) -> [f64; C] {
        let width = self.basis.len(self.grid.cells[0]);
        let mut sum = [0.0; C];
        for (b, wy) in fy.iter().take(self.basis.per_cell()).enumerate() {
            for (a, wx) in fx.iter().take(self.basis.per_cell()).enumerate() {
                let i = bx.first + a + (by.first + b) * width;
                for (k, s) in sum.iter_mut().enumerate() {
                    *s += wx * wy * self.coefficients[C * i + k];
                }
            }
        }
        sum
    }

    /// Value at a position in a cell.
    #[must_use]
    pub fn value(&self, cell: usize, xi: [f64; 2]) -> [f64; C] {
        let local = self.local(cell, xi);
        self.sum(&local, &local[0].value, &local[1].value)
    }

    /// Gradient at a position in a cell: `[k][a]` = d component k / d x_a.
    #[must_use]
    pub fn gradient(&self, cell: usize, xi: [f64; 2]) -> [[f64; 2]; C] {
        let local = self.local(cell, xi);
        let dx = self.sum(&local, &local[0].derivative, &local[1].value);
        let dy = self.sum(&local, &local[0].value, &local[1].derivative);
        std::array::from_fn(|k| [dx[k] / self.grid.h, dy[k] / self.grid.h])
    }

    /// Values at all particles, one after the other.
    #[must_use]
    pub fn at_particles(&self, location: &Location) -> Vec<[f64; C]> {
        let at = |(&cell, &xi)| self.value(cell as usize, xi);
        location.cell.iter().zip(&location.xi).map(at).collect()
    }
}
