//! Tensors in space as matrices, with the closed forms of the plane.

use crate::space::{DIM, GRADIENT};

/// Second-order tensor in space, `[row][column]`.
pub type Matrix = [[f64; DIM]; DIM];

/// `a b`.
pub(crate) fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

/// `a^T`.
pub(crate) fn transposed(a: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[j][i]))
}

/// `v a v^T`.
pub(crate) fn rotated(a: &Matrix, v: &Matrix) -> Matrix {
    multiply(&multiply(v, a), &transposed(v))
}

/// Sum of the diagonal.
pub(crate) fn trace(a: &Matrix) -> f64 {
    a[0][0] + a[1][1]
}

/// `det(I + g) - 1`, which keeps its digits where g is small.
#[must_use]
pub fn det_minus_one(g: &Matrix) -> f64 {
    g[0][0] + g[1][1] + g[0][0] * g[1][1] - g[0][1] * g[1][0]
}

/// `I + g`.
pub(crate) fn unit_plus(g: &Matrix) -> Matrix {
    [[1.0 + g[0][0], g[0][1]], [g[1][0], 1.0 + g[1][1]]]
}

/// Inverse of a tensor with the given determinant.
pub(crate) fn inverse(f: &Matrix, det: f64) -> Matrix {
    [[f[1][1] / det, -f[0][1] / det], [-f[1][0] / det, f[0][0] / det]]
}

/// `det(f) f^-T`.
pub(crate) fn cofactor(f: &Matrix) -> Matrix {
    [[f[1][1], -f[1][0]], [-f[0][1], f[0][0]]]
}

/// Components row by row.
pub(crate) fn flat(a: &Matrix) -> [f64; GRADIENT] {
    std::array::from_fn(|k| a[k / DIM][k % DIM])
}

/// The tensor with these components, row by row.
#[must_use]
pub fn matrix(components: &[f64]) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| components[DIM * i + j]))
}

/// Eigenvalues, the larger first, and eigenvectors (columns) of a symmetric tensor.
pub(crate) fn eigen(a: &Matrix) -> ([f64; DIM], Matrix) {
    let (middle, half) = (0.5 * (a[0][0] + a[1][1]), 0.5 * (a[0][0] - a[1][1]));
    let radius = half.hypot(a[0][1]);
    let angle = 0.5 * a[0][1].atan2(half);
    let (s, c) = angle.sin_cos();
    ([middle + radius, middle - radius], [[c, -s], [s, c]])
}

/// The diagonal tensor with these values.
pub(crate) fn diagonal(values: [f64; DIM]) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| if i == j { values[i] } else { 0.0 }))
}
