//! The grid, where points are in it, and its bases.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::array::{Read1, Read2};
use super::require;
use crate::active::Active;
use crate::basis::Basis;
use crate::error::Error;
use crate::grid::{Grid, Location, MAX_CELLS};
use crate::interpolation::Field;
use crate::quadrature::Rule;

/// Points of a Gauss rule beyond which its making, which takes their square, would be waited for.
const MAX_GAUSS: usize = 1000;

#[pyclass(name = "Grid", frozen)]
pub(super) struct PyGrid(pub(super) Grid);

#[pymethods]
impl PyGrid {
    #[new]
    fn new(origin: [f64; 2], h: f64, cells: [usize; 2]) -> PyResult<Self> {
        Ok(Self(Grid::new(origin, h, cells)?))
    }

    fn locate(&self, x: Read2<f64>) -> PyResult<PyLocation> {
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
pub(super) struct PyLocation(pub(super) Arc<Location>);

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

    /// The same, away from the sides of the cells by a part of a cell, up to a half.
    fn away_from_sides(&self, margin: f64) -> PyResult<Self> {
        require((0.0..=0.5).contains(&margin), "a margin beyond half a cell")?;
        Ok(Self(Arc::new((*self.0).clone().away_from_sides(margin))))
    }

    /// Where some of the particles are.
    fn select(&self, particles: Read1<u32>) -> PyResult<Self> {
        let particles = particles.as_slice()?;
        let inside = particles.iter().all(|&p| (p as usize) < self.0.len());
        require(inside, "a selection of other particles")?;
        Ok(Self(Arc::new(self.0.select(particles))))
    }
}

/// The cells that hold particles and the functions on them; see `active.rs`.
#[pyclass(name = "Active", frozen)]
pub(super) struct PyActive(Active, Grid);

impl PyActive {
    fn functions_of(&self, basis: Basis) -> usize {
        self.1.cells.map(|n| basis.len(n)).iter().product()
    }
}

#[pymethods]
impl PyActive {
    #[new]
    fn new(grid: &PyGrid, cells: Read1<u32>) -> PyResult<Self> {
        let cells = cells.as_slice()?;
        let inside = cells.iter().all(|&c| (c as usize) < grid.0.num_cells());
        require(inside, "a cell outside the grid")?;
        Ok(Self(Active::new(grid.0, cells), grid.0))
    }

    /// Whether each function of a basis has an active cell in its support.
    fn functions<'py>(&self, py: Python<'py>, basis: &str) -> PyResult<Bound<'py, PyArray1<bool>>> {
        Ok(self.0.functions(basis.parse()?).to_pyarray(py))
    }

    /// Number of parts of the body that share no function, and the part of each function.
    fn parts<'py>(
        &self,
        py: Python<'py>,
        basis: &str,
    ) -> PyResult<(usize, Bound<'py, PyArray1<i64>>)> {
        let (number, of_functions) = self.0.parts(basis.parse()?);
        Ok((number, of_functions.to_pyarray(py)))
    }

    /// For each function, the value of one of its active cells; 0 if it has none.
    fn spread<'py>(
        &self,
        py: Python<'py>,
        basis: &str,
        of_cells: Read1<i64>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let of_cells = of_cells.as_slice()?;
        require(of_cells.len() == self.1.num_cells(), "values of other cells")?;
        Ok(self.0.spread(basis.parse()?, of_cells, 0).to_pyarray(py))
    }

    /// The active cells (i, j) in the support of a function: cells x 2.
    fn support<'py>(
        &self,
        py: Python<'py>,
        basis: &str,
        function: usize,
    ) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let basis: Basis = basis.parse()?;
        require(function < self.functions_of(basis), "a function of another basis")?;
        let cells = self.0.support(basis, function);
        let flat: Vec<i64> = cells.as_flattened().iter().map(|&i| i as i64).collect();
        flat.to_pyarray(py).reshape([cells.len(), 2])
    }
}

pub(super) fn field<'a, const C: usize>(
    grid: Grid,
    basis: Basis,
    coefficients: &'a Read1<f64>,
) -> PyResult<Field<'a, C>> {
    let coefficients = coefficients.as_slice()?;
    let expected = C * basis.len(grid.cells[0]) * basis.len(grid.cells[1]);
    require(coefficients.len() == expected, "wrong number of grid coefficients")?;
    Ok(Field { grid, basis, coefficients })
}

/// Values of a grid field at points: points x components.
#[pyfunction]
pub(super) fn interpolate<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
    components: usize,
    coefficients: Read1<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (basis, grid) = (basis.parse()?, location.0.grid);
    let values = match components {
        1 => field::<1>(grid, basis, &coefficients)?.at_particles(&location.0).into_flattened(),
        2 => field::<2>(grid, basis, &coefficients)?.at_particles(&location.0).into_flattened(),
        _ => return Err(PyRuntimeError::new_err("internal: fields have 1 or 2 components")),
    };
    values.to_pyarray(py).reshape([location.0.len(), components])
}

/// Gradients of a displacement at points (xx, xy, yx, yy: d u_x/dx, d u_x/dy, ...): points x 4.
#[pyfunction]
pub(super) fn gradients<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
    coefficients: Read1<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let location = &location.0;
    let u = field::<2>(location.grid, basis.parse()?, &coefficients)?;
    let at = |p: usize| u.gradient(location.cell[p] as usize, location.xi[p]);
    let values: Vec<[[f64; 2]; 2]> = (0..location.len()).into_par_iter().map(at).collect();
    values.as_flattened().as_flattened().to_pyarray(py).reshape([location.len(), 4])
}

/// Functions of a basis on a row of `n` cells at positions `t` of `cell`: index of the first one
/// and the values of up to three.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub(super) fn basis_1d<'py>(
    py: Python<'py>,
    basis: &str,
    n: usize,
    cell: Read1<i64>,
    t: Read1<f64>,
) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray2<f64>>)> {
    let basis: Basis = basis.parse()?;
    require(n <= MAX_CELLS, "a row of more cells than a grid has")?;
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
pub(super) fn basis_len(basis: &str, n: usize) -> PyResult<usize> {
    require(n <= MAX_CELLS, "a row of more cells than a grid has")?;
    Ok(basis.parse::<Basis>()?.len(n))
}

/// Points on [0, 1] and weights of the Gauss-Legendre rule.
#[pyfunction]
#[allow(clippy::type_complexity)]
pub(super) fn gauss(
    py: Python<'_>,
    n: usize,
) -> PyResult<(Bound<'_, PyArray1<f64>>, Bound<'_, PyArray1<f64>>)> {
    require(n <= MAX_GAUSS, "a rule of very many points")?;
    let rule = Rule::gauss(n);
    Ok((rule.points.to_pyarray(py), rule.weights.to_pyarray(py)))
}
