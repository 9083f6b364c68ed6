//! Active functions, and the parts of a body that share none.
//!
//! A cell is active where it holds particles; a function is active where its support has an active cell.

use super::{Basis, Functions, Grid};
use crate::space::{count, indices, indices_below, number_of, strides, Block, Index, DIM};

/// The active cells with a summed-area table, which tells how many of them a block of cells has.
#[derive(Debug, Clone)]
pub struct Active {
    grid: Grid,
    cells: Vec<bool>,
    /// For each corner of a cell: how many active cells lie below it along every axis.
    sums: Vec<u32>,
}

fn corners(cells: Index) -> Index {
    cells.map(|n| n + 1)
}

impl Active {
    /// From the numbers of the active cells.
    #[must_use]
    pub fn new(grid: Grid, active: &[u32]) -> Self {
        let mut cells = vec![false; grid.num_cells()];
        let size = corners(grid.cells);
        let mut sums = vec![0; count(size)];
        for &c in active {
            cells[c as usize] = true;
            sums[number_of(grid.cell_index(c as usize).map(|i| i + 1), size)] = 1;
        }
        for (axis, stride) in strides(size).into_iter().enumerate() {
            for (number, corner) in indices_below(size).enumerate() {
                if corner[axis] > 0 {
                    sums[number] += sums[number - stride];
                }
            }
        }
        Self { grid, cells, sums }
    }

    /// Number of active cells in a block.
    #[must_use]
    pub fn count(&self, block: Block) -> usize {
        let size = corners(self.grid.cells);
        let (mut more, mut less) = (0, 0);
        for corner in 0..1_usize << DIM {
            let upper = |axis: usize| corner >> axis & 1;
            let index = std::array::from_fn(|axis| block[axis][upper(axis)] + upper(axis));
            let below = self.sums[number_of(index, size)] as usize;
            *if (DIM as u32 - corner.count_ones()) % 2 == 0 { &mut more } else { &mut less } +=
                below;
        }
        more - less
    }

    fn functions_of(&self, basis: Basis) -> Functions {
        Functions { basis, cells: self.grid.cells }
    }

    /// Whether each function of a basis is active.
    #[must_use]
    pub fn functions(&self, basis: Basis) -> Vec<bool> {
        let functions = self.functions_of(basis);
        functions.indices().map(|index| self.count(functions.support_at(index)) > 0).collect()
    }

    /// Parts of the body that share no function: how many, and the part of each cell, -1 for inactive cells.
    #[must_use]
    pub fn parts(&self, basis: Basis) -> (usize, Vec<i64>) {
        let (size, reach) = (self.grid.cells, basis.reach());
        let mut label = vec![-1_i64; self.cells.len()];
        let (mut parts, mut waiting) = (0, Vec::new());
        for seed in 0..self.cells.len() {
            if !self.cells[seed] || label[seed] >= 0 {
                continue;
            }
            label[seed] = parts as i64;
            waiting.push(seed);
            while let Some(cell) = waiting.pop() {
                let index = self.grid.cell_index(cell);
                let near = std::array::from_fn(|axis| {
                    let i = index[axis];
                    [i.saturating_sub(reach), (i + reach).min(size[axis] - 1)]
                });
                for cell in indices(near).map(|index| number_of(index, size)) {
                    if self.cells[cell] && label[cell] < 0 {
                        label[cell] = parts as i64;
                        waiting.push(cell);
                    }
                }
            }
            parts += 1;
        }
        (parts, label)
    }

    /// For each function the value of the last active cell of its support; `none` for inactive functions.
    #[must_use]
    pub fn spread(&self, basis: Basis, of_cells: &[i64], none: i64) -> Vec<i64> {
        let functions = self.functions_of(basis);
        let mut of_functions = vec![none; functions.len()];
        for (cell, &value) in of_cells.iter().enumerate().filter(|(c, _)| self.cells[*c]) {
            for &function in functions.on_cell(self.grid.cell_index(cell)).iter() {
                of_functions[function] = value;
            }
        }
        of_functions
    }

    /// The active cells in the support of a function.
    #[must_use]
    pub fn support(&self, basis: Basis, function: usize) -> Vec<Index> {
        let support = self.functions_of(basis).support(function);
        indices(support).filter(|&i| self.cells[number_of(i, self.grid.cells)]).collect()
    }
}
