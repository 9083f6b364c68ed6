//! Second-order tensors in the plane.

/// In-plane second-order tensor, `[row][column]`.
pub type Plane = [[f64; 2]; 2];

/// `a b`.
pub(crate) fn multiply(a: &Plane, b: &Plane) -> Plane {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

/// `a^T`.
pub(crate) fn transposed(a: &Plane) -> Plane {
    [[a[0][0], a[1][0]], [a[0][1], a[1][1]]]
}

/// Eigenvalues, the larger first, and eigenvectors (columns) of a symmetric tensor.
pub(crate) fn eigen(a: &Plane) -> ([f64; 2], Plane) {
    let (middle, half) = (0.5 * (a[0][0] + a[1][1]), 0.5 * (a[0][0] - a[1][1]));
    let radius = half.hypot(a[0][1]);
    let angle = 0.5 * a[0][1].atan2(half);
    let (s, c) = angle.sin_cos();
    ([middle + radius, middle - radius], [[c, -s], [s, c]])
}

/// `v a v^T`.
pub(crate) fn rotated(a: &Plane, v: &Plane) -> Plane {
    multiply(&multiply(v, a), &transposed(v))
}
