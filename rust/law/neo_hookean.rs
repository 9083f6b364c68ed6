//! Neo-Hookean elasticity at finite strain: `tau = mu dev(be_bar) + K ln J I`.
//!
//! be_bar is the left Cauchy-Green tensor scaled to det = 1, `exp(2 e)` of the logarithmic deviator
//! e; the energy is `mu/2 (tr be_bar - 3) + K/2 ln^2 J` (the deviatoric part: Simo and Hughes 1998,
//! section 9.2). With principal values b_a = exp(2 e_a),
//!
//! ```text
//! s_a = mu (b_a - tr b / 3)     ds_a/de_b = 2 mu (delta_ab - 1/3) b_b
//! (s_1 - s_2)/(e_1 - e_2) = 2 mu b_2 (exp(x) - 1)/x,  x = 2 (e_1 - e_2)
//! ```

use std::sync::Arc;

use super::{volumetric_energy, Elastic, Law, LinearElastic, Maker};
use crate::tensor::{Moduli, Principal, Strain, Stress};

pub(super) const MAKER: Maker = Maker {
    name: "neo_hookean",
    parameters: &[],
    make: |elastic, _| Ok(Arc::new(NeoHookean::new(elastic))),
};

/// Neo-Hookean elasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NeoHookean {
    elastic: LinearElastic,
}

impl NeoHookean {
    /// With the moduli of the linear law that it is at small strain.
    #[must_use]
    pub fn new(elastic: LinearElastic) -> Self {
        Self { elastic }
    }
}

/// `(exp(x) - 1) / x`, 1 at 0.
fn exp_m1_over(x: f64) -> f64 {
    if x == 0.0 {
        return 1.0;
    }
    x.exp_m1() / x
}

/// The t of `prod_a (x_a + 1 + t) = 1`, given x of trace 0.
///
/// To the right of the root the product is convex and increasing, so Newton's method descends monotonically
/// from a t where every factor is at least 1. The logarithm of the product keeps the digits of small and
/// of large x.
fn shift(x: &[f64; 3]) -> f64 {
    let mut t = -x.iter().fold(0.0_f64, |least, &x| least.min(x));
    loop {
        let log: f64 = x.iter().map(|x| (x + t).ln_1p()).sum();
        let slope: f64 = x.iter().map(|x| 1.0 / (1.0 + x + t)).sum();
        let next = t + (-log).exp_m1() / slope;
        if next >= t || next.is_nan() {
            return t;
        }
        t = next;
    }
}

impl Elastic for NeoHookean {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }

    /// `be_bar = s/mu + (1 + t) I` with det = 1, and half its logarithm.
    fn elastic_strain(&self, stress: &Stress) -> Strain {
        let mu = self.shear_modulus();
        let principal = Principal::of_stress(&stress.deviator.map(|s| s / mu));
        let t = shift(&principal.values);
        Strain {
            deviator: principal.strain(&principal.values.map(|x| 0.5 * (x + t).ln_1p())),
            volume: stress.mean / self.bulk_modulus(),
        }
    }

    /// `mu/2 (tr be_bar - 3) + K/2 ln^2 J`, the trace from m and r, mean and half the difference of
    /// the principal strains in the plane: with y = exp(2 m),
    /// `tr be_bar - 3 = 4 y sinh^2 r + (y - 1)^2 (2 y + 1)/y^2`.
    fn elastic_energy(&self, strain: &Strain) -> f64 {
        let [first, second, _] = Principal::of_strain(&strain.deviator).values;
        let (m, r) = (0.5 * (first + second), 0.5 * (first - second));
        let (y, y_minus_one) = ((2.0 * m).exp(), (2.0 * m).exp_m1());
        let trace_minus_three =
            4.0 * y * r.sinh().powi(2) + (y_minus_one / y).powi(2) * (2.0 * y + 1.0);
        0.5 * self.shear_modulus() * trace_minus_three
            + volumetric_energy(self.bulk_modulus(), strain.volume)
    }
}

impl Law for NeoHookean {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn finite_only(&self) -> bool {
        true
    }

    /// `strain` is the total elastic strain; `old` is zero (see [`crate::tensor::hencky`]).
    fn respond(
        &self,
        strain: &Strain,
        old: &Stress,
        _history: &[f64],
        _new: &mut [f64],
    ) -> (Stress, Moduli) {
        let (Stress { mean, .. }, moduli) = self.elastic.respond(strain, old, &[], &mut []);
        let mu = self.shear_modulus();
        let principal = Principal::of_strain(&strain.deviator);
        let b_minus_one = principal.values.map(|e| (2.0 * e).exp_m1());
        let third = b_minus_one.iter().sum::<f64>() / 3.0;
        let deviator = principal.stress(&b_minus_one.map(|b| mu * (b - third)));
        let along = |a: usize, b: usize| {
            let unit = if a == b { 2.0 / 3.0 } else { -1.0 / 3.0 };
            2.0 * mu * unit * (1.0 + b_minus_one[b])
        };
        let own = std::array::from_fn(|a| std::array::from_fn(|b| along(a, b)));
        let [first, second, _] = principal.values;
        let split = 2.0 * mu * (1.0 + b_minus_one[1]) * exp_m1_over(2.0 * (first - second));
        let dev_dev = principal.tangent(&own, split);
        (Stress { deviator, mean }, Moduli { dev_dev, ..moduli })
    }
}
