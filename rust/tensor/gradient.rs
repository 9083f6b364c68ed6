//! The gradient of a displacement: its part in space, and the hoop strain of axisymmetry.
//!
//! In axisymmetry `grad u` has the third component `u_r / r` on its diagonal (rows r, z, hoop). Elsewhere it
//! is zero, and every formula below is that of the plane.

use super::matrix::{
    det_minus_one, diagonal, eigen, flat, matrix, multiply, rotated, trace, transposed, Matrix,
};
use super::symmetric::{symmetric_part, Sym};
use super::Strain;
use crate::space::{Geometry, DIM, GRADIENT};

/// Most components of a gradient: those in space, and the hoop strain.
pub const MAX_GRADIENT: usize = GRADIENT + 1;

/// Gradient of a displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gradient {
    /// Its part in space.
    pub in_space: Matrix,
    /// Hoop strain u_r / r; 0 in plane strain.
    pub hoop: f64,
}

impl From<Matrix> for Gradient {
    fn from(in_space: Matrix) -> Self {
        Self { in_space, hoop: 0.0 }
    }
}

impl Gradient {
    /// Unit change of the k-th component (xx, xy, yx, yy, hoop).
    #[must_use]
    pub fn unit(k: usize) -> Self {
        let mut unit = [0.0; MAX_GRADIENT];
        unit[k] = 1.0;
        Self { in_space: matrix(&unit), hoop: unit[GRADIENT] }
    }

    /// From the rows of the tensor as particles store it.
    #[must_use]
    pub fn of_rows(rows: &[f64]) -> Self {
        if rows.len() == GRADIENT {
            return Self::from(matrix(rows));
        }
        let in_space = std::array::from_fn(|i| std::array::from_fn(|j| rows[(DIM + 1) * i + j]));
        Self { in_space, hoop: rows[rows.len() - 1] }
    }

    /// Write the rows of the tensor; the reverse of [`Gradient::of_rows`].
    pub fn write(&self, geometry: Geometry, rows: &mut [f64]) {
        if geometry == Geometry::PlaneStrain {
            rows.copy_from_slice(&flat(&self.in_space));
            return;
        }
        rows.fill(0.0);
        for (i, row) in self.in_space.iter().enumerate() {
            rows[(DIM + 1) * i..][..DIM].copy_from_slice(row);
        }
        rows[(DIM + 1) * (DIM + 1) - 1] = self.hoop;
    }

    /// div u.
    #[must_use]
    pub fn trace(&self) -> f64 {
        trace(&self.in_space) + self.hoop
    }

    /// `det(I + grad u) - 1`, which keeps its digits where grad u is small.
    #[must_use]
    pub fn det_minus_one(&self) -> f64 {
        let change = det_minus_one(&self.in_space);
        change + self.hoop * (1.0 + change)
    }

    /// `(I + self) (I + before) - I`.
    #[must_use]
    pub fn after(&self, before: &Self) -> Self {
        let product = multiply(&self.in_space, &before.in_space);
        let sum = |i: usize, j: usize| self.in_space[i][j] + product[i][j];
        Self {
            in_space: std::array::from_fn(|i| {
                std::array::from_fn(|j| before.in_space[i][j] + sum(i, j))
            }),
            hoop: before.hoop + (self.hoop + self.hoop * before.hoop),
        }
    }

    /// Small strain.
    #[must_use]
    pub(crate) fn small_strain(&self) -> Strain {
        let (g, volume) = (&self.in_space, self.trace());
        let third = volume / 3.0;
        let shear = g[0][1] + g[1][0];
        Strain { deviator: [g[0][0] - third, g[1][1] - third, self.hoop - third, shear], volume }
    }

    /// Symmetric part, the shear as eps_xy.
    #[must_use]
    pub(crate) fn symmetric_part(&self) -> Sym {
        symmetric_part(&self.in_space, self.hoop)
    }

    /// Logarithmic strain `1/2 ln(F F^T)` of `F = I + self`, the shear as eps_xy. It keeps its digits where
    /// the gradient is small.
    #[must_use]
    pub fn logarithmic(&self) -> Sym {
        let h = &self.in_space;
        let square = multiply(h, &transposed(h));
        let stretch: Matrix =
            std::array::from_fn(|i| std::array::from_fn(|j| h[i][j] + h[j][i] + square[i][j]));
        let (lambda, vectors) = eigen(&stretch);
        let in_space = rotated(&diagonal(lambda.map(|l| 0.5 * l.ln_1p())), &vectors);
        symmetric_part(&in_space, self.hoop.ln_1p())
    }
}
