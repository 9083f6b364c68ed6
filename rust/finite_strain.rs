//! Finite strain of one step, updated Lagrangian, with elastic logarithmic (Hencky) strains.
//!
//! ```text
//! f = I + grad u      J_f = det f      be_trial = f_bar be f_bar^T
//! f_bar = (exp(eps_v)/J_f)^(1/3) f  (mixed)     or f
//! ```
//!
//! The elastic state travels as the logarithmic strain `1/2 ln be` in its two parts: the deviator
//! follows from the isochoric part of f alone, and the volume adds up (`eps_v`, or `ln J_f`), so that
//! K never multiplies the round-off of the deviator. In these strains the return mapping of an
//! isotropic law is that of small strains (formulation: Simo and Hughes 1998, chapter 9).

use crate::material::{Moduli, Strain, Stress};
use crate::plane::{eigen, multiply, rotated, transposed, Plane};
use crate::tensor::{deviator, dot, Sym};

/// Trial state of a particle in a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trial {
    /// Elastic logarithmic strain (shear as gamma = 2 eps_xy).
    pub strain: Strain,
    /// ln J_f.
    pub ln_j: f64,
    /// Inverse of f, in the plane.
    inverse: Plane,
    /// Isochoric part of be_trial, in the plane.
    be: Plane,
    /// Eigenvectors of `be` (columns) and divided differences of ln/2 at its eigenvalues.
    vectors: Plane,
    theta: Plane,
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
fn be_of(deviator: &Sym) -> Plane {
    let shear = 0.5 * deviator[3];
    let (e, v) = eigen(&[[deviator[0], shear], [shear, deviator[1]]]);
    let b = e.map(|e| (2.0 * e).exp());
    rotated(&[[b[0], 0.0], [0.0, b[1]]], &v)
}

/// `det f - 1`, without the loss of digits where grad u is small.
#[must_use]
pub fn det_minus_one(g: &Plane) -> f64 {
    g[0][0] + g[1][1] + g[0][0] * g[1][1] - g[0][1] * g[1][0]
}

impl Trial {
    /// From the gradient of the displacement increment and the elastic strain before it; the volume
    /// changes by `volume`, or by ln J_f where there is no field for it. `None` if f is not
    /// invertible or turns the particle inside out.
    #[must_use]
    pub fn new(g: &Plane, volume: Option<f64>, old: &Strain) -> Option<Self> {
        let f = [[1.0 + g[0][0], g[0][1]], [g[1][0], 1.0 + g[1][1]]];
        let change = det_minus_one(g);
        let j = 1.0 + change;
        if !j.is_finite() || j <= 0.0 {
            return None;
        }
        let ln_j = change.ln_1p();
        let inverse = [[f[1][1] / j, -f[0][1] / j], [-f[1][0] / j, f[0][0] / j]];
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
        let log = rotated(&[[e[0], 0.0], [0.0, e[1]]], &vectors);
        let zz = old.deviator[2] - ln_j / 3.0;
        // det be = 1 leaves no trace but round-off
        let strain = Strain {
            deviator: deviator(&[log[0][0], log[1][1], zz, 2.0 * log[0][1]]),
            volume: old.volume + volume.unwrap_or(ln_j),
        };
        Some(Self { strain, ln_j, inverse, be, vectors, theta })
    }

    /// `P = tau f^-T` (xx, xy, yx, yy), conjugate to grad w on the grid at the start of the step.
    #[must_use]
    pub fn nominal(&self, tau: &Stress) -> [f64; 4] {
        let t = in_plane(&tau.deviator, tau.mean);
        let p = multiply(&t, &transposed(&self.inverse));
        [p[0][0], p[0][1], p[1][0], p[1][1]]
    }

    /// Derivative of ln J_f with respect to grad u (xx, xy, yx, yy): f^-T.
    #[must_use]
    pub fn ln_j_gradient(&self) -> [f64; 4] {
        let i = &self.inverse;
        [i[0][0], i[1][0], i[0][1], i[1][1]]
    }

    /// Change of the deviator of the elastic strain with a change `dg` of grad u.
    fn strain_change(&self, dl: &Plane) -> Sym {
        let third = (dl[0][0] + dl[1][1]) / 3.0;
        let iso = [[dl[0][0] - third, dl[0][1]], [dl[1][0], dl[1][1] - third]];
        let half = multiply(&iso, &self.be);
        let db = [
            [2.0 * half[0][0], half[0][1] + half[1][0]],
            [half[0][1] + half[1][0], 2.0 * half[1][1]],
        ];
        // d(1/2 ln b) in the eigenvectors of b
        let turned = rotated(&db, &transposed(&self.vectors));
        let scaled: Plane =
            std::array::from_fn(|i| std::array::from_fn(|j| self.theta[i][j] * turned[i][j]));
        let de = rotated(&scaled, &self.vectors);
        [de[0][0], de[1][1], -third, 2.0 * de[0][1]]
    }

    /// Change of the mean stress with a change `dg` of grad u, the volume kept.
    #[must_use]
    pub fn mean_change(&self, c: &Moduli, dg: &Plane) -> f64 {
        dot(&c.mean_dev, &self.strain_change(&multiply(dg, &self.inverse)))
    }

    /// Change of P with a change `dg` of grad u, the volume changing by `dv`.
    #[must_use]
    pub fn nominal_change(&self, tau: &Stress, c: &Moduli, dg: &Plane, dv: f64) -> [f64; 4] {
        let dl = multiply(dg, &self.inverse);
        let strain = self.strain_change(&dl);
        let ds: Sym = std::array::from_fn(|k| dot(&c.dev_dev[k], &strain) + c.dev_vol[k] * dv);
        let dt = in_plane(&ds, dot(&c.mean_dev, &strain) + c.mean_vol * dv);
        let t = in_plane(&tau.deviator, tau.mean);
        // d(tau f^-T) = d tau f^-T - tau dl^T f^-T
        let turn = multiply(&t, &transposed(&dl));
        let sum: Plane = std::array::from_fn(|i| std::array::from_fn(|j| dt[i][j] - turn[i][j]));
        let p = multiply(&sum, &transposed(&self.inverse));
        [p[0][0], p[0][1], p[1][0], p[1][1]]
    }

    /// Change of the volume with a change of grad u where it follows ln J_f.
    #[must_use]
    pub fn volume_change(&self, dg: &Plane) -> f64 {
        let dl = multiply(dg, &self.inverse);
        dl[0][0] + dl[1][1]
    }
}

fn in_plane(s: &Sym, mean: f64) -> Plane {
    [[s[0] + mean, s[3]], [s[3], s[1] + mean]]
}
