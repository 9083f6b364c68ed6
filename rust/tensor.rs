//! Component order and sign convention, stated once.
//!
//! Tension is positive. Plane strain is three-dimensional with `eps_zz = 0`, so a symmetric tensor
//! has the four components **xx, yy, zz, xy**. A stress carries `sigma_xy`; a strain carries the
//! engineering shear `gamma_xy = 2 eps_xy`, so that `stress . strain` is the work and a tangent
//! `C[i][j] = d stress_i / d strain_j` is symmetric where the material has a potential.
//! In-plane triples keep the order without zz: **xx, yy, xy**.

/// Number of components of a symmetric tensor in plane strain.
pub const COMPONENTS: usize = 4;

/// Stress [Pa] (xx, yy, zz, xy) or strain (xx, yy, zz, gamma_xy).
pub type Sym = [f64; COMPONENTS];

/// Tangent d stress_i / d strain_j [Pa].
pub type Tangent = [[f64; COMPONENTS]; COMPONENTS];

/// Unit tensor.
pub const UNIT: Sym = [1.0, 1.0, 1.0, 0.0];

/// Positions of the in-plane components xx, yy, xy in a [`Sym`].
pub const IN_PLANE: [usize; 3] = [0, 1, 3];

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
