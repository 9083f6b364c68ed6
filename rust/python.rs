//! Python bindings: they convert and check shapes at the border, and nothing else.

use std::sync::Arc;

use ndarray::Dimension;
use numpy::{
    Element, PyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyReadwriteArray2, ToPyArray,
};
use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::PyClass;

use crate::adjoint::{self, Packing};
use crate::basis::Basis;
use crate::constitutive::{self, Operator, Part, Request, Stage};
use crate::error::Error;
use crate::grid::{Grid, Location};
use crate::interpolation::Field;
use crate::kinematics::{Increments, Kinematics};
use crate::material::{LinearElastic, Material};
use crate::particles::Particles;
use crate::quadrature::Rule;

create_exception!(tawami, TawamiError, PyException, "Base of every error that tawami raises.");
create_exception!(tawami, InputError, TawamiError, "An input is wrong; the message says which.");

impl From<Error> for PyErr {
    fn from(error: Error) -> Self {
        InputError::new_err(error.to_string())
    }
}

/// A mistake of the Python package, not of the user: the arrays it passes do not fit together.
fn require(condition: bool, what: &str) -> PyResult<()> {
    if condition {
        return Ok(());
    }
    Err(PyRuntimeError::new_err(format!("internal: {what} (please report this)")))
}

/// NumPy view of an array inside a Python object: no copy; the object stays alive with the view.
fn view<'py, T: Element, D: Dimension, O: PyClass>(
    array: impl Fn(&O) -> &ndarray::Array<T, D>,
    owner: &Bound<'py, O>,
) -> Bound<'py, PyArray<T, D>> {
    let object = owner.borrow();
    // SAFETY: the arrays of a `PyParticles` are never reallocated, and the view keeps the object.
    unsafe { PyArray::borrow_from_array(array(&object), owner.clone().into_any()) }
}

/// The same array, not writeable from Python: the cells of the particles and their laws' constants
/// are known from these values.
fn read_only<T, D>(array: Bound<'_, PyArray<T, D>>) -> PyResult<Bound<'_, PyArray<T, D>>> {
    array.call_method("setflags", (false,), None)?;
    Ok(array)
}

#[pyclass(name = "Grid", frozen)]
struct PyGrid(Grid);

#[pymethods]
impl PyGrid {
    #[new]
    fn new(origin: [f64; 2], h: f64, cells: [usize; 2]) -> PyResult<Self> {
        Ok(Self(Grid::new(origin, h, cells)?))
    }

    fn locate(&self, x: PyReadonlyArray2<f64>) -> PyResult<PyLocation> {
        let x = x.as_array().as_standard_layout().into_owned();
        if x.ncols() != 2 {
            let expected = "(points, 2)".to_owned();
            return Err(Error::Shape { name: "x", got: x.shape().to_vec(), expected }.into());
        }
        let flat = x.as_slice().unwrap_or_default();
        Ok(PyLocation(Arc::new(self.0.locate(flat)?)))
    }
}

#[pyclass(name = "Location", frozen)]
struct PyLocation(Arc<Location>);

#[pymethods]
impl PyLocation {
    #[getter]
    fn active<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.active.to_pyarray(py)
    }

    #[getter]
    fn cell<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.0.cell.to_pyarray(py)
    }

    #[getter]
    fn xi<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.0.xi.as_flattened().to_pyarray(py).reshape([self.0.len(), 2])
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }
}

#[pyclass(name = "Particles")]
struct PyParticles(Particles);

#[pymethods]
impl PyParticles {
    #[new]
    fn new(
        x: PyReadonlyArray2<f64>,
        volume: PyReadonlyArray1<f64>,
        material: PyReadonlyArray1<u32>,
    ) -> PyResult<Self> {
        let x = x.as_array().as_standard_layout().into_owned();
        let (volume, material) = (volume.as_array().to_owned(), material.as_array().to_owned());
        Ok(Self(Particles::new(x, volume, material)?))
    }

    fn check(&self) -> PyResult<()> {
        Ok(self.0.check()?)
    }

    fn check_materials(&self, materials: Vec<PyRef<PyMaterial>>, kinematics: &str) -> PyResult<()> {
        let laws = laws(&materials);
        Ok(constitutive::check_materials(&self.0, &laws, kinematics.parse()?)?)
    }

    fn add_eps_v(&mut self) {
        self.0.add_eps_v();
    }

    #[getter]
    fn bytes_per_particle(&self) -> usize {
        self.0.bytes_per_particle()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    #[getter]
    fn x<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        read_only(view(|p: &Self| &p.0.x, slf))
    }

    #[getter]
    fn volume<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray1<f64>> {
        view(|p: &Self| &p.0.volume, slf)
    }

    #[getter]
    fn material<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        read_only(view(|p: &Self| &p.0.material, slf))
    }

    #[getter]
    fn stress<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f64>> {
        view(|p: &Self| &p.0.stress, slf)
    }

    #[getter]
    fn displacement<'py>(slf: &Bound<'py, Self>) -> Bound<'py, PyArray2<f64>> {
        view(|p: &Self| &p.0.displacement, slf)
    }

    #[getter]
    fn eps_v<'py>(slf: &Bound<'py, Self>) -> Option<Bound<'py, PyArray1<f64>>> {
        let object = slf.borrow();
        let array = object.0.eps_v.as_ref()?;
        // SAFETY: as in `view`.
        Some(unsafe { PyArray::borrow_from_array(array, slf.clone().into_any()) })
    }
}

#[pyclass(name = "Material", frozen)]
struct PyMaterial(Arc<dyn Material>);

#[pymethods]
impl PyMaterial {
    #[staticmethod]
    fn linear_elastic_e_nu(e: f64, nu: f64) -> PyResult<Self> {
        Ok(Self(Arc::new(LinearElastic::from_e_nu(e, nu)?)))
    }

    #[staticmethod]
    fn linear_elastic_e_one_minus_2nu(e: f64, one_minus_2nu: f64) -> PyResult<Self> {
        Ok(Self(Arc::new(LinearElastic::from_e_one_minus_2nu(e, one_minus_2nu)?)))
    }

    #[staticmethod]
    fn linear_elastic_k_mu(k: f64, mu: f64) -> PyResult<Self> {
        Ok(Self(Arc::new(LinearElastic::from_k_mu(k, mu)?)))
    }

    #[getter]
    fn bulk_modulus(&self) -> f64 {
        self.0.bulk_modulus()
    }

    #[getter]
    fn shear_modulus(&self) -> f64 {
        self.0.shear_modulus()
    }
}

fn laws(materials: &[PyRef<PyMaterial>]) -> Vec<Arc<dyn Material>> {
    materials.iter().map(|m| Arc::clone(&m.0)).collect()
}

fn field<'a, const C: usize>(
    grid: Grid,
    basis: Basis,
    coefficients: &'a PyReadonlyArray1<f64>,
) -> PyResult<Field<'a, C>> {
    let coefficients = coefficients.as_slice()?;
    let expected = C * basis.len(grid.cells[0]) * basis.len(grid.cells[1]);
    require(coefficients.len() == expected, "wrong number of grid coefficients")?;
    Ok(Field { grid, basis, coefficients })
}

/// The particle side of one scene: its particles in their cells, with their laws.
#[pyclass(name = "Stage")]
struct PyStage {
    particles: Py<PyParticles>,
    location: Arc<Location>,
    materials: Vec<Arc<dyn Material>>,
    kinematics: Kinematics,
    basis: Basis,
}

impl PyStage {
    fn with<R>(
        &self,
        u: &PyReadonlyArray1<f64>,
        volumetric: Option<&PyReadonlyArray1<f64>>,
        run: impl FnOnce(&Stage) -> R,
    ) -> PyResult<R> {
        let grid = self.location.grid;
        let increments = Increments {
            u: field(grid, self.basis, u)?,
            volumetric: volumetric.map(|v| field(grid, Basis::Bilinear, v)).transpose()?,
        };
        Ok(run(&Stage {
            location: &self.location,
            materials: &self.materials,
            kinematics: self.kinematics,
            increments,
        }))
    }
}

#[pymethods]
impl PyStage {
    #[new]
    fn new(
        py: Python,
        particles: Py<PyParticles>,
        location: &PyLocation,
        materials: Vec<PyRef<PyMaterial>>,
        kinematics: &str,
        basis: &str,
    ) -> PyResult<Self> {
        require(particles.borrow(py).0.len() == location.0.len(), "location of other particles")?;
        Ok(Self {
            particles,
            location: Arc::clone(&location.0),
            materials: laws(&materials),
            kinematics: kinematics.parse()?,
            basis: basis.parse()?,
        })
    }

    /// Write the requested quantities of the law into `data` (particles x columns).
    #[pyo3(signature = (u, volumetric, requests, data))]
    fn evaluate(
        &self,
        py: Python,
        u: PyReadonlyArray1<f64>,
        volumetric: Option<PyReadonlyArray1<f64>>,
        requests: Vec<(String, String, usize)>,
        mut data: PyReadwriteArray2<f64>,
    ) -> PyResult<()> {
        let particles = self.particles.borrow(py);
        let data = data.as_array_mut();
        require(data.is_standard_layout() && data.nrows() == particles.0.len(), "particle data")?;
        let requests: Vec<Request> = requests.iter().map(request).collect::<PyResult<_>>()?;
        let fits = |r: &Request| {
            let per_component = if r.part == Part::Strain { 3 } else { 1 };
            r.column + r.operator.components() * per_component <= data.ncols()
        };
        require(requests.iter().all(fits), "a request reaches outside the particle data")?;
        Ok(self.with(&u, volumetric.as_ref(), |s| s.evaluate(&particles.0, &requests, data))??)
    }

    /// Accept the increments: stress, displacement and eps_v of the particles.
    #[pyo3(signature = (u, volumetric))]
    fn commit(
        &self,
        py: Python,
        u: PyReadonlyArray1<f64>,
        volumetric: Option<PyReadonlyArray1<f64>>,
    ) -> PyResult<()> {
        let mut particles = self.particles.borrow_mut(py);
        self.with(&u, volumetric.as_ref(), |s| s.commit(&mut particles.0))
    }

    /// div u and the bilinear field (0 if there is none) at the particles: n x 2.
    #[pyo3(signature = (u, volumetric))]
    fn volume_strains<'py>(
        &self,
        py: Python<'py>,
        u: PyReadonlyArray1<f64>,
        volumetric: Option<PyReadonlyArray1<f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let location = &self.location;
        let strains = self.with(&u, volumetric.as_ref(), |s| {
            ndarray::Array2::from_shape_fn((location.len(), 2), |(p, k)| match k {
                0 => s.increments.div_u(location, p),
                _ => s.increments.volumetric_at(location, p),
            })
        })?;
        Ok(strains.to_pyarray(py))
    }
}

fn request((operator, part, column): &(String, String, usize)) -> PyResult<Request> {
    let operator = match operator.as_str() {
        "sigma" => Operator::Sigma,
        "s" => Operator::Deviator,
        "sigma_m" => Operator::Mean,
        other => return Err(PyRuntimeError::new_err(format!("internal: operator '{other}'"))),
    };
    let part = match part.as_str() {
        "value" => Part::Value,
        "strain" => Part::Strain,
        "volume" => Part::Volume,
        other => return Err(PyRuntimeError::new_err(format!("internal: part '{other}'"))),
    };
    Ok(Request { operator, part, column: *column })
}

/// Values of a grid field at points: points x components.
#[pyfunction]
fn interpolate<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
    components: usize,
    coefficients: PyReadonlyArray1<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (basis, grid) = (basis.parse()?, location.0.grid);
    let values = match components {
        1 => field::<1>(grid, basis, &coefficients)?.at_particles(&location.0).into_flattened(),
        2 => field::<2>(grid, basis, &coefficients)?.at_particles(&location.0).into_flattened(),
        _ => return Err(PyRuntimeError::new_err("internal: fields have 1 or 2 components")),
    };
    values.to_pyarray(py).reshape([location.0.len(), components])
}

/// Functions of a basis on a row of `n` cells at positions `t` of `cell`: index of the first one
/// and the values of up to three.
#[pyfunction]
#[allow(clippy::type_complexity)]
fn basis_1d<'py>(
    py: Python<'py>,
    basis: &str,
    n: usize,
    cell: PyReadonlyArray1<i64>,
    t: PyReadonlyArray1<f64>,
) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>)> {
    let basis: Basis = basis.parse()?;
    let (cell, t) = (cell.as_array(), t.as_array());
    require(cell.len() == t.len(), "cells and positions differ in number")?;
    require(cell.iter().all(|&c| c >= 0 && (c as usize) < n), "cell outside the row")?;
    let mut first = Vec::with_capacity(t.len());
    let mut values = Vec::with_capacity(3 * t.len());
    for (&c, &s) in cell.iter().zip(&t) {
        let local = basis.at(n, c as usize, s);
        first.push(local.first as i64);
        values.extend(local.value);
    }
    Ok((first.to_pyarray(py), values.to_pyarray(py).reshape([t.len(), 3])?))
}

/// Number of functions of a basis on a row of `n` cells.
#[pyfunction]
fn basis_len(basis: &str, n: usize) -> PyResult<usize> {
    Ok(basis.parse::<Basis>()?.len(n))
}

/// Points on [0, 1] and weights of the Gauss-Legendre rule.
#[pyfunction]
fn gauss(py: Python<'_>, n: usize) -> (Bound<'_, PyArray1<f64>>, Bound<'_, PyArray1<f64>>) {
    let rule = Rule::gauss(n);
    (rule.points.to_pyarray(py), rule.weights.to_pyarray(py))
}

/// Densities of particle data in the rows of a packed coefficient array; see `adjoint.rs`.
/// `points` holds the indices along x and y of each quadrature point; `mean` asks for the mean
/// over the particles of a cell instead.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
fn densities(
    location: &PyLocation,
    volume: PyReadonlyArray1<f64>,
    data: PyReadonlyArray2<f64>,
    points: Vec<[usize; 2]>,
    rows: PyReadonlyArray1<u32>,
    columns: Vec<usize>,
    offset: usize,
    mean: bool,
    mut out: PyReadwriteArray2<f64>,
) -> PyResult<()> {
    let location = &location.0;
    let (volume, data, rows) = (volume.as_slice()?, data.as_array(), rows.as_slice()?);
    let out = out.as_array_mut();
    require(data.nrows() == location.len() && volume.len() == location.len(), "particle data")?;
    require(out.is_standard_layout() && out.nrows() == rows.len(), "packed array")?;
    require(rows.iter().all(|&r| (r as usize) < location.active.len()), "row of no active cell")?;
    require(columns.iter().all(|&c| c < data.ncols()) && !columns.is_empty(), "columns")?;
    require(offset + points.len() * columns.len() <= out.ncols(), "packed array too narrow")?;
    let per_axis = (points.len() as f64).sqrt().round() as usize;
    let tensor = per_axis * per_axis == points.len();
    require(tensor && points.iter().flatten().all(|&i| i < per_axis), "not a tensor rule")?;
    let packing = Packing { rows, points: &points, columns: &columns, offset };
    if mean {
        adjoint::cell_means(location, volume, data, &packing, out);
    } else {
        adjoint::densities(location, volume, data, &Rule::gauss(per_axis), &packing, out);
    }
    Ok(())
}

/// `sum_p V_p D_p N_i(x_p)` over the functions of a basis: functions x columns.
#[pyfunction]
fn nodal_sums<'py>(
    py: Python<'py>,
    location: &PyLocation,
    volume: PyReadonlyArray1<f64>,
    data: PyReadonlyArray2<f64>,
    basis: &str,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (volume, data) = (volume.as_slice()?, data.as_array());
    require(data.nrows() == location.0.len() && volume.len() == location.0.len(), "particle data")?;
    Ok(adjoint::nodal_sums(&location.0, volume, data, basis.parse()?).to_pyarray(py))
}

#[pymodule]
fn _rust(m: &Bound<'_, PyModule>) -> PyResult<()> {
    m.add("TawamiError", m.py().get_type::<TawamiError>())?;
    m.add("InputError", m.py().get_type::<InputError>())?;
    m.add_class::<PyGrid>()?;
    m.add_class::<PyLocation>()?;
    m.add_class::<PyParticles>()?;
    m.add_class::<PyMaterial>()?;
    m.add_class::<PyStage>()?;
    m.add_function(wrap_pyfunction!(interpolate, m)?)?;
    m.add_function(wrap_pyfunction!(basis_1d, m)?)?;
    m.add_function(wrap_pyfunction!(basis_len, m)?)?;
    m.add_function(wrap_pyfunction!(gauss, m)?)?;
    m.add_function(wrap_pyfunction!(densities, m)?)?;
    m.add_function(wrap_pyfunction!(nodal_sums, m)?)?;
    Ok(())
}
