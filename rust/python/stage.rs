//! The particle stage of a Newton iteration.

use std::sync::Arc;

use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::array::{Read1, Write2};
use super::grid::{field, PyLocation};
use super::particles::{laws, PyMaterial, PyParticles};
use super::require;
use crate::basis::Basis;
use crate::constitutive::{Operator, Part, Request, Response, Stage, MAX_HISTORY};
use crate::grid::Location;
use crate::kinematics::{Increments, Kinematics};
use crate::material::Material;
use crate::tensor::{Sym, COMPONENTS};

/// The particle side of one scene: its particles in their cells, with their laws.
#[pyclass(name = "Stage")]
pub(super) struct PyStage {
    particles: Py<PyParticles>,
    location: Arc<Location>,
    materials: Vec<Arc<dyn Material>>,
    history: Vec<Vec<usize>>,
    kinematics: Kinematics,
    finite: bool,
    basis: Basis,
}

/// Stress and tangent that were computed in Python, flat.
type Given<'py> = (Read1<'py, f64>, Read1<'py, f64>);

impl PyStage {
    fn with<R>(
        &self,
        u: &Read1<f64>,
        volumetric: Option<&Read1<f64>>,
        given: Option<&Given>,
        run: impl FnOnce(&Stage) -> R,
    ) -> PyResult<R> {
        let grid = self.location.grid;
        let response = match given {
            None => Response::Laws(&self.materials),
            Some((stress, tangent)) => {
                let (stress, tangent) = (stress.as_slice()?, tangent.as_slice()?);
                let n = self.location.len();
                let fits =
                    stress.len() == COMPONENTS * n && tangent.len() == COMPONENTS * COMPONENTS * n;
                require(fits, "stress and tangent of other particles")?;
                Response::Given(stress, tangent)
            }
        };
        let increments = Increments {
            u: field(grid, self.basis, u)?,
            volumetric: volumetric.map(|v| field(grid, Basis::Bilinear, v)).transpose()?,
        };
        Ok(run(&Stage {
            location: &self.location,
            response,
            history: &self.history,
            kinematics: self.kinematics,
            finite: self.finite,
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
        finite: bool,
        basis: &str,
    ) -> PyResult<Self> {
        let materials = laws(&materials);
        {
            let particles = &particles.try_borrow(py)?.0;
            require(particles.len() == location.0.len(), "location of other particles")?;
            let known = |&m: &u32| (m as usize) < materials.len();
            require(particles.material.iter().all(known), "particles of other materials")?;
        }
        let mut history = Vec::new();
        for law in &materials {
            let names = law.history();
            require(names.len() <= MAX_HISTORY, "a law with more history than there is room for")?;
            let places = particles.try_borrow(py)?.0.history_of(names);
            require(places.is_some(), "particles without the history of their laws")?;
            history.extend(places);
        }
        Ok(Self {
            particles,
            location: Arc::clone(&location.0),
            materials,
            history,
            kinematics: kinematics.parse()?,
            finite,
            basis: basis.parse()?,
        })
    }

    /// Write the requested quantities of the law into `data` (particles x columns).
    #[pyo3(signature = (u, volumetric, requests, data, given=None))]
    fn evaluate(
        &self,
        py: Python,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
        requests: Vec<(String, String, usize)>,
        mut data: Write2<f64>,
        given: Option<Given>,
    ) -> PyResult<()> {
        let particles = self.particles.try_borrow(py)?;
        let (rows, columns) = (data.as_array().nrows(), data.as_array().ncols());
        let data = data.as_slice_mut()?;
        require(rows == particles.0.len(), "data of other particles")?;
        let requests: Vec<Request> = requests.iter().map(request).collect::<PyResult<_>>()?;
        let fits = |r: &Request| {
            r.operator.finite() == self.finite
                && r.column <= columns
                && r.operator.components() * r.part.width() <= columns - r.column
        };
        require(requests.iter().all(fits), "a request reaches outside the particle data")?;
        if requests.is_empty() {
            return Ok(());
        }
        let run = |s: &Stage| s.evaluate(&particles.0, &requests, columns, data);
        Ok(self.with(&u, volumetric.as_ref(), given.as_ref(), run)??)
    }

    /// Accept the increments: stress, displacement and eps_v of the particles. Returns what the laws
    /// dissipate [J per metre depth].
    #[pyo3(signature = (u, volumetric, given=None))]
    fn commit(
        &self,
        py: Python,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
        given: Option<Given>,
    ) -> PyResult<f64> {
        let mut particles = self.particles.try_borrow_mut(py)?;
        Ok(self.with(&u, volumetric.as_ref(), given.as_ref(), |s| s.commit(&mut particles.0))??)
    }

    /// Energy that the laws store in the particles [J per metre depth].
    fn elastic_energy(&self, py: Python) -> PyResult<f64> {
        let particles = &self.particles.try_borrow(py)?.0;
        let of = |p: usize| {
            let law = &self.materials[particles.material[p] as usize];
            let stress: Sym = std::array::from_fn(|i| particles.stress[[p, i]]);
            particles.volume[p] * law.elastic_energy(&law.elastic_strain(&(&stress).into()))
        };
        Ok((0..particles.len()).map(of).sum())
    }

    /// Strain increments at the particles (xx, yy, zz, gamma_xy): n x 4.
    #[pyo3(signature = (u, volumetric))]
    fn strains<'py>(
        &self,
        py: Python<'py>,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let strains: Vec<Sym> = self.with(&u, volumetric.as_ref(), None, |s| {
            (0..self.location.len()).into_par_iter().map(|p| s.strain(p)).collect()
        })?;
        strains.as_flattened().to_pyarray(py).reshape([self.location.len(), COMPONENTS])
    }

    /// div u (ln J_f at finite strain) and the bilinear field (0 if there is none) at the particles: n x 2.
    #[pyo3(signature = (u, volumetric))]
    fn volume_strains<'py>(
        &self,
        py: Python<'py>,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let location = &self.location;
        let of = |s: &Stage, p| [s.volume_change(p), s.increments.volumetric_at(location, p)];
        let strains: Vec<[f64; 2]> = self.with(&u, volumetric.as_ref(), None, |s| {
            (0..location.len()).into_par_iter().map(|p| of(s, p)).collect()
        })?;
        strains.as_flattened().to_pyarray(py).reshape([location.len(), 2])
    }
}

pub(super) fn request((operator, part, column): &(String, String, usize)) -> PyResult<Request> {
    let operator = match operator.as_str() {
        "sigma" => Operator::Sigma,
        "s" => Operator::Deviator,
        "sigma_m" => Operator::Mean,
        "P" => Operator::Nominal,
        "P_s" => Operator::NominalDeviator,
        "tau_m" => Operator::MeanKirchhoff,
        "ln_J" => Operator::LnJ,
        other => return Err(PyRuntimeError::new_err(format!("internal: operator '{other}'"))),
    };
    let part = match part.as_str() {
        "value" => Part::Value,
        "strain" => Part::Strain,
        "gradient" => Part::Gradient,
        "volume" => Part::Volume,
        other => return Err(PyRuntimeError::new_err(format!("internal: part '{other}'"))),
    };
    Ok(Request { operator, part, column: *column })
}
