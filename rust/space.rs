//! The space of the computation: the plane, with plane strain or axisymmetry.
//!
//! This module owns every number that follows from the dimension. Other modules use its names and loop over
//! axes; they contain no literal 2, 4, 9 or 18 of the plane. Two things are particular to the plane beyond
//! these numbers, and both are in [`crate::tensor`]: the component zz, which has no axis in the
//! grid, and the closed forms of eigenvalues and inverse of a 2 x 2 tensor.
//!
//! In three dimensions `DIM` is 3, `COMPONENTS` and `SHEARS` follow, and `tensor` gets a second set
//! of closed forms. The names are constants rather than parameters of types because Rust cannot yet
//! compute the length of an array from a parameter (`3^DIM`); one build computes in one space.

use std::fmt::{self, Display, Formatter};
use std::str::FromStr;

use crate::error::Error;

/// Number of axes, of coordinates and of displacement components.
pub const DIM: usize = 2;

/// Components of a symmetric tensor that a law sees (xx, yy, zz and the shears).
pub const COMPONENTS: usize = 3 + SHEARS;

/// Shear components of a symmetric tensor in space (xy).
pub const SHEARS: usize = DIM * (DIM - 1) / 2;

/// Components of a symmetric tensor in space (xx, yy, xy).
pub const SYMMETRIC: usize = DIM + SHEARS;

/// Components of a gradient of a vector in space (xx, xy, yx, yy).
pub const GRADIENT: usize = DIM * DIM;

/// Meaning of the axes of the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Geometry {
    /// Cartesian axes; the strain zz is zero.
    PlaneStrain,
    /// The first axis is the radius, the last one the axis of rotation, and zz the hoop direction.
    Axisymmetric,
}

impl Geometry {
    /// Components that belong to the hoop direction: 1 or 0.
    const fn hoop(self) -> usize {
        match self {
            Self::PlaneStrain => 0,
            Self::Axisymmetric => 1,
        }
    }

    /// Components of the strain of a displacement (xx, yy, gamma_xy, and the hoop strain zz).
    #[must_use]
    pub const fn strains(self) -> usize {
        SYMMETRIC + self.hoop()
    }

    /// Components of the gradient of a displacement (xx, xy, yx, yy, and the hoop strain zz).
    #[must_use]
    pub const fn gradients(self) -> usize {
        GRADIENT + self.hoop()
    }

    /// Numbers in the rows of the gradient of a displacement as a tensor: 2 x 2, or 3 x 3.
    #[must_use]
    pub const fn tensor(self) -> usize {
        (DIM + self.hoop()) * (DIM + self.hoop())
    }
}

impl FromStr for Geometry {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "plane_strain" => Ok(Self::PlaneStrain),
            "axisymmetric" => Ok(Self::Axisymmetric),
            _ => Err(Error::UnknownName {
                what: "geometry",
                name: name.to_owned(),
                expected: "'plane_strain', 'axisymmetric'",
            }),
        }
    }
}

/// Most functions of a basis that do not vanish on a cell, along one axis.
pub const FUNCTIONS_1D: usize = 3;

/// Most functions of a basis that do not vanish on a cell.
pub const FUNCTIONS: usize = FUNCTIONS_1D.pow(DIM as u32);

/// Most rows along x of the functions that do not vanish on a cell.
pub const ROWS: usize = FUNCTIONS_1D.pow(DIM as u32 - 1);

/// Nodes of a quadratic Lagrange cell along one axis.
pub const NODES_1D: usize = 3;

/// Nodes of a quadratic Lagrange cell.
pub const NODES: usize = NODES_1D.pow(DIM as u32);

/// Vertices of a cell: the nodes of a linear Lagrange cell.
pub const VERTICES: usize = 1 << DIM;

/// A position or a vector.
pub type Point = [f64; DIM];

/// A whole number along each axis: of cells, of functions or of points of a rule.
pub type Index = [usize; DIM];

/// First and last index along each axis.
pub type Block = [[usize; 2]; DIM];

/// Measure of a cube of side `h`.
#[must_use]
pub fn volume_of_cell(h: f64) -> f64 {
    [h; DIM].iter().product()
}

/// How many indices lie below `size`.
#[must_use]
pub fn count(size: Index) -> usize {
    size.iter().product()
}

/// Position of an index among all below `size`, x fastest.
#[must_use]
pub fn number_of(index: Index, size: Index) -> usize {
    index.iter().zip(size).rev().fold(0, |number, (&i, n)| number * n + i)
}

/// The reverse of [`number_of`].
#[must_use]
pub fn index_of(mut number: usize, size: Index) -> Index {
    let mut index = [0; DIM];
    for axis in 0..DIM - 1 {
        (index[axis], number) = (number % size[axis], number / size[axis]);
    }
    index[DIM - 1] = number;
    index
}

/// Distance of the numbers of two neighbours along each axis.
#[must_use]
pub fn strides(size: Index) -> Index {
    let mut stride = 1;
    size.map(|n| {
        let here = stride;
        stride *= n;
        here
    })
}

/// All indices in a block, x fastest.
pub fn indices(block: Block) -> impl Iterator<Item = Index> + Clone {
    let next = move |index: &Index| {
        let mut next = *index;
        for axis in 0..DIM {
            if next[axis] < block[axis][1] {
                next[axis] += 1;
                return Some(next);
            }
            next[axis] = block[axis][0];
        }
        None
    };
    std::iter::successors(Some(block.map(|[first, _]| first)), next)
}

/// All indices below `size`, which is at least 1 along each axis; x fastest.
pub fn indices_below(size: Index) -> impl Iterator<Item = Index> {
    indices(size.map(|n| [0, n - 1]))
}

/// A position as it appears in messages: its coordinates in parentheses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position(pub Point);

impl Display for Position {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let coordinates: Vec<String> = self.0.iter().map(f64::to_string).collect();
        write!(f, "({})", coordinates.join(", "))
    }
}

/// Lower and upper corner of a box, in messages its intervals along the axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extent(pub Point, pub Point);

impl Display for Extent {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let interval = |(a, b)| format!("[{a}, {b}]");
        let intervals: Vec<String> = self.0.iter().zip(self.1).map(interval).collect();
        f.write_str(&intervals.join(" x "))
    }
}
