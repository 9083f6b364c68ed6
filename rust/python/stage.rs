//! The particle stage of a Newton iteration.

use std::sync::Arc;

use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;
use rayon::prelude::*;

use super::array::{Read1, Write2};
use super::grid::PyLocation;
use super::law::{laws, PyMaterial};
use super::particles::PyParticles;
use super::require;
use super::threads::detached;
use super::transfer::field;
use crate::grid::{Basis, Location};
use crate::law::{Law, MAX_HISTORY};
use crate::particles::given::Given;
use crate::particles::kinematics::{Increments, Kinematics};
use crate::particles::request::Request;
use crate::particles::stage::{Output, Stage};
use crate::space::COMPONENTS;
use crate::tensor::{Strain, Stress, Sym};

/// The law quantities that a form reads, array by array; parsed once.
#[pyclass(name = "Requests", frozen, module = "tawami._rust")]
pub(super) struct PyRequests {
    arrays: Vec<Vec<Request>>,
    finite: Option<bool>,
}

/// Quantity, part, first column and factors (one per particle, or none) of a request.
type RequestOf<'py> = (String, String, usize, Option<Read1<'py, f64>>);

#[pymethods]
impl PyRequests {
    /// From the requests of each array of particle data.
    #[new]
    fn new(arrays: Vec<Vec<RequestOf>>) -> PyResult<Self> {
        let request = |(operator, part, column, factor): &RequestOf| -> PyResult<Request> {
            let factor = factor.as_ref().map(|factor| Ok(factor.as_slice()?.to_vec()));
            Ok(Request {
                operator: operator.parse()?,
                part: part.parse()?,
                column: *column,
                factor: factor.transpose().map_err(|e: numpy::NotContiguousError| e)?,
            })
        };
        let requests = |array: &Vec<RequestOf>| array.iter().map(request).collect();
        let arrays: Vec<Vec<Request>> = arrays.iter().map(requests).collect::<PyResult<_>>()?;
        let strains = || arrays.iter().flatten().filter_map(|request| request.operator.finite());
        let finite = strains().next();
        let same = strains().all(|mine| Some(mine) == finite);
        require(same, "requests of small and of finite strain")?;
        Ok(Self { arrays, finite })
    }

    /// Whether there are derivatives of history variables.
    #[getter]
    fn history_slopes(&self) -> bool {
        self.arrays.iter().flatten().any(Request::history_slope)
    }
}

impl PyRequests {
    /// Check that the requests belong to particles with `finite` strains and to arrays of these columns.
    fn check(&self, location: &Location, finite: bool, columns: &[usize]) -> PyResult<()> {
        let (particles, geometry) = (location.len(), location.grid.geometry);
        require(self.finite.is_none_or(|mine| mine == finite), "requests of other strains")?;
        require(self.arrays.len() == columns.len(), "requests of other arrays")?;
        for (requests, &columns) in self.arrays.iter().zip(columns) {
            let fits = |request: &Request| {
                request.column <= columns && request.width(geometry) <= columns - request.column
            };
            require(requests.iter().all(fits), "a request reaches outside the particle data")?;
            let mut factors = requests.iter().flat_map(|request| &request.factor);
            require(factors.all(|f| f.len() == particles), "factors of other particles")?;
        }
        Ok(())
    }
}

/// The particle side of one scene: its particles in their cells, with their laws.
#[pyclass(name = "Stage", frozen, module = "tawami._rust")]
pub(super) struct PyStage {
    particles: Py<PyParticles>,
    location: Arc<Location>,
    materials: Vec<Arc<dyn Law>>,
    kinematics: Kinematics,
    finite: bool,
    basis: Basis,
}

/// Responses that were computed in Python, flat: stress, tangent, plastic volumetric strain, history
/// variables, and their derivatives (empty if none are requested).
type GivenArrays<'py> =
    (Read1<'py, f64>, Read1<'py, f64>, Read1<'py, f64>, Read1<'py, f64>, Read1<'py, f64>);

impl PyStage {
    fn given<'a>(&self, arrays: &'a GivenArrays) -> PyResult<Given<'a>> {
        let (stress, tangent, plastic, history, slopes) = arrays;
        let (stress, tangent) = (stress.as_slice()?, tangent.as_slice()?);
        let (plastic_volume, n) = (plastic.as_slice()?, self.location.len());
        let (history, slopes) = (history.as_slice()?, slopes.as_slice()?);
        let variables = history.len() / n.max(1);
        let external = self.materials.iter().filter(|law| law.external());
        let fits = stress.len() == COMPONENTS * n
            && tangent.len() == COMPONENTS * COMPONENTS * n
            && plastic_volume.len() == n
            && history.len() == variables * n
            && external.into_iter().all(|law| n == 0 || law.history().len() <= variables)
            && (slopes.is_empty() || slopes.len() == COMPONENTS * history.len());
        require(fits, "responses of other particles")?;
        Ok(Given { stress, tangent, plastic_volume, variables, history, slopes })
    }

    /// A copy of volumes, which may be a view of the particles.
    fn volume(&self, given: Option<Read1<f64>>) -> PyResult<Option<Vec<f64>>> {
        let Some(given) = given else { return Ok(None) };
        let volume = given.as_slice()?.to_vec();
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        Ok(Some(volume))
    }

    fn stage<'a>(
        &'a self,
        u: &'a Read1<f64>,
        volumetric: Option<&'a Read1<f64>>,
        given: Option<&'a GivenArrays>,
    ) -> PyResult<Stage<'a>> {
        let grid = self.location.grid;
        let increments = Increments {
            u: field(grid, self.basis, u)?,
            volumetric: volumetric.map(|v| field(grid, Basis::Bilinear, v)).transpose()?,
        };
        Ok(Stage {
            location: &self.location,
            laws: &self.materials,
            given: given.map(|arrays| self.given(arrays)).transpose()?,
            kinematics: self.kinematics,
            finite: self.finite,
            increments,
        })
    }

    /// Check that the responses of external laws are given.
    fn check_given(&self, stage: &Stage) -> PyResult<()> {
        let given = stage.given.is_some() || !self.materials.iter().any(|law| law.external());
        require(given, "an external law without its responses")
    }

    /// Rows of `N` numbers, one per particle.
    fn each<'py, const N: usize>(
        &self,
        py: Python<'py>,
        of: impl Fn(usize) -> [f64; N] + Sync + Send,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let n = self.location.len();
        let rows: Vec<[f64; N]> = detached(py, || (0..n).into_par_iter().map(of).collect());
        rows.as_flattened().to_pyarray(py).reshape([n, N])
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
            require(particles.material().iter().all(known), "particles of other materials")?;
            for law in &materials {
                let names = law.history();
                require(names.len() <= MAX_HISTORY, "a law with too many history variables")?;
                let known = particles.history_of(names).is_some();
                require(known, "particles without the history of their laws")?;
            }
        }
        Ok(Self {
            particles,
            location: Arc::clone(&location.0),
            materials,
            kinematics: kinematics.parse()?,
            finite,
            basis: basis.parse()?,
        })
    }

    /// Write the requested quantities of the law into arrays of particle data (particles x columns).
    #[pyo3(signature = (u, volumetric, requests, data, given=None))]
    fn evaluate(
        &self,
        py: Python,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
        requests: &PyRequests,
        mut data: Vec<Write2<f64>>,
        given: Option<GivenArrays>,
    ) -> PyResult<()> {
        let particles = self.particles.try_borrow(py)?;
        let particles = &particles.0;
        let columns: Vec<usize> = data.iter().map(|data| data.as_array().ncols()).collect();
        requests.check(&self.location, self.finite, &columns)?;
        let rows = data.iter().all(|data| data.as_array().nrows() == particles.len());
        require(rows, "data of other particles")?;
        let mut outputs = Vec::with_capacity(data.len());
        for ((data, requests), columns) in data.iter_mut().zip(&requests.arrays).zip(columns) {
            if !requests.is_empty() {
                outputs.push(Output { requests, columns, data: data.as_slice_mut()? });
            }
        }
        if outputs.is_empty() {
            return Ok(());
        }
        let stage = self.stage(&u, volumetric.as_ref(), given.as_ref())?;
        self.check_given(&stage)?;
        let slopes = !requests.history_slopes()
            || stage
                .given
                .is_none_or(|given| given.slopes.len() == COMPONENTS * given.history.len());
        require(slopes, "no derivatives of history variables")?;
        Ok(detached(py, || stage.evaluate(particles, outputs))?)
    }

    /// Accept the increments: stress, displacement and eps_v of the particles. Returns the energy that the
    /// laws dissipate [J per metre depth], with these volumes, those of the particles by default.
    #[pyo3(signature = (u, volumetric, given=None, volume=None))]
    fn commit(
        &self,
        py: Python,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
        given: Option<GivenArrays>,
        volume: Option<Read1<f64>>,
    ) -> PyResult<f64> {
        let volume = self.volume(volume)?;
        let mut particles = self.particles.try_borrow_mut(py)?;
        let particles = &mut particles.0;
        let stage = self.stage(&u, volumetric.as_ref(), given.as_ref())?;
        self.check_given(&stage)?;
        Ok(detached(py, || stage.commit(particles, volume.as_deref()))?)
    }

    /// Energy that the laws store in the particles [J per metre depth], with these volumes, those of the
    /// particles by default.
    #[pyo3(signature = (volume=None))]
    fn elastic_energy(&self, py: Python, volume: Option<Read1<f64>>) -> PyResult<f64> {
        let given = self.volume(volume)?;
        let particles = &self.particles.try_borrow(py)?.0;
        let volume = given.as_deref().unwrap_or(particles.volume());
        let material = particles.material();
        let of = |(p, stress): (usize, &[f64])| {
            let law = &self.materials[material[p] as usize];
            let stress: Sym = std::array::from_fn(|i| stress[i]);
            volume[p] * law.elastic_energy(&law.elastic_strain(&Stress::from(&stress)))
        };
        Ok(particles.stress().chunks_exact(COMPONENTS).enumerate().map(of).sum())
    }

    /// Strain that the law of each particle receives: deviator (xx, yy, zz, gamma_xy) and volume, n x 5.
    #[pyo3(signature = (u, volumetric))]
    fn strains<'py>(
        &self,
        py: Python<'py>,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let particles = &self.particles.try_borrow(py)?.0;
        let stage = self.stage(&u, volumetric.as_ref(), None)?;
        let strains = detached(py, || stage.strains(particles))?;
        let row = |strain: &Strain| strain.deviator.into_iter().chain([strain.volume]);
        let flat: Vec<f64> = strains.iter().flat_map(row).collect();
        flat.to_pyarray(py).reshape([strains.len(), COMPONENTS + 1])
    }

    /// div u (ln J_f at finite strain) and the linear field (0 if there is none) at the particles: n x 2.
    #[pyo3(signature = (u, volumetric))]
    fn volume_strains<'py>(
        &self,
        py: Python<'py>,
        u: Read1<f64>,
        volumetric: Option<Read1<f64>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let stage = self.stage(&u, volumetric.as_ref(), None)?;
        let volumetric_at = |p| stage.increments.volumetric_at(&self.location, p);
        self.each(py, |p| [stage.volume_change(p), volumetric_at(p)])
    }
}
