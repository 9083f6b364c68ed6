//! Uniform background grid: its cells, bases, quadrature rules, and the location of particles in it.

mod active;
mod basis;
mod extraction;
mod functions;
mod location;
mod near;
mod rule;

pub use active::Active;
pub use basis::{Basis, Local};
pub use extraction::{extraction, Extraction};
pub(crate) use functions::sum;
pub use functions::{products, products_of, CellFunctions, Functions};
pub use location::Location;
pub use near::Search;
pub use rule::{Rule, MAX_POINTS};

use crate::error::{Error, Result};
use crate::space::{count, index_of, Geometry, Index, Point, DIM};

/// Largest number of cells along an axis.
pub const MAX_CELLS: usize = 1 << 15;

/// Uniform grid of cubes of side `h` (squares in the plane). Cells are numbered x fastest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Lower corner [m].
    pub origin: Point,
    /// Side of a cell [m].
    pub h: f64,
    /// Number of cells along each axis.
    pub cells: Index,
    /// Meaning of the axes.
    pub geometry: Geometry,
    /// Cells below the first one along each axis; not 0 in a part of a larger grid, whose origin it keeps.
    pub first: Index,
}

impl Grid {
    /// A grid in plane strain; `h` must be positive and finite, and there must be at least one cell along
    /// each axis.
    ///
    /// # Errors
    /// [`Error::Parameter`] with the parameter that is out of range.
    pub fn new(origin: Point, h: f64, cells: Index) -> Result<Self> {
        const ORIGIN: [&str; 3] = ["origin[0]", "origin[1]", "origin[2]"];
        const CELLS: [&str; 3] = ["cells[0]", "cells[1]", "cells[2]"];
        let geometry = Geometry::PlaneStrain;
        let refuse = |name, value, expected| Err(Error::Parameter { name, value, expected });
        if !(h.is_finite() && h > 0.0) {
            return refuse("h", h, "a positive cell size in m");
        }
        for axis in 0..DIM {
            if !origin[axis].is_finite() {
                return refuse(ORIGIN[axis], origin[axis], "a finite position in m");
            }
        }
        for axis in 0..DIM {
            if cells[axis] == 0 || cells[axis] > MAX_CELLS {
                return refuse(CELLS[axis], cells[axis] as f64, "between 1 and 32768 cells");
            }
        }
        Ok(Self { origin, h, cells, geometry, first: [0; DIM] })
    }

    /// The grid with another meaning of its axes.
    ///
    /// # Errors
    /// [`Error::Parameter`] if cells lie left of the axis.
    pub fn with(self, geometry: Geometry) -> Result<Self> {
        let (name, value) = ("origin[0]", self.origin[0]);
        if geometry == Geometry::Axisymmetric && value < 0.0 {
            let expected = "at least 0 in axisymmetry, where x is the distance from the axis";
            return Err(Error::Parameter { name, value, expected });
        }
        Ok(Self { geometry, ..self })
    }

    /// The part of the grid with these cells, which are counted from its own first cell. At its ends functions
    /// are as at those of the grid: they have a meaning in its inner cells, and where the grid ends too.
    #[must_use]
    pub fn window(self, first: Index, cells: Index) -> Self {
        Self { cells, first, ..self }
    }

    /// Number of cells.
    #[must_use]
    pub fn num_cells(&self) -> usize {
        count(self.cells)
    }

    /// Position of a cell along each axis.
    #[must_use]
    pub fn cell_index(&self, cell: usize) -> Index {
        index_of(cell, self.cells)
    }

    /// Coordinates [m] of a position in a cell.
    #[must_use]
    pub fn position(&self, cell: Index, xi: Point) -> Point {
        let along = |axis: usize| (self.first[axis] + cell[axis]) as f64 + xi[axis];
        std::array::from_fn(|axis| self.origin[axis] + self.h * along(axis))
    }

    /// Upper corner [m].
    #[must_use]
    pub fn upper(&self) -> Point {
        std::array::from_fn(|axis| self.origin[axis] + self.h * self.cells[axis] as f64)
    }
}
