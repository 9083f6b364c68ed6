//! Location of the particles in the grid.

use super::Grid;
use crate::error::{check_finite, Error, Result};
use crate::space::{number_of, strides, Extent, Index, Point, Position, DIM};

/// A particle this close to the border of the grid (in cells) counts as lying on it: positions
/// computed in floating point miss the border by round-off.
const BORDER: f64 = 1e-9;

/// Cell of each particle, position in it, and the particles cell by cell.
#[derive(Debug, Clone)]
pub struct Location {
    /// The grid of the cells.
    pub grid: Grid,
    /// Cell of each particle.
    pub cell: Vec<u32>,
    /// Position of each particle in its cell, 0 to 1 along each axis.
    pub xi: Vec<Point>,
    /// The cells that hold particles, ascending: the active cells.
    pub active: Vec<u32>,
    /// Particles of `active[a]` are `order[start[a]..start[a + 1]]`.
    pub start: Vec<u32>,
    /// Particles sorted by cell, ascending within a cell: the order of every sum over a cell.
    pub order: Vec<u32>,
}

impl Grid {
    /// Cell and position in it along one axis; `None` outside. A particle on an inner side belongs
    /// to the cell on its positive side (but see `leave_border_cells`).
    fn locate_1d(&self, axis: usize, x: f64) -> Option<(usize, f64)> {
        let n = self.cells[axis];
        let s = (x - self.origin[axis]) / self.h - self.first[axis] as f64;
        if !(s >= -BORDER && s <= n as f64 + BORDER) {
            return None;
        }
        let s = s.clamp(0.0, n as f64);
        let cell = (s as usize).min(n - 1);
        Some((cell, s - cell as f64))
    }

    fn locate_point(&self, x: &Point) -> Option<(Index, Point)> {
        let (mut cell, mut xi) = ([0; DIM], [0.0; DIM]);
        for axis in 0..DIM {
            (cell[axis], xi[axis]) = self.locate_1d(axis, x[axis])?;
        }
        Some((cell, xi))
    }

    /// Cells and reference positions of all particles at `x` [m].
    ///
    /// # Errors
    /// [`Error::NotFinite`], or [`Error::OutsideGrid`] with the number of particles outside and the
    /// first of them.
    pub fn locate(&self, x: &[Point]) -> Result<Location> {
        check_finite("x", x.as_flattened(), DIM)?;
        let (mut cell, mut xi) = (Vec::with_capacity(x.len()), Vec::with_capacity(x.len()));
        let mut outside = Vec::new();
        for (p, x) in x.iter().enumerate() {
            if let Some((index, position)) = self.locate_point(x) {
                cell.push(number_of(index, self.cells) as u32);
                xi.push(position);
            } else {
                outside.push(p);
            }
        }
        if let Some(&index) = outside.first() {
            return Err(Error::OutsideGrid {
                count: outside.len(),
                total: x.len(),
                index,
                position: Position(x[index]),
                extent: Extent(self.origin, self.upper()),
            });
        }
        for axis in 0..DIM {
            self.leave_border_cells(axis, &mut cell, &mut xi);
        }
        Ok(Location::new(*self, cell, xi))
    }

    /// Where all particles of a cell lie on its lower side, move them to the cell below. A body that ends
    /// on a line of the grid then has no part in the cells beyond it, whose functions vanish at all
    /// its particles, with their gradients.
    fn leave_border_cells(&self, axis: usize, cell: &mut [u32], xi: &mut [Point]) {
        let stride = strides(self.cells)[axis] as u32;
        let on_side = |t: &Point| t[axis] <= BORDER;
        let mut cells: Vec<u32> =
            cell.iter().zip(xi.iter()).filter(|(_, t)| on_side(t)).map(|(&c, _)| c).collect();
        cells.sort_unstable();
        cells.dedup();
        let mut inside = vec![false; cells.len()];
        for (c, _) in cell.iter().zip(xi.iter()).filter(|(_, t)| !on_side(t)) {
            if let Ok(k) = cells.binary_search(c) {
                inside[k] = true;
            }
        }
        for (c, t) in cell.iter_mut().zip(xi) {
            let moves = cells.binary_search(c).is_ok_and(|k| !inside[k]);
            if moves && self.cell_index(*c as usize)[axis] > 0 {
                *c -= stride;
                t[axis] = 1.0;
            }
        }
    }
}

impl Location {
    /// Location of points whose cells and positions in them are known; these may lie outside the cell, so
    /// that its polynomials are continued.
    #[must_use]
    pub fn new(grid: Grid, cell: Vec<u32>, xi: Vec<Point>) -> Self {
        let mut order: Vec<u32> = (0..cell.len() as u32).collect();
        order.sort_by_key(|&p| cell[p as usize]); // stable; particles of a cell mostly follow one another
        let (mut active, mut start) = (Vec::new(), Vec::new());
        for (at, &p) in order.iter().enumerate() {
            if active.last() != Some(&cell[p as usize]) {
                active.push(cell[p as usize]);
                start.push(at as u32);
            }
        }
        start.push(cell.len() as u32);
        Self { grid, cell, xi, active, start, order }
    }

    /// Location of some of the particles, in the order given.
    ///
    /// # Panics
    /// If there is no such particle; callers check at the border.
    #[must_use]
    pub fn select(&self, particles: &[u32]) -> Self {
        let of = |&p: &u32| (self.cell[p as usize], self.xi[p as usize]);
        let (cell, xi) = particles.iter().map(of).unzip();
        Self::new(self.grid, cell, xi)
    }

    /// The same with all particles at least `margin` (in cells) away from the sides of their cells.
    ///
    /// Functions that only a particle on a side reaches vanish there.
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

    /// Position of the a-th active cell along each axis.
    #[must_use]
    pub fn active_index(&self, a: usize) -> Index {
        self.grid.cell_index(self.active[a] as usize)
    }

    /// The active cells in runs of one row of the grid along x, in their order.
    #[must_use]
    pub fn rows(&self) -> Vec<std::ops::Range<usize>> {
        let row = |a: usize| self.active[a] as usize / self.grid.cells[0];
        let mut rows = Vec::new();
        let mut start = 0;
        for a in 1..=self.active.len() {
            if a == self.active.len() || row(a) != row(start) {
                rows.push(start..a);
                start = a;
            }
        }
        rows
    }

    /// Cell of particle `p` along each axis.
    #[must_use]
    pub fn cell_of(&self, p: usize) -> Index {
        self.grid.cell_index(self.cell[p] as usize)
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.cell.len()
    }

    /// Whether there are no particles (on a rank without any).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.cell.is_empty()
    }
}
