//! Python bindings: they convert, check shapes at the border, and release the interpreter lock during the
//! computation.

mod array;
mod assembly;
mod grid;
mod law;
mod particles;
mod stage;
mod threads;
mod transfer;

use ndarray::Dimension;
use numpy::{Element, PyArray};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::PyClass;

use crate::error::Error;

create_exception!(tawami, TawamiError, PyException, "Base of every error that tawami raises.");
create_exception!(tawami, InputError, TawamiError, "A wrong input; the message names it.");
create_exception!(
    tawami._rust,
    InvertedError,
    TawamiError,
    "An iterate that turns a particle inside out."
);

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        match error {
            Error::Inverted { .. } => InvertedError::new_err(error.to_string()),
            _ => InputError::new_err(error.to_string()),
        }
    }
}

/// Check for a mistake of the Python package, not of the user: its arrays do not belong together.
fn require(condition: bool, what: &str) -> PyResult<()> {
    if condition {
        return Ok(());
    }
    Err(PyRuntimeError::new_err(format!("internal: {what} (please report this)")))
}

/// NumPy view of an array inside a Python object, without a copy. The view keeps the object alive, and the
/// array is never reallocated.
fn view<'py, T: Element, D: Dimension, O: PyClass>(
    array: impl Fn(&O) -> &ndarray::Array<T, D>,
    owner: &Bound<'py, O>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let object = owner.try_borrow()?;
    // SAFETY: never reallocated, and the view keeps the object.
    Ok(unsafe { PyArray::borrow_from_array(array(&object), owner.clone().into_any()) })
}

#[pymodule]
fn _rust(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("__version__", env!("CARGO_PKG_VERSION"))?;
    m.add("MAX_COEFFICIENTS", crate::assembly::MAX_COEFFICIENTS)?;
    m.add("TawamiError", m.py().get_type::<TawamiError>())?;
    m.add("InputError", m.py().get_type::<InputError>())?;
    m.add("InvertedError", m.py().get_type::<InvertedError>())?;
    m.add_class::<grid::PyGrid>()?;
    m.add_class::<grid::PyLocation>()?;
    m.add_class::<grid::PyActive>()?;
    m.add_class::<particles::PyParticles>()?;
    m.add_class::<law::PyMaterial>()?;
    m.add_class::<assembly::PyAssembler>()?;
    m.add_class::<assembly::PyPattern>()?;
    m.add_class::<assembly::PyKernels>()?;
    m.add_class::<stage::PyStage>()?;
    m.add_class::<stage::PyRequests>()?;
    m.add_function(wrap_pyfunction!(law::parameters, m)?)?;
    m.add_function(wrap_pyfunction!(particles::logarithmic_strain, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::interpolate, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::gradients, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::carried, m)?)?;
    m.add_function(wrap_pyfunction!(grid::basis_1d, m)?)?;
    m.add_function(wrap_pyfunction!(grid::basis_len, m)?)?;
    m.add_function(wrap_pyfunction!(grid::gauss, m)?)?;
    m.add_function(wrap_pyfunction!(grid::functions_at, m)?)?;
    m.add_function(wrap_pyfunction!(grid::extraction, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::densities, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::nodal_sums, m)?)?;
    m.add_function(wrap_pyfunction!(transfer::cell_sums, m)?)?;
    Ok(())
}
