//! Drucker-Prager plasticity: `sqrt(J2) + A p <= c B`, p the mean stress, tension positive.
//!
//! In plane strain this cone has the limit states of Mohr-Coulomb, for a dilatancy angle psi of its own:
//!
//! ```text
//! Ab = 3 tan psi / sqrt(9 + 12 tan^2 psi)     d = sqrt(1 - Ab^2/3) + Ab sin phi / 3
//! A = sin phi / d        B = cos phi / d
//! ```
//!
//! (The often quoted 3 tan phi / sqrt(9 + 12 tan^2 phi) is A in the associated case psi = phi only.)
//! Return to the cone: `d_gamma = F / (mu + K A Ab)`, `sqrt(J2) -= mu d_gamma`, `p -= K Ab d_gamma`.
//! Where that passes the apex, s = 0 and p = c B / A, which also limits tension at psi = 0.
//! At a given mean stress the return has K = 0 here, and the plastic volumetric strain is `Ab d_gamma`.
//! Dilatancy ends at a plastic volumetric strain of `eps_v_max`; A and B stay those of psi.

use std::sync::Arc;

use super::{Elastic, Friction, Law, LinearElastic, Maker, ROUND_OFF, SOFT};
use crate::error::Result;
use crate::space::COMPONENTS;
use crate::tensor::{deviatoric_stiffness, norm, AtMean, Moduli, Strain, Stress, Sym, Tangent};

pub(super) const MAKER: Maker = Maker {
    name: "drucker_prager",
    parameters: Friction::PARAMETERS,
    make: |elastic, given| Ok(Arc::new(DruckerPrager::new(elastic, Friction::of(given))?)),
};

/// Drucker-Prager plasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DruckerPrager {
    elastic: LinearElastic,
    a: f64,
    strength: f64,
    flow: f64,
    eps_v_max: f64,
}

/// Return of a trial stress to the cone.
struct Return {
    /// sqrt(J2) of the trial stress.
    root: f64,
    /// Ab, or 0 once dilatancy has ended.
    flow: f64,
    /// - dF / d d_gamma.
    stiffness: f64,
    /// d_gamma.
    gamma: f64,
    /// Plastic volumetric strain.
    dilation: f64,
}

impl DruckerPrager {
    /// From the elastic law and the angles.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn new(elastic: LinearElastic, friction: Friction) -> Result<Self> {
        friction.check()?;
        let Friction { phi, c, psi, eps_v_max, .. } = friction;
        let (phi, tan_psi) = (phi.to_radians(), psi.to_radians().tan());
        let flow = 3.0 * tan_psi / (9.0 + 12.0 * tan_psi * tan_psi).sqrt();
        let d = (1.0 - flow * flow / 3.0).sqrt() + flow * phi.sin() / 3.0;
        Ok(Self { elastic, a: phi.sin() / d, strength: c * phi.cos() / d, flow, eps_v_max })
    }

    /// Return of a trial stress beyond the cone, with at most `left` of dilatancy. `bulk` is K where the
    /// strain is given, and 0 where the mean stress is.
    fn return_of(&self, trial: &Stress, bulk: f64, left: f64) -> Option<Return> {
        let mu = self.shear_modulus();
        let root = norm(&trial.deviator) / 2.0_f64.sqrt();
        let excess = root + self.a * trial.mean - self.strength;
        if excess <= ROUND_OFF * (root + trial.mean.abs()) {
            return None;
        }
        let (flow, stiffness) = (self.flow, mu + bulk * self.a * self.flow);
        let (gamma, dilation) = (excess / stiffness, flow * excess / stiffness);
        if dilation <= left {
            return Some(Return { root, flow, stiffness, gamma, dilation });
        }
        // the rest of the dilatancy, then flow at constant volume
        let gamma = (excess - self.a * bulk * left) / mu;
        Some(Return { root, flow: 0.0, stiffness: mu, gamma, dilation: left })
    }

    /// d s_i / d e_j at the end of a return, and the direction `s / sqrt(J2)`.
    fn dev_dev(&self, trial: &Sym, path: &Return) -> (Tangent, Sym) {
        let mu = self.shear_modulus();
        let n = trial.map(|s| s / path.root);
        let elastic = deviatoric_stiffness(mu);
        let keep = 1.0 - mu * path.gamma / path.root;
        let along = mu * mu * (path.gamma / path.root - 1.0 / path.stiffness);
        let entry = |i: usize, j: usize| {
            let diagonal = if i == j { keep * elastic[i] } else { 0.0 };
            diagonal + along * n[i] * n[j]
        };
        (std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))), n)
    }
}

impl Elastic for DruckerPrager {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }
}

impl Law for DruckerPrager {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn pressure_dependent(&self) -> bool {
        self.a > 0.0
    }

    fn history(&self) -> &'static [&'static str] {
        &["plastic_strain", "dilatancy"]
    }

    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli) {
        let (trial, moduli) = self.elastic.respond(increment, old, &[], &mut []);
        new.copy_from_slice(history);
        let (mu, bulk) = (self.shear_modulus(), self.bulk_modulus());
        let left = (self.eps_v_max - history[1]).max(0.0);
        let Some(path) = self.return_of(&trial, bulk, left) else {
            return (trial, moduli);
        };
        if mu * path.gamma >= path.root {
            // the apex; here a > 0, since phi = 0 gives gamma = (root - c) / mu
            let mean = self.strength / self.a;
            new[0] += path.root / mu;
            return (Stress { mean, ..Stress::default() }, Moduli::default());
        }
        new[0] += path.gamma;
        new[1] += path.dilation;
        let keep = 1.0 - mu * path.gamma / path.root;
        let stress = Stress {
            deviator: trial.deviator.map(|s| keep * s),
            mean: trial.mean - bulk * path.dilation,
        };
        let (dev_dev, n) = self.dev_dev(&trial.deviator, &path);
        let cross = mu * bulk / path.stiffness;
        let moduli = Moduli {
            dev_dev,
            dev_vol: n.map(|n| -cross * self.a * n),
            mean_dev: n.map(|n| -cross * path.flow * n),
            mean_vol: bulk * (1.0 - bulk * path.flow * self.a / path.stiffness),
        };
        (stress, moduli)
    }

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
        let trial: Sym = std::array::from_fn(|i| old[i] + elastic[i] * increment[i]);
        new.copy_from_slice(history);
        // infinite where phi = 0
        let apex = self.strength / self.a;
        let on_cone = Stress { deviator: trial, mean: mean.min(apex) };
        let left = (self.eps_v_max - history[1]).max(0.0);
        let path = self.return_of(&on_cone, 0.0, left);
        let mut answer = AtMean::default();
        if let Some(path) = &path {
            new[0] += path.gamma;
            new[1] += path.dilation;
            answer.plastic_volume = path.dilation;
            answer.volume_dev = trial.map(|s| path.flow * s / path.root);
        }
        if mean >= apex {
            answer.plastic_volume += (mean - apex) / (SOFT * mu);
            answer.volume_mean = 1.0 / (SOFT * mu);
            return answer;
        }
        let Some(path) = path else {
            answer.deviator = trial;
            (0..COMPONENTS).for_each(|i| answer.dev_dev[i][i] = elastic[i]);
            return answer;
        };
        let (dev_dev, n) = self.dev_dev(&trial, &path);
        let keep = 1.0 - mu * path.gamma / path.root;
        AtMean {
            deviator: trial.map(|s| keep * s),
            dev_dev,
            dev_mean: n.map(|n| -self.a * n),
            volume_mean: self.a * path.flow / mu,
            ..answer
        }
    }
}
