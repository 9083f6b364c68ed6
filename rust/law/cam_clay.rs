//! Modified Cam-Clay (Roscoe and Burland 1968): `F = q^2/M^2 + (p + p_t)(p - p_c) <= 0`, associated flow.
//!
//! Here p is the mean stress, compression positive, `q = sqrt(3/2 s : s)`, p_c the preconsolidation pressure
//! and p_t a small isotropic tensile strength. Hardening follows Butterfield (1979), in logarithmic indices:
//! with the plastic compression v and `theta = lambda* - kappa*`, `d ln p_c = d v / theta`.
//!
//! Return (Borja and Lee 1990; at finite strain Borja and Tamagnini 1998), with K and mu constant:
//!
//! ```text
//! g = dF/dp = 2 p + p_t - p_c        v = d_gamma g        p = p_trial - K v
//! s = s_trial / a,  a = 1 + 6 mu d_gamma / M^2            p_c = p_c_old exp(v / theta)
//! ```
//!
//! For a given d_gamma the last equation has one solution p_c; then F = 0 is one equation for d_gamma.
//! At a given mean stress the return has K = 0 here, and the plastic volumetric strain is -v. Dry of
//! critical, g < 0, the clay softens, until p_c = p_t.

use std::sync::Arc;

use super::{Elastic, Law, LinearElastic, Maker, Parameter, ROUND_OFF, SOFT};
use crate::error::{Error, Result};
use crate::space::COMPONENTS;
use crate::tensor::{deviatoric_stiffness, norm, AtMean, Moduli, Strain, Stress, Sym, Tangent};

pub(super) const MAKER: Maker = Maker {
    name: "cam_clay",
    parameters: &[
        Parameter::Required("M"),
        Parameter::Required("lambda_star"),
        Parameter::Required("kappa_star"),
        Parameter::Required("preconsolidation"),
        Parameter::Optional("tension", 0.01),
    ],
    make: |elastic, given| {
        let [m, lambda_star, kappa_star, p_c, tension] = std::array::from_fn(|i| given[i]);
        Ok(Arc::new(CamClay::new(elastic, m, lambda_star, kappa_star, p_c, tension)?))
    },
};

/// Most Newton iterations of a return; about 10 are usual.
const ITERATIONS: usize = 200;

/// Modified Cam-Clay.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CamClay {
    elastic: LinearElastic,
    m_squared: f64,
    theta: f64,
    preconsolidation: f64,
    /// p_t [Pa].
    tension: f64,
}

/// A trial state: deviatoric stress q, pressure p, old p_c, and K where the strain is given, 0 where the
/// mean stress is.
struct Trial {
    q: f64,
    p: f64,
    p_c: f64,
    bulk: f64,
}

/// State after plastic flow of d_gamma.
struct Flow {
    gamma: f64,
    q: f64,
    p: f64,
    p_c: f64,
    /// Plastic compression.
    v: f64,
    /// dF/dp.
    g: f64,
    /// Share of the trial deviator that is lost, a.
    a: f64,
    /// `1 + (2 K + d p_c/dv) d_gamma`: d v / d d_gamma is g over this.
    b: f64,
    /// F.
    excess: f64,
    /// - dF / d d_gamma.
    slope: f64,
    /// dF / d p_trial.
    along_p: f64,
}

impl Flow {
    /// dv from changes of d_gamma and p_trial.
    fn compression(&self, d_gamma: f64, d_p: f64) -> f64 {
        (2.0 * self.gamma * d_p + self.g * d_gamma) / self.b
    }
}

impl CamClay {
    /// From the elastic law, the slopes M of the critical state line, lambda* and kappa* of virgin compression
    /// and swelling (- d ln(volume) / d ln p), the preconsolidation pressure [Pa] of particles whose history
    /// variable is 0, and the isotropic tensile strength as a share of it.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn new(
        elastic: LinearElastic,
        m: f64,
        lambda_star: f64,
        kappa_star: f64,
        preconsolidation: f64,
        tension: f64,
    ) -> Result<Self> {
        let refuse = |name, value, expected| Err(Error::Parameter { name, value, expected });
        let positive = |value: f64| value > 0.0 && value.is_finite();
        if !positive(m) {
            return refuse("M", m, "a positive, finite slope of the critical state line");
        }
        if !(kappa_star >= 0.0 && kappa_star.is_finite()) {
            return refuse("kappa_star", kappa_star, "a finite slope of at least 0");
        }
        if !(lambda_star > kappa_star && lambda_star.is_finite()) {
            return refuse("lambda_star", lambda_star, "a finite slope larger than kappa_star");
        }
        if !positive(preconsolidation) {
            let expected = "a positive, finite pressure in Pa";
            return refuse("preconsolidation", preconsolidation, expected);
        }
        if !(tension > 0.0 && tension <= 1.0) {
            let expected = "a share of preconsolidation, 0 < tension <= 1";
            return refuse("tension", tension, expected);
        }
        let (m_squared, theta) = (m * m, lambda_star - kappa_star);
        if m_squared * preconsolidation >= 12.0 * elastic.shear_modulus() * theta {
            let expected = "less than 12 mu (lambda_star - kappa_star) / M^2, since otherwise the clay \
                            softens faster than it unloads elastically";
            return refuse("preconsolidation", preconsolidation, expected);
        }
        let tension = tension * preconsolidation;
        Ok(Self { elastic, m_squared, theta, preconsolidation, tension })
    }

    /// p_c at the start of a step.
    fn old(&self, history: &[f64]) -> f64 {
        let stored = if history[0] == 0.0 { self.preconsolidation } else { history[0] };
        stored.max(self.tension)
    }

    /// `ln(p_c / p_c_old)` after flow of d_gamma: the root x of
    /// `theta x = d_gamma (2 p_trial + p_t - p_c_old exp(x)) / (1 + 2 K d_gamma)`.
    ///
    /// The difference of the sides is convex and increasing, so Newton's method descends monotonically from
    /// the right of the root.
    fn growth(&self, trial: &Trial, gamma: f64) -> f64 {
        let push = (2.0 * trial.p + self.tension) / trial.p_c;
        let c = gamma * trial.p_c / (self.theta * (1.0 + 2.0 * trial.bulk * gamma));
        let mut x = 0.0;
        if push > 1.0 {
            x = (c * (push - 1.0) / (1.0 + c)).min(push.ln());
        }
        loop {
            let next = x - (x - c * (push - f64::exp(x))) / (1.0 + c * f64::exp(x));
            if next >= x || next.is_nan() {
                return x;
            }
            x = next;
        }
    }

    /// The state after plastic flow of d_gamma.
    fn after(&self, trial: &Trial, gamma: f64) -> Flow {
        let least = (self.tension / trial.p_c).ln();
        let x = self.growth(trial, gamma).max(least);
        let p_c = trial.p_c * x.exp();
        let stiffness = if x > least { p_c / self.theta } else { 0.0 };
        let elastic = 1.0 + 2.0 * trial.bulk * gamma;
        // near the critical state the difference would lose its digits
        let g = if x > least && gamma > 0.0 {
            self.theta * x / gamma
        } else {
            (2.0 * trial.p + self.tension - p_c) / elastic
        };
        let (v, a) = (gamma * g, 1.0 + 6.0 * self.shear_modulus() * gamma / self.m_squared);
        let (q, p) = (trial.q / a, trial.p - trial.bulk * v);
        let b = elastic + stiffness * gamma;
        let size = p + self.tension;
        // dF = .. - along_v dv
        let along_v = trial.bulk * g + size * stiffness;
        let shear = 12.0 * self.shear_modulus() * q * q / (self.m_squared * self.m_squared * a);
        Flow {
            gamma,
            q,
            p,
            p_c,
            v,
            g,
            a,
            b,
            excess: q * q / self.m_squared + size * (p - p_c),
            slope: shear + along_v * g / b,
            along_p: g - 2.0 * gamma * along_v / b,
        }
    }

    /// Return of a trial state beyond the ellipse: Newton's method for F(d_gamma) = 0 between bounds.
    fn return_of(&self, trial: &Trial) -> Option<Flow> {
        let mut flow = self.after(trial, 0.0);
        let size = trial.q * trial.q / self.m_squared
            + (trial.p + self.tension).abs() * (trial.p.abs() + trial.p_c);
        if flow.excess <= ROUND_OFF * size {
            return None;
        }
        let (mut low, mut high) = (0.0, f64::INFINITY);
        for _ in 0..ITERATIONS {
            *(if flow.excess > 0.0 { &mut low } else { &mut high }) = flow.gamma;
            let mut next = flow.gamma + flow.excess / flow.slope;
            if !(low <= next && next <= high) {
                let further = 2.0 * low + self.m_squared / self.shear_modulus();
                next = if high.is_finite() { 0.5 * (low + high) } else { further };
            }
            let change = (next - flow.gamma).abs();
            flow = self.after(trial, next);
            if change <= 4.0 * f64::EPSILON * next {
                break;
            }
        }
        Some(flow)
    }

    /// Deviator after a return, its derivative with respect to the deviatoric strain, and those of the
    /// deviator and d_gamma with respect to p_trial and d_gamma: `(s, ds/de, ds/d gamma, d gamma/de)`.
    fn shear(&self, trial: &Sym, flow: &Flow) -> (Sym, Tangent, Sym, Sym) {
        let mu = self.shear_modulus();
        let elastic = deviatoric_stiffness(mu);
        let s = trial.map(|s| s / flow.a);
        let fall = 6.0 * mu / (self.m_squared * flow.a);
        let s_gamma = s.map(|s| -fall * s);
        let gamma_e = s.map(|s| fall * s / flow.slope);
        let entry = |i: usize, j: usize| {
            let diagonal = if i == j { elastic[i] / flow.a } else { 0.0 };
            diagonal + s_gamma[i] * gamma_e[j]
        };
        let s_e = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        (s, s_e, s_gamma, gamma_e)
    }

    /// Equivalent plastic strain of a return, `sqrt(2/3 e : e)` of the plastic deviator `3 d_gamma s / M^2`.
    fn plastic_strain(&self, flow: &Flow) -> f64 {
        2.0 * flow.gamma * flow.q / self.m_squared
    }
}

fn q_of(s: &Sym) -> f64 {
    1.5_f64.sqrt() * norm(s)
}

impl Elastic for CamClay {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }
}

impl Law for CamClay {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn pressure_dependent(&self) -> bool {
        true
    }

    fn history(&self) -> &'static [&'static str] {
        &["preconsolidation", "plastic_strain"]
    }

    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli) {
        let (elastic, moduli) = self.elastic.respond(increment, old, &[], &mut []);
        let (bulk, p_c) = (self.bulk_modulus(), self.old(history));
        new.copy_from_slice(&[p_c, history[1]]);
        let trial = Trial { q: q_of(&elastic.deviator), p: -elastic.mean, p_c, bulk };
        let Some(flow) = self.return_of(&trial) else {
            return (elastic, moduli);
        };
        new[0] = flow.p_c;
        new[1] += self.plastic_strain(&flow);
        let (deviator, dev_dev, s_gamma, gamma_e) = self.shear(&elastic.deviator, &flow);
        let gamma_v = -bulk * flow.along_p / flow.slope;
        let moduli = Moduli {
            dev_dev,
            dev_vol: s_gamma.map(|s| s * gamma_v),
            mean_dev: gamma_e.map(|l| bulk * flow.compression(l, 0.0)),
            mean_vol: bulk * (1.0 + flow.compression(gamma_v, -bulk)),
        };
        (Stress { deviator, mean: -flow.p }, moduli)
    }

    /// Beyond half the tensile strength the deviator is the one there, and the clay opens by [`SOFT`] and by
    /// the slope theta / (p + p_t) of an open clay: with a smaller one Newton's method would go in cycles.
    fn respond_at_mean(
        &self,
        increment: &Sym,
        old: &Sym,
        mean: f64,
        history: &[f64],
        new: &mut [f64],
    ) -> AtMean {
        let mu = self.shear_modulus();
        let elastic = deviatoric_stiffness(mu);
        let s: Sym = std::array::from_fn(|i| old[i] + elastic[i] * increment[i]);
        let p_c = self.old(history);
        new.copy_from_slice(&[p_c, history[1]]);
        let limit = 0.5 * self.tension;
        let trial = Trial { q: q_of(&s), p: -mean.min(limit), p_c, bulk: 0.0 };
        let mut answer = AtMean { deviator: s, ..AtMean::default() };
        if let Some(flow) = self.return_of(&trial) {
            new[0] = flow.p_c;
            new[1] += self.plastic_strain(&flow);
            let (deviator, dev_dev, s_gamma, gamma_e) = self.shear(&s, &flow);
            let gamma_m = -flow.along_p / flow.slope;
            answer = AtMean {
                deviator,
                plastic_volume: -flow.v,
                dev_dev,
                dev_mean: s_gamma.map(|s| s * gamma_m),
                volume_dev: gamma_e.map(|l| -flow.compression(l, 0.0)),
                volume_mean: -flow.compression(gamma_m, -1.0),
            };
        } else {
            (0..COMPONENTS).for_each(|i| answer.dev_dev[i][i] = elastic[i]);
        }
        if mean > limit {
            let x = mean - limit;
            let soft = 1.0 / (SOFT * mu) + self.theta / (self.tension - limit);
            new[0] = (new[0] * (-soft * x / self.theta).exp()).max(self.tension);
            answer.plastic_volume += soft * x;
            answer.dev_mean = [0.0; COMPONENTS];
            answer.volume_mean = soft;
        }
        answer
    }
}
