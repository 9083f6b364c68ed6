//! Which functions have particles in their support, and the parts of a body that share none.

use crate::basis::Basis;
use crate::grid::Grid;

/// The cells that hold particles, with a summed-area table: whether any cell of a rectangle does is
/// answered by four look-ups.
#[derive(Debug, Clone)]
pub struct Active {
    grid: Grid,
    cells: Vec<bool>,
    /// `sums[i + j (nx + 1)]`: active cells below and left of the corner (i, j).
    sums: Vec<u32>,
}

/// First and last cell along each axis.
pub type Rectangle = [[usize; 2]; 2];

/// The cells of the support of a function, x fastest, on a grid of so many cells.
#[must_use]
pub fn support(basis: Basis, cells: [usize; 2], function: usize) -> Rectangle {
    let width = basis.len(cells[0]);
    [basis.support(cells[0], function % width), basis.support(cells[1], function / width)]
}

impl Active {
    /// From the indices of the cells that hold particles.
    #[must_use]
    pub fn new(grid: Grid, active: &[u32]) -> Self {
        let [nx, ny] = grid.cells;
        let mut cells = vec![false; grid.num_cells()];
        for &c in active {
            cells[c as usize] = true;
        }
        let mut sums = vec![0; (nx + 1) * (ny + 1)];
        for j in 0..ny {
            let mut row = 0;
            for i in 0..nx {
                row += u32::from(cells[i + j * nx]);
                sums[i + 1 + (j + 1) * (nx + 1)] = row + sums[i + 1 + j * (nx + 1)];
            }
        }
        Self { grid, cells, sums }
    }

    /// Number of active cells in a rectangle.
    #[must_use]
    pub fn count(&self, [x, y]: Rectangle) -> usize {
        let at = |i: usize, j: usize| self.sums[i + j * (self.grid.cells[0] + 1)];
        let (upper, lower) = (y[1] + 1, y[0]);
        let all = at(x[1] + 1, upper) + at(x[0], lower);
        (all - at(x[0], upper) - at(x[1] + 1, lower)) as usize
    }

    /// Whether each function of a basis has an active cell in its support, x fastest.
    #[must_use]
    pub fn functions(&self, basis: Basis) -> Vec<bool> {
        let [nx, ny] = self.grid.cells;
        let mut mask = Vec::with_capacity(basis.len(nx) * basis.len(ny));
        for g in 0..basis.len(ny) {
            let y = basis.support(ny, g);
            mask.extend((0..basis.len(nx)).map(|f| self.count([basis.support(nx, f), y]) > 0));
        }
        mask
    }

    /// Parts of the body that share no function: how many, and the part of each function, -1 for
    /// functions without active cells.
    #[must_use]
    pub fn parts(&self, basis: Basis) -> (usize, Vec<i64>) {
        let [nx, ny] = self.grid.cells;
        // cells share a function where the first of one is among those of the other
        let reach = match basis {
            Basis::QuadraticSpline => 2,
            Basis::Bilinear | Basis::Biquadratic => 1,
        };
        let mut label = vec![-1_i64; self.cells.len()];
        let (mut parts, mut waiting) = (0, Vec::new());
        for seed in 0..self.cells.len() {
            if !self.cells[seed] || label[seed] >= 0 {
                continue;
            }
            label[seed] = parts as i64;
            waiting.push(seed);
            while let Some(cell) = waiting.pop() {
                let [i, j] = self.grid.cell_ij(cell);
                for b in j.saturating_sub(reach)..(j + reach + 1).min(ny) {
                    for a in i.saturating_sub(reach)..(i + reach + 1).min(nx) {
                        let near = a + b * nx;
                        if self.cells[near] && label[near] < 0 {
                            label[near] = parts as i64;
                            waiting.push(near);
                        }
                    }
                }
            }
            parts += 1;
        }
        (parts, self.spread(basis, &label, -1))
    }

    /// For each function, the value of the last active cell of its support, or `none`.
    #[must_use]
    pub fn spread(&self, basis: Basis, of_cells: &[i64], none: i64) -> Vec<i64> {
        let [nx, ny] = self.grid.cells;
        let width = basis.len(nx);
        let mut of_functions = vec![none; width * basis.len(ny)];
        for (cell, &value) in of_cells.iter().enumerate().filter(|(c, _)| self.cells[*c]) {
            let [i, j] = self.grid.cell_ij(cell);
            for b in 0..basis.per_cell() {
                for a in 0..basis.per_cell() {
                    of_functions[basis.first(i) + a + (basis.first(j) + b) * width] = value;
                }
            }
        }
        of_functions
    }

    /// The active cells (i, j) in the support of a function.
    #[must_use]
    pub fn support(&self, basis: Basis, function: usize) -> Vec<[usize; 2]> {
        let nx = self.grid.cells[0];
        let [x, y] = support(basis, self.grid.cells, function);
        let cells = (y[0]..=y[1]).flat_map(|j| (x[0]..=x[1]).map(move |i| [i, j]));
        cells.filter(|&[i, j]| self.cells[i + j * nx]).collect()
    }
}
