//! Material laws.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::law::{DruckerPrager, Friction, Law, LinearElastic, MohrCoulomb, NeoHookean, VonMises};

#[pyclass(name = "Material", frozen, module = "tawami._rust")]
pub(super) struct PyMaterial {
    law: Arc<dyn Law>,
    /// The function that made it and its arguments, to copy and to pickle it.
    made: (&'static str, Vec<f64>),
}

impl PyMaterial {
    fn new(law: impl Law + 'static, made: &'static str, given: &[f64]) -> Self {
        Self { law: Arc::new(law), made: (made, given.to_vec()) }
    }
}

#[pymethods]
impl PyMaterial {
    #[staticmethod]
    fn linear_elastic_e_nu(e: f64, nu: f64) -> PyResult<Self> {
        Ok(Self::new(LinearElastic::from_e_nu(e, nu)?, "linear_elastic_e_nu", &[e, nu]))
    }

    #[staticmethod]
    fn linear_elastic_e_one_minus_2nu(e: f64, one_minus_2nu: f64) -> PyResult<Self> {
        let law = LinearElastic::from_e_one_minus_2nu(e, one_minus_2nu)?;
        Ok(Self::new(law, "linear_elastic_e_one_minus_2nu", &[e, one_minus_2nu]))
    }

    #[staticmethod]
    fn linear_elastic_k_mu(k: f64, mu: f64) -> PyResult<Self> {
        Ok(Self::new(LinearElastic::from_k_mu(k, mu)?, "linear_elastic_k_mu", &[k, mu]))
    }

    #[staticmethod]
    fn von_mises(k: f64, mu: f64, yield_stress: f64, hardening: f64) -> PyResult<Self> {
        let elastic = LinearElastic::from_k_mu(k, mu)?;
        let law = VonMises::new(elastic, yield_stress, hardening)?;
        Ok(Self::new(law, "von_mises", &[k, mu, yield_stress, hardening]))
    }

    #[staticmethod]
    fn drucker_prager(
        elastic: (f64, f64),
        phi: f64,
        c: f64,
        psi: f64,
        eps_v_max: f64,
        tiny: bool,
    ) -> PyResult<Self> {
        let given = [elastic.0, elastic.1, phi, c, psi, eps_v_max, f64::from(u8::from(tiny))];
        let elastic = LinearElastic::from_k_mu(elastic.0, elastic.1)?;
        let friction = Friction { phi, c, psi, eps_v_max, tiny };
        Ok(Self::new(DruckerPrager::new(elastic, friction)?, "drucker_prager", &given))
    }

    #[staticmethod]
    fn mohr_coulomb(
        elastic: (f64, f64),
        phi: f64,
        c: f64,
        psi: f64,
        eps_v_max: f64,
        tiny: bool,
    ) -> PyResult<Self> {
        let given = [elastic.0, elastic.1, phi, c, psi, eps_v_max, f64::from(u8::from(tiny))];
        let elastic = LinearElastic::from_k_mu(elastic.0, elastic.1)?;
        let friction = Friction { phi, c, psi, eps_v_max, tiny };
        Ok(Self::new(MohrCoulomb::new(elastic, friction)?, "mohr_coulomb", &given))
    }

    #[staticmethod]
    fn neo_hookean(k: f64, mu: f64) -> PyResult<Self> {
        let law = NeoHookean::new(LinearElastic::from_k_mu(k, mu)?);
        Ok(Self::new(law, "neo_hookean", &[k, mu]))
    }

    /// How to make a copy, here or in another process.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (name, given) = &self.made;
        let arguments = match given[..] {
            [k, mu, phi, c, psi, eps_v_max, tiny] => {
                ((k, mu), phi, c, psi, eps_v_max, tiny > 0.0).into_pyobject(py)?
            }
            _ => PyTuple::new(py, given)?,
        };
        Ok((py.get_type::<Self>().getattr(*name)?, arguments))
    }

    /// The law with its parameters.
    fn __repr__(&self) -> String {
        format!("{:?}", self.law)
    }

    /// Name of the law.
    #[getter]
    fn name(&self) -> &'static str {
        self.law.name()
    }

    /// Names of its history variables.
    #[getter]
    fn history_names(&self) -> Vec<&'static str> {
        self.law.history().to_vec()
    }

    /// Whether the law exists at finite strain only.
    #[getter]
    fn finite_only(&self) -> bool {
        self.law.finite_only()
    }

    /// Whether its strength depends on the mean stress: its flow may change the volume.
    #[getter]
    fn pressure_dependent(&self) -> bool {
        self.law.pressure_dependent()
    }

    #[getter]
    fn bulk_modulus(&self) -> f64 {
        self.law.bulk_modulus()
    }

    #[getter]
    fn shear_modulus(&self) -> f64 {
        self.law.shear_modulus()
    }
}

pub(super) fn laws(materials: &[PyRef<PyMaterial>]) -> Vec<Arc<dyn Law>> {
    materials.iter().map(|m| Arc::clone(&m.law)).collect()
}
