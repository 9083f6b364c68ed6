//! Isotropic functions of a tensor by its principal values: two in the plane, the third is zz.
//!
//! With `t = sum_a t_a n_a (x) n_a`, of a strain `e` with the same directions,
//!
//! ```text
//! dt = sum_ab dt_a/de_b (n_b . de n_b) n_a (x) n_a
//!      + (t_1 - t_2)/(e_1 - e_2) (n_1 . de n_2) (n_1 (x) n_2 + n_2 (x) n_1)
//! ```
//!
//! (Simo and Hughes 1998, section 6.6); where e_1 = e_2 the quotient means its limit.

use super::matrix::{eigen, Matrix};
use super::symmetric::{Sym, Tangent};

/// A symmetric tensor by its principal values and directions.
pub(crate) struct Principal {
    /// The larger and the smaller value in the plane, then zz.
    pub values: [f64; 3],
    /// `n_a (x) n_a`, components as of a stress.
    own: [Sym; 3],
    /// `n_1 (x) n_2 + n_2 (x) n_1`.
    mixed: Sym,
}

impl Principal {
    /// Of a stress.
    pub fn of_stress(s: &Sym) -> Self {
        Self::of(&[[s[0], s[3]], [s[3], s[1]]], s[2])
    }

    /// Of a strain.
    pub fn of_strain(e: &Sym) -> Self {
        let shear = 0.5 * e[3];
        Self::of(&[[e[0], shear], [shear, e[1]]], e[2])
    }

    fn of(in_plane: &Matrix, zz: f64) -> Self {
        let ([first, second], [[c, _], [s, _]]) = eigen(in_plane);
        Self {
            values: [first, second, zz],
            own: [[c * c, s * s, 0.0, c * s], [s * s, c * c, 0.0, -c * s], [0.0, 0.0, 1.0, 0.0]],
            mixed: [-2.0 * c * s, 2.0 * c * s, 0.0, c * c - s * s],
        }
    }

    /// The stress with these principal values and the same directions.
    pub fn stress(&self, values: &[f64; 3]) -> Sym {
        std::array::from_fn(|i| (0..3).map(|a| values[a] * self.own[a][i]).sum())
    }

    /// The strain with these principal values and the same directions.
    pub fn strain(&self, values: &[f64; 3]) -> Sym {
        let [xx, yy, zz, xy] = self.stress(values);
        [xx, yy, zz, 2.0 * xy]
    }

    /// Tangent d stress / d strain from `moduli[a][b]` = dt_a/de_b and `split` = (t_1 - t_2)/(e_1 - e_2).
    pub fn tangent(&self, moduli: &[[f64; 3]; 3], split: f64) -> Tangent {
        let rows = moduli.each_ref().map(|row| self.stress(row)); // n_b . de n_b = own[b] . de
        std::array::from_fn(|i| {
            std::array::from_fn(|j| {
                let own: f64 = (0..3).map(|a| self.own[a][i] * rows[a][j]).sum();
                own + 0.5 * split * self.mixed[i] * self.mixed[j]
            })
        })
    }
}
