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
//! Dilatancy ends at a plastic volumetric strain of `eps_v_max`; A and B stay those of psi.

use super::{Elastic, Friction, Law, LinearElastic, ROUND_OFF};
use crate::error::Result;
use crate::space::COMPONENTS;
use crate::tensor::{deviatoric_stiffness, norm, Moduli, Strain, Stress};

/// Drucker-Prager plasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DruckerPrager {
    elastic: LinearElastic,
    a: f64,
    strength: f64,
    flow: f64,
    eps_v_max: f64,
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
}

impl Elastic for DruckerPrager {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }
}

impl Law for DruckerPrager {
    fn name(&self) -> &'static str {
        "drucker_prager"
    }

    fn pressure_dependent(&self) -> bool {
        true
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
        let (trial, mut moduli) = self.elastic.respond(increment, old, &[], &mut []);
        new.copy_from_slice(history);
        let (mu, bulk) = (self.shear_modulus(), self.bulk_modulus());
        let root = norm(&trial.deviator) / 2.0_f64.sqrt();
        let excess = root + self.a * trial.mean - self.strength;
        if excess <= ROUND_OFF * (root + trial.mean.abs()) {
            return (trial, moduli);
        }
        let (mut flow, mut stiffness) = (self.flow, mu + bulk * self.a * self.flow);
        let (mut gamma, mut dilation) = (excess / stiffness, flow * excess / stiffness);
        let left = (self.eps_v_max - history[1]).max(0.0);
        if dilation > left {
            // the rest of the dilatancy, then flow at constant volume
            (flow, stiffness, dilation) = (0.0, mu, left);
            gamma = (excess - self.a * bulk * left) / mu;
        }
        if mu * gamma >= root {
            // the apex; here a > 0, since phi = 0 gives gamma = (root - c) / mu
            let mean = self.strength / self.a;
            new[0] += root / mu;
            return (Stress { mean, ..Stress::default() }, Moduli::default());
        }
        new[0] += gamma;
        new[1] += dilation;
        let n = trial.deviator.map(|s| s / root);
        let keep = 1.0 - mu * gamma / root;
        let stress = Stress {
            deviator: trial.deviator.map(|s| keep * s),
            mean: trial.mean - bulk * dilation,
        };
        let elastic = deviatoric_stiffness(mu);
        let along = mu * mu * (gamma / root - 1.0 / stiffness);
        let cross = mu * bulk / stiffness;
        for i in 0..COMPONENTS {
            for j in 0..COMPONENTS {
                let diagonal = if i == j { keep * elastic[i] } else { 0.0 };
                moduli.dev_dev[i][j] = diagonal + along * n[i] * n[j];
            }
            moduli.dev_vol[i] = -cross * self.a * n[i];
            moduli.mean_dev[i] = -cross * flow * n[i];
        }
        moduli.mean_vol = bulk * (1.0 - bulk * flow * self.a / stiffness);
        (stress, moduli)
    }
}
