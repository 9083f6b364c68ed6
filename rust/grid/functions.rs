//! The functions of a basis on a grid: products of one-dimensional functions, numbered x fastest.

use std::ops::Deref;

use super::{Basis, Local};
use crate::space::{
    count, index_of, indices_below, number_of, Block, Index, Point, DIM, FUNCTIONS, FUNCTIONS_1D,
};

/// The functions of a basis on a grid of so many cells.
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
    pub fn on_cell(&self, cell: Index) -> CellFunctions {
        let width = self.basis.per_cell();
        let mut functions = CellFunctions { numbers: [0; FUNCTIONS], len: 1 };
        functions.numbers[0] = self.number(cell.map(|i| self.basis.first(i)));
        let mut stride = 1;
        for size in self.size() {
            let inner = functions.len;
            for k in 1..width {
                for f in 0..inner {
                    functions.numbers[k * inner + f] = functions.numbers[f] + k * stride;
                }
            }
            functions.len *= width;
            stride *= size;
        }
        functions
    }

    /// One-dimensional functions at a position in a cell, for each axis.
    #[must_use]
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

/// Products of one factor per axis, x fastest; each axis has `width` factors.
#[must_use]
pub fn products(factors: [&[f64; FUNCTIONS_1D]; DIM], width: usize) -> [f64; FUNCTIONS] {
    let mut products = [0.0; FUNCTIONS];
    products[..width].copy_from_slice(&factors[0][..width]);
    let mut inner = width;
    for factor in &factors[1..] {
        // from the last one, so that the first `inner` products are read before they change
        for k in (0..width).rev() {
            for f in 0..inner {
                products[k * inner + f] = products[f] * factor[k];
            }
        }
        inner *= width;
    }
    products
}
