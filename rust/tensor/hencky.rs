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
    det_minus_one, diagonal, eigen, flat, inverse, multiply, rotated, transposed, unit_plus, Matrix,
};
use super::symmetric::{deviator, dot, in_space, Sym};
use super::{Gradient, Moduli, Strain, Stress, MAX_GRADIENT};
use crate::space::GRADIENT;

/// Trial state of a particle in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Elastic logarithmic strain (shear as gamma = 2 eps_xy).
    pub strain: Strain,
    /// ln J_f.
    pub ln_j: f64,
    /// Inverse of f, in the plane and in the hoop direction.
    inverse: Matrix,
    inverse_hoop: f64,
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

impl Trial {
    /// Trial state from the gradient of the displacement increment and the elastic strain before it.
    ///
    /// The volume changes by `volume`, or by ln J_f where the form has no field for it. `None` if f is not
    /// invertible or turns the particle inside out.
    #[must_use]
    pub fn new(g: &Gradient, volume: Option<f64>, old: &Strain) -> Option<Self> {
        let f = unit_plus(&g.in_space);
        let (change, hoop) = (det_minus_one(&g.in_space), 1.0 + g.hoop);
        let j = 1.0 + change;
        let finite = (j * hoop).is_finite();
        if !finite || j <= 0.0 || hoop <= 0.0 {
            return None;
        }
        let ln_hoop = if g.hoop == 0.0 { 0.0 } else { g.hoop.ln_1p() };
        let ln_j = change.ln_1p() + ln_hoop;
        let (inverse, inverse_hoop) = (inverse(&f, j), 1.0 / hoop);
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
        let zz = old.deviator[2] + ln_hoop - ln_j / 3.0;
        // det be = 1: the trace is round-off, and the deviator removes it
        let strain = Strain {
            deviator: deviator(&[log[0][0], log[1][1], zz, 2.0 * log[0][1]]),
            volume: old.volume + volume.unwrap_or(ln_j),
        };
        Some(Self { strain, ln_j, inverse, inverse_hoop, be, vectors, theta })
    }

    /// `P = tau f^-T` (xx, xy, yx, yy, zz), conjugate to grad w on the grid at the start of the step.
    #[must_use]
    pub fn nominal(&self, tau: &Stress) -> [f64; MAX_GRADIENT] {
        let t = in_space(&tau.deviator, tau.mean);
        let hoop = (tau.deviator[2] + tau.mean) * self.inverse_hoop;
        with_hoop(&multiply(&t, &transposed(&self.inverse)), hoop)
    }

    /// Derivative of ln J_f with respect to grad u (xx, xy, yx, yy, zz): f^-T.
    #[must_use]
    pub fn ln_j_gradient(&self) -> [f64; MAX_GRADIENT] {
        with_hoop(&transposed(&self.inverse), self.inverse_hoop)
    }

    /// `dl = dg f^-1`, the change of f with a change `dg` of grad u, seen from the end of the step.
    fn turned(&self, dg: &Gradient) -> Gradient {
        Gradient {
            in_space: multiply(&dg.in_space, &self.inverse),
            hoop: dg.hoop * self.inverse_hoop,
        }
    }

    /// Change of the deviator of the elastic strain with a change `dl = dg f^-1`.
    fn strain_change(&self, dl: &Gradient) -> Sym {
        let third = dl.trace() / 3.0;
        let zz = dl.hoop - third;
        let dl = &dl.in_space;
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
        [de[0][0], de[1][1], zz, 2.0 * de[0][1]]
    }

    /// Change of a number with a change `dg` of grad u, from its derivative with respect to the deviatoric
    /// strain.
    #[must_use]
    pub fn change(&self, slope: &Sym, dg: &Gradient) -> f64 {
        dot(slope, &self.strain_change(&self.turned(dg)))
    }

    /// Change of P with a change `dg` of grad u and a change `dv` of the volume.
    #[must_use]
    pub fn nominal_change(
        &self,
        tau: &Stress,
        c: &Moduli,
        dg: &Gradient,
        dv: f64,
    ) -> [f64; MAX_GRADIENT] {
        let dl = self.turned(dg);
        let strain = self.strain_change(&dl);
        let ds: Sym = std::array::from_fn(|k| dot(&c.dev_dev[k], &strain) + c.dev_vol[k] * dv);
        let dm = dot(&c.mean_dev, &strain) + c.mean_vol * dv;
        let (dt, t) = (in_space(&ds, dm), in_space(&tau.deviator, tau.mean));
        // d(tau f^-T) = d tau f^-T - tau dl^T f^-T
        let turn = multiply(&t, &transposed(&dl.in_space));
        let sum: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| dt[i][j] - turn[i][j]));
        let hoop = ds[2] + dm - (tau.deviator[2] + tau.mean) * dl.hoop;
        with_hoop(&multiply(&sum, &transposed(&self.inverse)), hoop * self.inverse_hoop)
    }

    /// Change of ln J_f with a change `dg` of grad u.
    #[must_use]
    pub fn volume_change(&self, dg: &Gradient) -> f64 {
        self.turned(dg).trace()
    }
}

/// Components of a tensor row by row, then the component zz.
fn with_hoop(in_space: &Matrix, hoop: f64) -> [f64; MAX_GRADIENT] {
    let mut out = [hoop; MAX_GRADIENT];
    out[..GRADIENT].copy_from_slice(&flat(in_space));
    out
}
