//! Grid -> particles: values and gradients of grid fields.

use rayon::prelude::*;

use crate::grid::{products, Basis, Functions, Grid, Location};
use crate::space::{Index, Point, DIM, FUNCTIONS_1D};

/// Coefficients of a field with `C` components: function (x fastest), then component.
#[derive(Debug, Clone, Copy)]
pub struct Field<'a, const C: usize> {
    /// Grid of the basis.
    pub grid: Grid,
    /// Family of functions.
    pub basis: Basis,
    /// `C` coefficients per function.
    pub coefficients: &'a [f64],
}

/// Fewest particles that a task treats.
const PARTICLES: usize = 64;

impl<const C: usize> Field<'_, C> {
    fn functions(&self) -> Functions {
        Functions { basis: self.basis, cells: self.grid.cells }
    }

    /// `sum_i c_i f_i`, f the products of the given factors along the axes.
    fn sum(&self, functions: &[usize], factors: [&[f64; FUNCTIONS_1D]; DIM]) -> [f64; C] {
        let weights = products(factors, self.basis.per_cell());
        let mut sum = [0.0; C];
        for (&function, weight) in functions.iter().zip(weights) {
            for (k, s) in sum.iter_mut().enumerate() {
                *s += weight * self.coefficients[C * function + k];
            }
        }
        sum
    }

    /// Value at a position in a cell.
    #[must_use]
    pub fn value(&self, cell: Index, xi: Point) -> [f64; C] {
        let functions = self.functions();
        let along = functions.at(cell, xi);
        self.sum(&functions.on_cell(cell), along.each_ref().map(|local| &local.value))
    }

    /// Gradient at a position in a cell: `[k][a]` = d component k / d x_a.
    #[must_use]
    pub fn gradient(&self, cell: Index, xi: Point) -> [[f64; DIM]; C] {
        let functions = self.functions();
        let along = functions.at(cell, xi);
        let numbers = functions.on_cell(cell);
        let mut gradient = [[0.0; DIM]; C];
        for axis in 0..DIM {
            let mut factors = along.each_ref().map(|local| &local.value);
            factors[axis] = &along[axis].derivative;
            let sum = self.sum(&numbers, factors);
            for (row, s) in gradient.iter_mut().zip(sum) {
                row[axis] = s / self.grid.h;
            }
        }
        gradient
    }

    /// Values at all particles.
    #[must_use]
    pub fn at_particles(&self, location: &Location) -> Vec<[f64; C]> {
        of_particles(location, |cell, xi| self.value(cell, xi))
    }

    /// Gradients at all particles.
    #[must_use]
    pub fn gradients(&self, location: &Location) -> Vec<[[f64; DIM]; C]> {
        of_particles(location, |cell, xi| self.gradient(cell, xi))
    }
}

fn of_particles<T: Send>(location: &Location, at: impl Fn(Index, Point) -> T + Sync) -> Vec<T> {
    let of = |p: usize| at(location.cell_of(p), location.xi[p]);
    (0..location.len()).into_par_iter().with_min_len(PARTICLES).map(of).collect()
}
