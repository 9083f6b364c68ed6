//! Particles, as views of their storage.

use numpy::{PyArray, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::array::{Read1, Read2};
use super::law::{laws, PyMaterial};
use super::threads::detached;
use super::{require, InputError};
use crate::particles::stage::check_materials;
use crate::particles::{Particles, Role, Values, GRADIENT};
use crate::space::{Geometry, COMPONENTS, DIM};
use crate::tensor::Gradient;

/// Most columns of an array of a time integration.
const MAX_WIDTH: usize = 64;

#[pyclass(name = "Particles", module = "tawami._rust")]
pub(super) struct PyParticles(pub(super) Particles);

/// View of a column. Columns keep their length, and the view keeps the particles alive.
fn column<'py>(particles: &Bound<'py, PyParticles>, place: usize) -> PyResult<Bound<'py, PyAny>> {
    let (object, owner) = (particles.try_borrow()?, particles.clone().into_any());
    // SAFETY: a column is never reallocated, and the view keeps the particles.
    Ok(unsafe {
        match object.0.columns()[place].values() {
            Values::Reals(values) => PyArray::borrow_from_array(values, owner).into_any(),
            Values::Numbers(values) => PyArray::borrow_from_array(values, owner).into_any(),
        }
    })
}

/// View of a column that Python cannot write: the cells of the particles and the constants of their laws
/// were computed from it.
fn read_only<'py>(
    particles: &Bound<'py, PyParticles>,
    place: usize,
) -> PyResult<Bound<'py, PyAny>> {
    let view = column(particles, place)?;
    view.call_method("setflags", (false,), None)?;
    Ok(view)
}

/// View of a column that not all particles have; `missing` makes the message from the names of those there
/// are.
fn optional<'py>(
    particles: &Bound<'py, PyParticles>,
    role: Role,
    name: &str,
    missing: impl Fn(Vec<&str>) -> String,
) -> PyResult<Bound<'py, PyAny>> {
    let place = {
        let object = particles.try_borrow()?;
        let place = object.0.place(role, name);
        place.ok_or_else(|| InputError::new_err(missing(object.0.names(role))))?
    };
    column(particles, place)
}

/// Logarithmic strains of displacement gradients of some width, one after the other.
fn logarithmic_rows<'py>(
    py: Python<'py>,
    gradients: &[f64],
    width: usize,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows: Vec<_> = detached(py, || {
        let gradients = gradients.par_chunks_exact(width);
        gradients.map(|h| Gradient::of_rows(h).logarithmic()).collect()
    });
    rows.as_flattened().to_pyarray(py).reshape([rows.len(), COMPONENTS])
}

/// Logarithmic strains (shear as eps_xy) of displacement gradients, row by row 2 x 2, or 3 x 3 in axisymmetry.
#[pyfunction]
pub(super) fn logarithmic_strain<'py>(
    py: Python<'py>,
    gradients: Read2<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let gradients = gradients.as_array();
    let width = gradients.ncols();
    let known = [Geometry::PlaneStrain, Geometry::Axisymmetric].map(Geometry::tensor);
    require(known.contains(&width), "gradients of another space")?;
    logarithmic_rows(py, gradients.as_standard_layout().as_slice().unwrap_or_default(), width)
}

#[pymethods]
impl PyParticles {
    #[new]
    fn new(x: Read2<f64>, volume: Read1<f64>, material: Read1<u32>) -> PyResult<Self> {
        let x = x.as_array().as_standard_layout().into_owned();
        let (volume, material) = (volume.as_array().to_owned(), material.as_array().to_owned());
        Ok(Self(Particles::new(x, volume, material)?))
    }

    /// Check what a user may have written into the arrays.
    fn check(&self) -> PyResult<()> {
        Ok(self.0.check()?)
    }

    /// Check that the laws of the particles fit kinematics and strains.
    fn check_materials(
        &self,
        materials: Vec<PyRef<PyMaterial>>,
        kinematics: &str,
        finite: bool,
    ) -> PyResult<()> {
        Ok(check_materials(&self.0, &laws(&materials), kinematics.parse()?, finite)?)
    }

    /// Some of the particles.
    fn select(&self, particles: Read1<u32>) -> PyResult<Self> {
        let particles = particles.as_slice()?;
        let inside = particles.iter().all(|&p| (p as usize) < self.0.len());
        require(inside, "a selection of other particles")?;
        Ok(Self(self.0.select(particles)))
    }

    /// All arrays side by side, one row per particle.
    fn rows<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.0.rows().to_pyarray(py)
    }

    /// Particles with the same arrays, from such rows.
    fn of_rows(&self, rows: Read2<f64>) -> PyResult<Self> {
        let particles = self.0.of_rows(&rows.as_array()).map(Self);
        particles.ok_or_else(|| PyRuntimeError::new_err("internal: rows of other particles"))
    }

    /// Copy the values of the same particles; false if they are others.
    fn assign(&mut self, other: PyRef<Self>) -> bool {
        self.0.assign(&other.0)
    }

    /// Add an array of a time integration, zero at first.
    fn carry(&mut self, name: &str, width: usize) -> PyResult<()> {
        require(width <= MAX_WIDTH, "an array of very many columns")?;
        self.0.add(Role::Carried, name, Some(width));
        Ok(())
    }

    /// An array of a time integration by its name: n x width.
    fn carried<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        optional(slf, Role::Carried, name, |known| {
            if known.is_empty() {
                return format!(
                    "no array '{name}': the scene is static. Dynamics(scene, velocity=...) gives its \
                     particles velocities and accelerations"
                );
            }
            format!("no array '{name}': expected one of {known:?}")
        })
    }

    /// Add the history variables of laws, zero at first.
    fn add_history(&mut self, materials: Vec<PyRef<PyMaterial>>) {
        for law in laws(&materials) {
            law.history().iter().for_each(|name| self.0.add(Role::History, name, None));
        }
    }

    /// Move the particles to other positions.
    fn move_to(&mut self, x: Read2<f64>) -> PyResult<()> {
        let mine = self.0.reals_mut(Particles::X);
        let x = x.as_array();
        require(x.ncols() == DIM && x.len() == mine.len(), "positions of other particles")?;
        // a copy: the positions may be a view of these particles' own, in another order
        let x: Vec<f64> = x.iter().copied().collect();
        mine.copy_from_slice(&x);
        Ok(())
    }

    /// Names of the history variables.
    #[getter]
    fn history_names(&self) -> Vec<&str> {
        self.0.names(Role::History)
    }

    /// A history variable by its name.
    fn history<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        optional(slf, Role::History, name, |known| {
            if known.is_empty() {
                return format!(
                    "history '{name}': the laws of this scene have no history: expected a plastic law, as \
                     von_mises(...), drucker_prager(...) or mohr_coulomb(...)"
                );
            }
            format!("history '{name}': the laws of this scene have {known:?}")
        })
    }

    /// Add the volumetric strain, zero at first.
    fn add_eps_v(&mut self) {
        self.0.add(Role::State, "eps_v", None);
    }

    /// Add what the strain since the start follows from.
    #[pyo3(signature = (finite, geometry = "plane_strain"))]
    fn add_strain(&mut self, finite: bool, geometry: &str) -> PyResult<()> {
        self.0.add_strain(finite, geometry.parse()?);
        Ok(())
    }

    /// Name of each array, and bytes that one particle takes in it.
    #[getter]
    fn arrays(&self) -> Vec<(&str, usize)> {
        self.0.arrays()
    }

    #[getter]
    fn bytes_per_particle(&self) -> usize {
        self.0.bytes_per_particle()
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    #[getter]
    fn x<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        read_only(slf, Particles::X)
    }

    #[getter]
    fn volume<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        column(slf, Particles::VOLUME)
    }

    #[getter]
    fn material<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        read_only(slf, Particles::MATERIAL)
    }

    #[getter]
    fn number<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        read_only(slf, Particles::NUMBER)
    }

    #[getter]
    fn stress<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        column(slf, Particles::STRESS)
    }

    #[getter]
    fn displacement<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        column(slf, Particles::DISPLACEMENT)
    }

    /// Strain since the start: small, or logarithmic.
    #[getter]
    fn strain<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (small, gradient) = {
            let particles = &slf.try_borrow()?.0;
            (particles.place(Role::State, "strain"), particles.place(Role::State, GRADIENT))
        };
        match (small, gradient) {
            (Some(place), _) => read_only(slf, place),
            (None, Some(place)) => {
                let particles = &slf.try_borrow()?.0;
                let (h, n) = (particles.reals(place), particles.len());
                Ok(logarithmic_rows(slf.py(), h, (h.len() / n.max(1)).max(1))?.into_any())
            }
            (None, None) => Err(InputError::new_err("internal: particles without a scene")),
        }
    }

    /// F - I since the start.
    #[getter]
    fn displacement_gradient<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let view = optional(slf, Role::State, GRADIENT, |_| {
            "displacement_gradient: particles store it at finite strain only: expected \
             scene.particles.strain, or Scene(..., form='u_epsv_finite')"
                .to_owned()
        })?;
        let columns: usize = view.getattr("shape")?.get_item(1)?.extract()?;
        let rows = (1..columns).find(|rows| rows * rows == columns).unwrap_or(1);
        view.call_method1("reshape", (slf.try_borrow()?.0.len(), rows, rows))
    }

    #[getter]
    fn eps_v<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        optional(slf, Role::State, "eps_v", |_| {
            "eps_v: the form of this scene has no volumetric strain: expected one with the kinematics \
             'mixed', as Scene(..., form='u_epsv') or, at finite strain, form='u_epsv_finite'"
                .to_owned()
        })
    }
}
