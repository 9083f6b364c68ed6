//! Grid -> particles: values and gradients of grid fields.

use rayon::prelude::*;

use crate::grid::{sum, Basis, Functions, Grid, Location};
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

    /// Value at a position in a cell.
    #[must_use]
    pub fn value(&self, cell: Index, xi: Point) -> [f64; C] {
        match self.basis.per_cell() {
            2 => self.value_of::<2>(cell, xi),
            _ => self.value_of::<FUNCTIONS_1D>(cell, xi),
        }
    }

    /// Gradient at a position in a cell: `[k][a]` = d component k / d x_a.
    #[must_use]
    pub fn gradient(&self, cell: Index, xi: Point) -> [[f64; DIM]; C] {
        match self.basis.per_cell() {
            2 => self.gradient_of::<2>(cell, xi),
            _ => self.gradient_of::<FUNCTIONS_1D>(cell, xi),
        }
    }

    fn value_of<const W: usize>(&self, cell: Index, xi: Point) -> [f64; C] {
        let functions = self.functions();
        let (along, rows) = (functions.at(cell, xi), functions.rows::<W>(cell));
        sum::<C, W>(&rows, along.each_ref().map(|local| &local.value), self.coefficients)
    }

    fn gradient_of<const W: usize>(&self, cell: Index, xi: Point) -> [[f64; DIM]; C] {
        let functions = self.functions();
        let (along, rows) = (functions.at(cell, xi), functions.rows::<W>(cell));
        let mut gradient = [[0.0; DIM]; C];
        for axis in 0..DIM {
            let mut factors = along.each_ref().map(|local| &local.value);
            factors[axis] = &along[axis].derivative;
            let sum = sum::<C, W>(&rows, factors, self.coefficients);
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
