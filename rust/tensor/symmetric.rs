//! Symmetric tensors as rows of components; for their order see [`super`].

use super::Matrix;
use crate::space::{COMPONENTS, SYMMETRIC};

/// Stress [Pa] (xx, yy, zz, xy) or strain (xx, yy, zz, gamma_xy).
pub type Sym = [f64; COMPONENTS];

/// Tangent d stress_i / d strain_j [Pa].
pub type Tangent = [[f64; COMPONENTS]; COMPONENTS];

/// Unit tensor.
pub const UNIT: Sym = [1.0, 1.0, 1.0, 0.0];

/// Most components of a strain that follows from a displacement: those in space, and the hoop strain.
pub const MAX_STRAINS: usize = SYMMETRIC + 1;

/// Positions of these components (xx, yy, xy, and in axisymmetry zz) in a [`Sym`].
pub const STRAINS: [usize; MAX_STRAINS] = [0, 1, 3, 2];

/// Deviators of the unit strains xx, yy, gamma_xy and zz.
pub(crate) const UNIT_DEVIATORS: [Sym; MAX_STRAINS] = [
    [2.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0, 0.0],
    [-1.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
    [-1.0 / 3.0, -1.0 / 3.0, 2.0 / 3.0, 0.0],
];

/// Sum of the products of the components: the work of a stress on a strain.
#[must_use]
pub fn dot(a: &Sym, b: &Sym) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Sum of the normal components.
#[must_use]
pub fn trace(a: &Sym) -> f64 {
    a[0] + a[1] + a[2]
}

/// Mean of the three normal components: the factor is 1/3 also in plane strain.
#[must_use]
pub fn mean(a: &Sym) -> f64 {
    trace(a) / 3.0
}

/// `a - mean(a) I`.
#[must_use]
pub fn deviator(a: &Sym) -> Sym {
    let m = mean(a);
    [a[0] - m, a[1] - m, a[2] - m, a[3]]
}

/// `sqrt(s : s)` of a stress.
pub(crate) fn norm(s: &Sym) -> f64 {
    (s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * s[3] * s[3]).sqrt()
}

/// `s = 2 mu e` component by component: a strain holds gamma_xy = 2 eps_xy, hence mu for the shear.
pub(crate) fn deviatoric_stiffness(mu: f64) -> Sym {
    [2.0 * mu, 2.0 * mu, 2.0 * mu, mu]
}

/// Symmetric part of a tensor with a component zz, the shear as eps_xy.
pub(crate) fn symmetric_part(g: &Matrix, zz: f64) -> Sym {
    [g[0][0], g[1][1], zz, 0.5 * (g[0][1] + g[1][0])]
}

/// Stress in space from its deviator and its mean.
pub(crate) fn in_space(s: &Sym, mean: f64) -> Matrix {
    [[s[0] + mean, s[3]], [s[3], s[1] + mean]]
}
