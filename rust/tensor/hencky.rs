//! Finite strain of one step, updated Lagrangian, with elastic logarithmic (Hencky) strains.
//!
//! ```text
//! f = I + grad u      J_f = det f      be_trial = f_bar be f_bar^T
//! f_bar = (exp(eps_v)/J_f)^(1/3) f  (mixed)     or f
//! ```
//!
//! The elastic state is the logarithmic strain `1/2 ln be` in its two parts. The deviator follows from the
//! isochoric part of f alone. The volume is a sum (of `eps_v`, or of `ln J_f`), so that K never multiplies
//! the round-off of the deviator. In these strains the return mapping of an isotropic law is that of small
//! strains (Simo and Hughes 1998, chapter 9).

use super::matrix::{
    det_minus_one, diagonal, eigen, flat, inverse, multiply, rotated, trace, transposed, unit_plus,
    Matrix,
};
use super::symmetric::{deviator, dot, in_space, symmetric_part, Sym};
use super::{Moduli, Strain, Stress};
use crate::space::GRADIENT;

/// Trial state of a particle in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Elastic logarithmic strain (shear as gamma = 2 eps_xy).
    pub strain: Strain,
    /// ln J_f.
    pub ln_j: f64,
    /// Inverse of f, in the plane.
    inverse: Matrix,
    /// Isochoric part of be_trial, in the plane.
    be: Matrix,
    /// Eigenvectors of `be` (columns) and divided differences of ln/2 at its eigenvalues.
    vectors: Matrix,
    theta: Matrix,
}

/// `ln(1 + x) / x`, 1 at 0.
fn ln_1p_over(x: f64) -> f64 {
    if x.abs() < 1e-4 {
        1.0 - x / 2.0 + x * x / 3.0 - x * x * x / 4.0
    } else {
        x.ln_1p() / x
    }
}

/// The isochoric be of a logarithmic deviator (shear as gamma), in the plane: `exp(2 e)`.
fn be_of(deviator: &Sym) -> Matrix {
    let shear = 0.5 * deviator[3];
    let (e, v) = eigen(&[[deviator[0], shear], [shear, deviator[1]]]);
    let b = e.map(|e| (2.0 * e).exp());
    rotated(&diagonal(b), &v)
}

/// Logarithmic strain `1/2 ln(F F^T)` of a displacement gradient `h = F - I`, the shear as eps_xy. It keeps
/// its digits where h is small.
#[must_use]
pub fn logarithmic(h: &Matrix) -> Sym {
    let square = multiply(h, &transposed(h));
    let stretch: Matrix =
        std::array::from_fn(|i| std::array::from_fn(|j| h[i][j] + h[j][i] + square[i][j]));
    let (lambda, vectors) = eigen(&stretch);
    symmetric_part(&rotated(&diagonal(lambda.map(|l| 0.5 * l.ln_1p())), &vectors))
}

impl Trial {
    /// Trial state from the gradient of the displacement increment and the elastic strain before it.
    ///
    /// The volume changes by `volume`, or by ln J_f where the form has no field for it. `None` if f is not
    /// invertible or turns the particle inside out.
    #[must_use]
    pub fn new(g: &Matrix, volume: Option<f64>, old: &Strain) -> Option<Self> {
        let f = unit_plus(g);
        let change = det_minus_one(g);
        let j = 1.0 + change;
        if !j.is_finite() || j <= 0.0 {
            return None;
        }
        let ln_j = change.ln_1p();
        let inverse = inverse(&f, j);
        let isochoric = (-2.0 / 3.0 * ln_j).exp();
        let pushed = rotated(&be_of(&old.deviator), &f);
        let be = pushed.map(|row| row.map(|b| b * isochoric));
        let (lambda, vectors) = eigen(&be);
        if lambda[1].is_nan() || lambda[1] <= 0.0 {
            return None;
        }
        let e = lambda.map(|l| 0.5 * l.ln());
        let split = 0.5 * ln_1p_over((lambda[0] - lambda[1]) / lambda[1]) / lambda[1];
        let theta = [[0.5 / lambda[0], split], [split, 0.5 / lambda[1]]];
        let log = rotated(&diagonal(e), &vectors);
        let zz = old.deviator[2] - ln_j / 3.0;
        // det be = 1: the trace is round-off, and the deviator removes it
        let strain = Strain {
            deviator: deviator(&[log[0][0], log[1][1], zz, 2.0 * log[0][1]]),
            volume: old.volume + volume.unwrap_or(ln_j),
        };
        Some(Self { strain, ln_j, inverse, be, vectors, theta })
    }

    /// `P = tau f^-T` (xx, xy, yx, yy), conjugate to grad w on the grid at the start of the step.
    #[must_use]
    pub fn nominal(&self, tau: &Stress) -> [f64; GRADIENT] {
        let t = in_space(&tau.deviator, tau.mean);
        flat(&multiply(&t, &transposed(&self.inverse)))
    }

    /// Derivative of ln J_f with respect to grad u (xx, xy, yx, yy): f^-T.
    #[must_use]
    pub fn ln_j_gradient(&self) -> [f64; GRADIENT] {
        flat(&transposed(&self.inverse))
    }

    /// Change of the deviator of the elastic strain with a change `dl = dg f^-1`.
    fn strain_change(&self, dl: &Matrix) -> Sym {
        let third = trace(dl) / 3.0;
        let iso = [[dl[0][0] - third, dl[0][1]], [dl[1][0], dl[1][1] - third]];
        let half = multiply(&iso, &self.be);
        let db = [
            [2.0 * half[0][0], half[0][1] + half[1][0]],
            [half[0][1] + half[1][0], 2.0 * half[1][1]],
        ];
        // d(1/2 ln b) in the eigenvectors of b
        let turned = rotated(&db, &transposed(&self.vectors));
        let scaled: Matrix =
            std::array::from_fn(|i| std::array::from_fn(|j| self.theta[i][j] * turned[i][j]));
        let de = rotated(&scaled, &self.vectors);
        [de[0][0], de[1][1], -third, 2.0 * de[0][1]]
    }

    /// Change of a number with a change `dg` of grad u, from its derivative with respect to the deviatoric
    /// strain.
    #[must_use]
    pub fn change(&self, slope: &Sym, dg: &Matrix) -> f64 {
        dot(slope, &self.strain_change(&multiply(dg, &self.inverse)))
    }

    /// Change of P with a change `dg` of grad u and a change `dv` of the volume.
    #[must_use]
    pub fn nominal_change(
        &self,
        tau: &Stress,
        c: &Moduli,
        dg: &Matrix,
        dv: f64,
    ) -> [f64; GRADIENT] {
        let dl = multiply(dg, &self.inverse);
        let strain = self.strain_change(&dl);
        let ds: Sym = std::array::from_fn(|k| dot(&c.dev_dev[k], &strain) + c.dev_vol[k] * dv);
        let dt = in_space(&ds, dot(&c.mean_dev, &strain) + c.mean_vol * dv);
        let t = in_space(&tau.deviator, tau.mean);
        // d(tau f^-T) = d tau f^-T - tau dl^T f^-T
        let turn = multiply(&t, &transposed(&dl));
        let sum: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| dt[i][j] - turn[i][j]));
        flat(&multiply(&sum, &transposed(&self.inverse)))
    }

    /// Change of ln J_f with a change `dg` of grad u.
    #[must_use]
    pub fn volume_change(&self, dg: &Matrix) -> f64 {
        trace(&multiply(dg, &self.inverse))
    }
}
