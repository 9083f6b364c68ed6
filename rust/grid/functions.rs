//! The functions of a basis on a grid: products of one-dimensional functions, numbered x fastest.

// Small functions of the innermost loops: without it, what they share is computed again.
#![allow(clippy::inline_always)]

use std::ops::Deref;

use super::{Basis, Local};
use crate::space::{
    count, index_of, indices_below, number_of, strides, Block, Index, Point, DIM, FUNCTIONS,
    FUNCTIONS_1D, ROWS,
};

/// The functions of a basis on a grid of this number of cells.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Functions {
    /// Family of functions along each axis.
    pub basis: Basis,
    /// Number of cells along each axis.
    pub cells: Index,
}

/// Numbers of the functions that do not vanish on a cell, x fastest.
#[derive(Debug, Clone, Copy)]
pub struct CellFunctions {
    numbers: [usize; FUNCTIONS],
    len: usize,
}

impl Deref for CellFunctions {
    type Target = [usize];

    fn deref(&self) -> &[usize] {
        &self.numbers[..self.len]
    }
}

impl Functions {
    /// Number of functions along each axis.
    #[must_use]
    pub fn size(&self) -> Index {
        self.cells.map(|n| self.basis.len(n))
    }

    /// Number of functions.
    #[must_use]
    pub fn len(&self) -> usize {
        count(self.size())
    }

    /// Whether there are none; a grid has at least one cell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Number of functions that do not vanish on a cell.
    #[must_use]
    pub fn per_cell(&self) -> usize {
        self.basis.per_cell().pow(DIM as u32)
    }

    /// Number of the function at a position along each axis.
    #[must_use]
    pub fn number(&self, function: Index) -> usize {
        number_of(function, self.size())
    }

    /// The functions that do not vanish on a cell.
    #[must_use]
    #[inline]
    pub fn on_cell(&self, cell: Index) -> CellFunctions {
        match self.basis.per_cell() {
            2 => self.on_cell_of::<2>(cell),
            _ => self.on_cell_of::<FUNCTIONS_1D>(cell),
        }
    }

    #[inline]
    fn on_cell_of<const W: usize>(&self, cell: Index) -> CellFunctions {
        let (mut numbers, mut len) = ([0; FUNCTIONS], 0);
        for first in self.rows::<W>(cell).into_iter().take(W.pow(DIM as u32 - 1)) {
            for k in 0..W {
                numbers[len] = first + k;
                len += 1;
            }
        }
        CellFunctions { numbers, len }
    }

    /// First function of each row along x of the functions of a cell.
    #[inline(always)]
    pub(crate) fn rows<const W: usize>(&self, cell: Index) -> [usize; ROWS] {
        let (mut rows, mut count) = ([0; ROWS], 1);
        rows[0] = self.number(cell.map(|i| self.basis.first(i)));
        for stride in strides(self.size()).into_iter().skip(1) {
            // from the last step on, so that the first rows are read before they change
            for k in (0..W).rev() {
                for row in 0..count {
                    rows[k * count + row] = rows[row] + k * stride;
                }
            }
            count *= W;
        }
        rows
    }

    /// One-dimensional functions at a position in a cell, for each axis.
    #[must_use]
    #[inline]
    pub fn at(&self, cell: Index, xi: Point) -> [Local; DIM] {
        std::array::from_fn(|axis| self.basis.at(self.cells[axis], cell[axis], xi[axis]))
    }

    /// Values at a position in a cell, in the order of [`Functions::on_cell`].
    #[must_use]
    pub fn values(&self, cell: Index, xi: Point) -> [f64; FUNCTIONS] {
        let along = self.at(cell, xi);
        products(along.each_ref().map(|local| &local.value), self.basis.per_cell())
    }

    /// The cells of the support of a function.
    #[must_use]
    pub fn support(&self, function: usize) -> Block {
        self.support_at(index_of(function, self.size()))
    }

    /// The cells of the support of the function at a position along each axis.
    #[must_use]
    pub fn support_at(&self, function: Index) -> Block {
        std::array::from_fn(|axis| self.basis.support(self.cells[axis], function[axis]))
    }

    /// Position of every function along each axis, in the order of their numbers.
    pub fn indices(&self) -> impl Iterator<Item = Index> {
        indices_below(self.size())
    }
}

/// `sum_i c_i f_i` over the functions of a cell with `C` coefficients each; f are the products of the `W`
/// factors along each axis.
#[inline(always)]
pub(crate) fn sum<const C: usize, const W: usize>(
    rows: &[usize; ROWS],
    factors: [&[f64; FUNCTIONS_1D]; DIM],
    coefficients: &[f64],
) -> [f64; C] {
    let weights = products_of::<W>(factors);
    let mut sum = [0.0; C];
    for (first, weights) in rows.iter().zip(weights.chunks_exact(W)).take(W.pow(DIM as u32 - 1)) {
        let coefficients = coefficients[C * first..][..C * W].chunks_exact(C);
        for (coefficients, weight) in coefficients.zip(weights) {
            sum.iter_mut().zip(coefficients).for_each(|(s, c)| *s += weight * c);
        }
    }
    sum
}

/// Products of one factor per axis, x fastest; each axis has `width` factors.
#[must_use]
pub fn products(factors: [&[f64; FUNCTIONS_1D]; DIM], width: usize) -> [f64; FUNCTIONS] {
    match width {
        2 => products_of::<2>(factors),
        _ => products_of::<FUNCTIONS_1D>(factors),
    }
}

/// A constant width, so that the loops are unrolled.
#[inline(always)]
#[must_use]
pub fn products_of<const W: usize>(factors: [&[f64; FUNCTIONS_1D]; DIM]) -> [f64; FUNCTIONS] {
    let mut products = [0.0; FUNCTIONS];
    products[..W].copy_from_slice(&factors[0][..W]);
    let mut inner = W;
    for factor in &factors[1..] {
        // from the last row on, so that the first is read before it changes
        for k in (0..W).rev() {
            for f in 0..inner {
                products[k * inner + f] = products[f] * factor[k];
            }
        }
        inner *= W;
    }
    products
}
