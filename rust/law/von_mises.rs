//! Von Mises plasticity with linear isotropic hardening: `q = sqrt(3 J2) <= sigma_y + H kappa`.
//!
//! Radial return (Simo and Hughes 1998, box 3.2): `d_kappa = (q_trial - sigma_y - H kappa) / (3 mu + H)`,
//! `s = s_trial (1 - 3 mu d_kappa / q_trial)`; the volume stays elastic.

use std::sync::Arc;

use super::{Elastic, Law, LinearElastic, Maker, Parameter, ROUND_OFF};
use crate::error::{Error, Result};
use crate::space::COMPONENTS;
use crate::tensor::{deviatoric_stiffness, norm, Moduli, Strain, Stress};

pub(super) const MAKER: Maker = Maker {
    name: "von_mises",
    parameters: &[Parameter::Required("yield_stress"), Parameter::Optional("hardening", 0.0)],
    make: |elastic, given| Ok(Arc::new(VonMises::new(elastic, given[0], given[1])?)),
};

/// Von Mises plasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VonMises {
    elastic: LinearElastic,
    yield_stress: f64,
    hardening: f64,
}

impl VonMises {
    /// From the elastic law, the initial yield stress sigma_y and the hardening modulus H [Pa].
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn new(elastic: LinearElastic, yield_stress: f64, hardening: f64) -> Result<Self> {
        if !(yield_stress > 0.0 && yield_stress.is_finite()) {
            let expected = "a positive, finite yield stress in Pa";
            return Err(Error::Parameter { name: "yield_stress", value: yield_stress, expected });
        }
        if !(hardening >= 0.0 && hardening.is_finite()) {
            let expected = "a hardening modulus of at least 0 Pa (softening needs a length scale)";
            return Err(Error::Parameter { name: "hardening", value: hardening, expected });
        }
        Ok(Self { elastic, yield_stress, hardening })
    }
}

impl Elastic for VonMises {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }
}

impl Law for VonMises {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn history(&self) -> &'static [&'static str] {
        &["plastic_strain"]
    }

    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli) {
        let (mut stress, mut moduli) = self.elastic.respond(increment, old, &[], &mut []);
        new[0] = history[0];
        let mu = self.shear_modulus();
        let size = norm(&stress.deviator);
        let q = 1.5_f64.sqrt() * size;
        let excess = q - self.yield_stress - self.hardening * history[0];
        if excess <= ROUND_OFF * (q + stress.mean.abs()) {
            return (stress, moduli);
        }
        let kappa = excess / (3.0 * mu + self.hardening);
        new[0] += kappa;
        let n = stress.deviator.map(|s| s / size);
        let keep = 1.0 - 3.0 * mu * kappa / q;
        stress.deviator = stress.deviator.map(|s| keep * s);
        let stiffness = deviatoric_stiffness(mu);
        let along = 6.0 * mu * mu * (kappa / q - 1.0 / (3.0 * mu + self.hardening));
        for i in 0..COMPONENTS {
            for j in 0..COMPONENTS {
                let diagonal = if i == j { keep * stiffness[i] } else { 0.0 };
                moduli.dev_dev[i][j] = diagonal + along * n[i] * n[j];
            }
        }
        (stress, moduli)
    }
}
