//! Isotropic linear elasticity: `s += 2 mu dev(d_eps)`, `sigma_m += K d_eps_v`.

use std::sync::Arc;

use super::{Elastic, Law, Maker};
use crate::error::{Error, Result};
use crate::space::COMPONENTS;
use crate::tensor::{deviatoric_stiffness, Moduli, Strain, Stress};

pub(super) const MAKER: Maker = Maker {
    name: "linear_elastic",
    parameters: &[],
    make: |elastic, _| Ok(Arc::new(elastic)),
};

/// Isotropic linear elasticity with shear modulus mu and bulk modulus K.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LinearElastic {
    /// mu [Pa].
    pub(super) mu: f64,
    /// K [Pa].
    pub(super) bulk: f64,
}

fn positive(name: &'static str, value: f64) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::Parameter { name, value, expected: "a positive, finite modulus in Pa" })
}

impl LinearElastic {
    /// From Young's modulus [Pa] and Poisson's ratio, -1 < nu <= 0.5.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn from_e_nu(e: f64, nu: f64) -> Result<Self> {
        if !(nu > -1.0 && nu <= 0.5) {
            return Err(Error::Parameter {
                name: "nu",
                value: nu,
                expected: "-1 < nu <= 0.5 (an isotropic material has no other Poisson's ratios)",
            });
        }
        Self::from_e_one_minus_2nu(e, 1.0 - 2.0 * nu)
    }

    /// From Young's modulus [Pa] and 1 - 2 nu, 0 <= 1 - 2 nu < 3. Near nu = 0.5 a floating-point nu has
    /// too few digits for 1 - 2 nu.
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the parameter that is out of range.
    pub fn from_e_one_minus_2nu(e: f64, one_minus_2nu: f64) -> Result<Self> {
        positive("E", e)?;
        if !(0.0..3.0).contains(&one_minus_2nu) {
            return Err(Error::Parameter {
                name: "one_minus_2nu",
                value: one_minus_2nu,
                expected: "0 <= 1 - 2 nu < 3 (that is -1 < nu <= 0.5)",
            });
        }
        // a negative zero would make K negative
        let one_minus_2nu = one_minus_2nu.abs();
        // mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)); K is infinite at nu = 0.5
        let (mu, bulk) = (e / (3.0 - one_minus_2nu), e / (3.0 * one_minus_2nu));
        if !mu.is_normal() || (one_minus_2nu > 0.0 && !bulk.is_normal()) {
            return Err(Error::Parameter {
                name: "E",
                value: e,
                expected: "a modulus whose mu and K are neither 0 nor infinite in floating point",
            });
        }
        Ok(Self { mu, bulk })
    }

    /// From bulk and shear modulus [Pa].
    ///
    /// # Errors
    /// [`Error::Parameter`] naming the modulus that is not positive and finite.
    pub fn from_k_mu(k: f64, mu: f64) -> Result<Self> {
        positive("K", k)?;
        positive("mu", mu)?;
        Ok(Self { mu, bulk: k })
    }
}

impl Elastic for LinearElastic {
    fn linear(&self) -> &LinearElastic {
        self
    }
}

impl Law for LinearElastic {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        _history: &[f64],
        _new: &mut [f64],
    ) -> (Stress, Moduli) {
        let stiffness = deviatoric_stiffness(self.mu);
        let deviator =
            std::array::from_fn(|i| old.deviator[i] + stiffness[i] * increment.deviator[i]);
        // an incompressible material has no change of volume: 0 times infinity must stay 0
        let d_mean = if increment.volume == 0.0 { 0.0 } else { self.bulk * increment.volume };
        let mut dev_dev = [[0.0; COMPONENTS]; COMPONENTS];
        for i in 0..COMPONENTS {
            dev_dev[i][i] = stiffness[i];
        }
        let moduli = Moduli { dev_dev, mean_vol: self.bulk, ..Moduli::default() };
        (Stress { deviator, mean: old.mean + d_mean }, moduli)
    }
}
