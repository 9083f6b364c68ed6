//! Particles, as views of their storage, and material laws.

use std::sync::Arc;

use numpy::{PyArray, PyArray1, PyArray2, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use super::array::{Read1, Read2};
use super::{require, view, InputError};
use crate::constitutive;
use crate::material::{
    DruckerPrager, Friction, LinearElastic, Material, MohrCoulomb, NeoHookean, VonMises,
};
use crate::particles::Particles;

/// The same array, not writeable from Python: the cells of the particles and their laws' constants
/// are known from these values.
fn read_only<T, D>(array: Bound<'_, PyArray<T, D>>) -> PyResult<Bound<'_, PyArray<T, D>>> {
    array.call_method("setflags", (false,), None)?;
    Ok(array)
}

/// Columns that an array of a time integration has at most.
const MAX_WIDTH: usize = 64;

#[pyclass(name = "Particles", module = "tawami._rust")]
pub(super) struct PyParticles(pub(super) Particles);

#[pymethods]
impl PyParticles {
    #[new]
    fn new(x: Read2<f64>, volume: Read1<f64>, material: Read1<u32>) -> PyResult<Self> {
        let x = x.as_array().as_standard_layout().into_owned();
        let (volume, material) = (volume.as_array().to_owned(), material.as_array().to_owned());
        Ok(Self(Particles::new(x, volume, material)?))
    }

    fn check(&self) -> PyResult<()> {
        Ok(self.0.check()?)
    }

    fn check_materials(
        &self,
        materials: Vec<PyRef<PyMaterial>>,
        kinematics: &str,
        finite: bool,
    ) -> PyResult<()> {
        let laws = laws(&materials);
        Ok(constitutive::check_materials(&self.0, &laws, kinematics.parse()?, finite)?)
    }

    /// Some of the particles.
    fn select(&self, particles: Read1<u32>) -> PyResult<Self> {
        let particles = particles.as_slice()?;
        let inside = particles.iter().all(|&p| (p as usize) < self.0.len());
        require(inside, "a selection of other particles")?;
        Ok(Self(self.0.select(particles)))
    }

    /// All arrays side by side, a row each.
    fn rows<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        self.0.rows().to_pyarray(py)
    }

    /// Particles with the same arrays, from such rows.
    fn of_rows(&self, rows: Read2<f64>) -> PyResult<Self> {
        let particles = self.0.of_rows(&rows.as_array()).map(Self);
        particles.ok_or_else(|| PyRuntimeError::new_err("internal: rows of other particles"))
    }

    /// Take over the values of the same particles; false if they are others.
    fn assign(&mut self, other: PyRef<Self>) -> bool {
        self.0.assign(&other.0)
    }

    /// Make room for an array of a time integration.
    fn carry(&mut self, name: &str, width: usize) -> PyResult<()> {
        require(width <= MAX_WIDTH, "an array of very many columns")?;
        self.0.carry(name, width);
        Ok(())
    }

    /// An array of a time integration by its name: n x width.
    fn carried<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let object = slf.try_borrow()?;
        let Some((_, array)) = object.0.carried.iter().find(|(known, _)| known == name) else {
            let known: Vec<_> = object.0.carried.iter().map(|(known, _)| known.as_str()).collect();
            return Err(InputError::new_err(if known.is_empty() {
                format!(
                    "no array '{name}': a scene by itself is static; Dynamics(scene, velocity=...) \
                     gives its particles velocities and accelerations"
                )
            } else {
                format!("no array '{name}': expected one of {known:?}")
            }));
        };
        // SAFETY: as in `view`; never reallocated once it is there.
        Ok(unsafe { PyArray::borrow_from_array(array, slf.clone().into_any()) })
    }

    fn add_history(&mut self, materials: Vec<PyRef<PyMaterial>>) {
        for law in laws(&materials) {
            self.0.add_history(law.history());
        }
    }

    /// Put the particles elsewhere.
    fn move_to(&mut self, x: Read2<f64>) -> PyResult<()> {
        require(x.as_array().dim() == self.0.x.dim(), "positions of other particles")?;
        // a copy: the positions may be a view of these particles' own, in another order
        let x = x.as_array().to_owned();
        self.0.x.assign(&x);
        Ok(())
    }

    /// Names of the history variables.
    #[getter]
    fn history_names(&self) -> Vec<&'static str> {
        self.0.history.iter().map(|(name, _)| *name).collect()
    }

    /// A history variable by its name.
    fn history<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let object = slf.try_borrow()?;
        let Some((_, array)) = object.0.history.iter().find(|(known, _)| *known == name) else {
            let known: Vec<_> = object.0.history.iter().map(|(name, _)| *name).collect();
            return Err(InputError::new_err(if known.is_empty() {
                format!(
                    "history '{name}': the laws of this scene have none: expected a plastic law, as \
                     von_mises(...), drucker_prager(...) or mohr_coulomb(...)"
                )
            } else {
                format!("history '{name}': the laws of this scene have {known:?}")
            }));
        };
        // SAFETY: as in `view`; never reallocated once a scene is made.
        Ok(unsafe { PyArray::borrow_from_array(array, slf.clone().into_any()) })
    }

    fn add_eps_v(&mut self) {
        self.0.add_eps_v();
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
    fn x<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        read_only(view(|p: &Self| &p.0.x, slf)?)
    }

    #[getter]
    fn volume<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        view(|p: &Self| &p.0.volume, slf)
    }

    #[getter]
    fn material<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        read_only(view(|p: &Self| &p.0.material, slf)?)
    }

    #[getter]
    fn number<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<u32>>> {
        read_only(view(|p: &Self| &p.0.number, slf)?)
    }

    #[getter]
    fn stress<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view(|p: &Self| &p.0.stress, slf)
    }

    #[getter]
    fn displacement<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        view(|p: &Self| &p.0.displacement, slf)
    }

    #[getter]
    fn eps_v<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let object = slf.try_borrow()?;
        let Some(array) = object.0.eps_v.as_ref() else {
            return Err(InputError::new_err(
                "eps_v: the form of this scene has no volumetric strain: expected one with the \
                 kinematics 'mixed', as Scene(..., form='u_epsv') or, at finite strain, \
                 form='u_epsv_finite'",
            ));
        };
        // SAFETY: as in `view`; never reallocated.
        Ok(unsafe { PyArray::borrow_from_array(array, slf.clone().into_any()) })
    }
}

#[pyclass(name = "Material", frozen, module = "tawami._rust")]
pub(super) struct PyMaterial {
    law: Arc<dyn Material>,
    /// The function that made it, and what that got: how it is copied and pickled.
    made: (&'static str, Vec<f64>),
}

impl PyMaterial {
    fn new(law: impl Material + 'static, made: &'static str, given: &[f64]) -> Self {
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

    /// How a copy is made, here or in another process.
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

    /// What the law is called.
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

    #[getter]
    fn bulk_modulus(&self) -> f64 {
        self.law.bulk_modulus()
    }

    #[getter]
    fn shear_modulus(&self) -> f64 {
        self.law.shear_modulus()
    }
}

pub(super) fn laws(materials: &[PyRef<PyMaterial>]) -> Vec<Arc<dyn Material>> {
    materials.iter().map(|m| Arc::clone(&m.law)).collect()
}
