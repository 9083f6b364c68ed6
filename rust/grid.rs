//! Uniform background grid of squares and the location of particles in it.

use crate::error::{check_finite, Error, Result};

/// A particle this close to the border of the grid (in cells) counts as lying on it: positions
/// computed in floating point miss the border by round-off.
const BORDER: f64 = 1e-9;

/// Largest number of cells along an axis.
pub const MAX_CELLS: usize = 1 << 15;

/// Uniform grid of `cells[0]` x `cells[1]` squares of side `h`; cell (i, j) has the index
/// `i + j * cells[0]`, x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Lower left corner [m].
    pub origin: [f64; 2],
    /// Side of a cell [m].
    pub h: f64,
    /// Number of cells in x and y.
    pub cells: [usize; 2],
}

impl Grid {
    /// A grid; `h` must be positive and finite, `cells` at least 1 x 1.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn new(origin: [f64; 2], h: f64, cells: [usize; 2]) -> Result<Self> {
        if !(h.is_finite() && h > 0.0) {
            return Err(Error::Parameter {
                name: "h",
                value: h,
                expected: "a positive cell size in m",
            });
        }
        for (name, value) in [("origin[0]", origin[0]), ("origin[1]", origin[1])] {
            if !value.is_finite() {
                return Err(Error::Parameter { name, value, expected: "a finite position in m" });
            }
        }
        for (name, n) in [("cells[0]", cells[0]), ("cells[1]", cells[1])] {
            if n == 0 || n > MAX_CELLS {
                return Err(Error::Parameter {
                    name,
                    value: n as f64,
                    expected: "between 1 and 32768 cells",
                });
            }
        }
        Ok(Self { origin, h, cells })
    }

    /// Number of cells.
    #[must_use]
    pub fn num_cells(&self) -> usize {
        self.cells[0] * self.cells[1]
    }

    /// Cell (i, j) of a cell index.
    #[must_use]
    pub fn cell_ij(&self, cell: usize) -> [usize; 2] {
        [cell % self.cells[0], cell / self.cells[0]]
    }

    /// Cell and position in it along one axis; `None` outside. A particle on an inner edge belongs
    /// to the cell on its positive side (but see `leave_border_cells`).
    fn locate_1d(&self, axis: usize, x: f64) -> Option<(usize, f64)> {
        let n = self.cells[axis];
        let s = (x - self.origin[axis]) / self.h;
        if !(s >= -BORDER && s <= n as f64 + BORDER) {
            return None;
        }
        let s = s.clamp(0.0, n as f64);
        let cell = (s as usize).min(n - 1);
        Some((cell, s - cell as f64))
    }

    /// Cells and reference positions of all particles.
    ///
    /// `x` holds x, y of one particle after the other [m].
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::OutsideGrid`] with the number of
    /// particles outside and the first of them.
    pub fn locate(&self, x: &[f64]) -> Result<Location> {
        let n = x.len() / 2;
        check_finite("x", x, 2)?;
        let mut cell = Vec::with_capacity(n);
        let mut xi = Vec::with_capacity(n);
        let mut outside = Vec::new();
        for (p, xp) in x.chunks_exact(2).enumerate() {
            if let (Some((i, a)), Some((j, b))) =
                (self.locate_1d(0, xp[0]), self.locate_1d(1, xp[1]))
            {
                cell.push((i + j * self.cells[0]) as u32);
                xi.push([a, b]);
            } else {
                outside.push(p);
            }
        }
        if let Some(&index) = outside.first() {
            let end = |axis: usize| self.origin[axis] + self.h * self.cells[axis] as f64;
            return Err(Error::OutsideGrid {
                count: outside.len(),
                total: n,
                index,
                x: x[2 * index],
                y: x[2 * index + 1],
                x0: self.origin[0],
                x1: end(0),
                y0: self.origin[1],
                y1: end(1),
            });
        }
        for axis in 0..2 {
            self.leave_border_cells(axis, &mut cell, &mut xi);
        }
        Ok(Location::new(*self, cell, xi))
    }
}

impl Grid {
    /// Where all particles of a cell lie on its lower border, move them to the cell below: a body
    /// that ends on a line of the grid takes no part in the cells beyond it, whose functions would
    /// vanish, with their gradients, at every particle.
    fn leave_border_cells(&self, axis: usize, cell: &mut [u32], xi: &mut [[f64; 2]]) {
        let stride = if axis == 0 { 1 } else { self.cells[0] as u32 };
        let mut inside = vec![false; self.num_cells()];
        for (&c, t) in cell.iter().zip(xi.iter()) {
            inside[c as usize] |= t[axis] > BORDER;
        }
        for (c, t) in cell.iter_mut().zip(xi) {
            if !inside[*c as usize] && self.cell_ij(*c as usize)[axis] > 0 {
                *c -= stride;
                t[axis] = 1.0;
            }
        }
    }
}

/// Where the particles are: the cell and the position in it, and the particles cell by cell.
#[derive(Debug, Clone)]
pub struct Location {
    /// The grid the cells belong to.
    pub grid: Grid,
    /// Cell index of each particle.
    pub cell: Vec<u32>,
    /// Position of each particle in its cell, 0 to 1 in x and y.
    pub xi: Vec<[f64; 2]>,
    /// Indices of the cells that hold particles, ascending.
    pub active: Vec<u32>,
    /// Particles of `active[a]` are `order[start[a]..start[a + 1]]`.
    pub start: Vec<u32>,
    /// Particle indices sorted by cell, ascending within a cell: sums repeat to the last bit.
    pub order: Vec<u32>,
}

impl Location {
    fn new(grid: Grid, cell: Vec<u32>, xi: Vec<[f64; 2]>) -> Self {
        let mut count = vec![0u32; grid.num_cells()];
        for &c in &cell {
            count[c as usize] += 1;
        }
        let mut next = vec![0u32; grid.num_cells()];
        let (mut active, mut start, mut total) = (Vec::new(), vec![0u32], 0);
        for (c, &m) in count.iter().enumerate() {
            next[c] = total;
            if m > 0 {
                total += m;
                active.push(c as u32);
                start.push(total);
            }
        }
        let mut order = vec![0u32; cell.len()];
        for (p, &c) in cell.iter().enumerate() {
            let slot = &mut next[c as usize];
            order[*slot as usize] = p as u32;
            *slot += 1;
        }
        Self { grid, cell, xi, active, start, order }
    }

    /// Where some of the particles are, in the order given.
    ///
    /// # Panics
    /// If there is no such particle; callers check at the border.
    #[must_use]
    pub fn select(&self, particles: &[u32]) -> Self {
        let of = |&p: &u32| (self.cell[p as usize], self.xi[p as usize]);
        let (cell, xi) = particles.iter().map(of).unzip();
        Self::new(self.grid, cell, xi)
    }

    /// The same with all particles at least `margin` (in cells) away from the sides of their cells:
    /// where one lies on a side, functions vanish that it alone reaches.
    #[must_use]
    pub fn away_from_sides(mut self, margin: f64) -> Self {
        self.xi.iter_mut().flatten().for_each(|t| *t = t.clamp(margin, 1.0 - margin));
        self
    }

    /// Particles of the a-th active cell.
    #[must_use]
    pub fn particles_of(&self, a: usize) -> &[u32] {
        &self.order[self.start[a] as usize..self.start[a + 1] as usize]
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cell.len()
    }

    /// Whether there are no particles (after [`Location::select`] on a rank without any).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cell.is_empty()
    }
}
