//! Material laws.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::{require, InputError};
use crate::law::{External, Law, LinearElastic, Parameter, LAWS, MAX_HISTORY};

#[pyclass(name = "Material", frozen, module = "tawami._rust")]
pub(super) struct PyMaterial {
    law: Arc<dyn Law>,
    made: Made,
}

/// Arguments with which a law was made, to copy and to pickle it.
enum Made {
    /// A linear elastic law: the function, and its two arguments.
    Elastic(&'static str, f64, f64),
    /// Name, K and mu of the elastic part [Pa], and the values of the parameters.
    Law(&'static str, (f64, f64), Vec<f64>),
    /// Name, K and mu [Pa], and the history variables of a law whose responses are given.
    External(String, (f64, f64), Vec<String>),
}

impl PyMaterial {
    fn elastic(law: LinearElastic, function: &'static str, first: f64, second: f64) -> Self {
        Self { law: Arc::new(law), made: Made::Elastic(function, first, second) }
    }
}

#[pymethods]
impl PyMaterial {
    #[staticmethod]
    fn linear_elastic_e_nu(e: f64, nu: f64) -> PyResult<Self> {
        Ok(Self::elastic(LinearElastic::from_e_nu(e, nu)?, "linear_elastic_e_nu", e, nu))
    }

    #[staticmethod]
    fn linear_elastic_e_one_minus_2nu(e: f64, one_minus_2nu: f64) -> PyResult<Self> {
        let law = LinearElastic::from_e_one_minus_2nu(e, one_minus_2nu)?;
        Ok(Self::elastic(law, "linear_elastic_e_one_minus_2nu", e, one_minus_2nu))
    }

    /// The law of a name, with K and mu of its elastic part and all its parameters in their order.
    #[staticmethod]
    fn of(name: &str, elastic: (f64, f64), parameters: Vec<f64>) -> PyResult<Self> {
        let maker = LAWS.iter().find(|maker| maker.name == name);
        let maker = maker.ok_or_else(|| InputError::new_err(format!("there is no law {name}")))?;
        require(
            parameters.len() == maker.parameters.len(),
            "a law got too few or many parameters",
        )?;
        let law = (maker.make)(LinearElastic::from_k_mu(elastic.0, elastic.1)?, &parameters)?;
        Ok(Self { law, made: Made::Law(maker.name, elastic, parameters) })
    }

    /// A law whose responses are given, with K and mu of its elastic part and the names of its history
    /// variables.
    #[staticmethod]
    fn external(name: String, elastic: (f64, f64), history: Vec<String>) -> PyResult<Self> {
        require(history.len() <= MAX_HISTORY, "a law with too many history variables")?;
        let law = External::new(&name, LinearElastic::from_k_mu(elastic.0, elastic.1)?, &history);
        Ok(Self { law: Arc::new(law), made: Made::External(name, elastic, history) })
    }

    /// Arguments for a copy, here or in another process.
    fn __reduce__<'py>(
        &self,
        py: Python<'py>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let (function, given) = match &self.made {
            Made::Elastic(function, first, second) => {
                (*function, (*first, *second).into_pyobject(py)?)
            }
            Made::Law(name, elastic, parameters) => {
                ("of", (*name, *elastic, parameters.clone()).into_pyobject(py)?)
            }
            Made::External(name, elastic, history) => {
                ("external", (name.clone(), *elastic, history.clone()).into_pyobject(py)?)
            }
        };
        Ok((py.get_type::<Self>().getattr(function)?, given))
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

/// Names of all laws, each with name and default of its parameters: None where one must be given, False for
/// a switch.
#[pyfunction]
pub(super) fn parameters(py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
    let all = PyDict::new(py);
    for maker in LAWS {
        let own = PyDict::new(py);
        for parameter in maker.parameters {
            match *parameter {
                Parameter::Required(name) => own.set_item(name, py.None())?,
                Parameter::Optional(name, value) => own.set_item(name, value)?,
                Parameter::Switch(name) => own.set_item(name, false)?,
            }
        }
        all.set_item(maker.name, own)?;
    }
    Ok(all)
}
