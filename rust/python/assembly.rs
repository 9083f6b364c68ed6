//! Element kernels into the reduced matrix.

use std::sync::Arc;

use numpy::{PyArray1, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray1, ToPyArray};
use pyo3::prelude::*;

use super::grid::PyLocation;
use super::require;
use crate::adjoint::{Densities, MAX_POINTS};
use crate::assembly::{self, Cells, Kernel, Selection, Slot, TabulateTensor};
use crate::grid::Location;
use crate::quadrature::Rule;

/// Particle data of one rule, and at which points: indices along x and y, or none for cell means.
type Source<'py> = (PyReadonlyArray2<'py, f64>, Vec<[usize; 2]>, Vec<usize>);

/// Address of an FFCx kernel, its coefficients in packed order (none stands for the fields), and its
/// constants.
type KernelOf<'py> = (usize, Vec<Option<Source<'py>>>, Vec<f64>);

/// Element kernels over the cells with particles; see `assembly.rs`.
#[pyclass(name = "Assembler", frozen)]
pub(super) struct PyAssembler {
    location: Arc<Location>,
    cells: Cells,
    rules: Vec<Rule>,
}

impl PyAssembler {
    fn kernels<'a>(&'a self, kernels: &'a [KernelOf]) -> PyResult<Vec<Kernel<'a>>> {
        let slot = |source: &'a Option<Source>| -> PyResult<Slot<'a>> {
            let Some((data, points, columns)) = source else { return Ok(Slot::Fields) };
            let data = data.as_array();
            require(data.nrows() == self.location.len(), "particle data of other particles")?;
            require(columns.iter().all(|&c| c < data.ncols()) && !columns.is_empty(), "columns")?;
            if points.is_empty() {
                return Ok(Slot::Means(columns, data));
            }
            let n = (points.len() as f64).sqrt().round() as usize;
            require((1..self.rules.len()).contains(&n) && n * n == points.len(), "not a rule")?;
            require(points.iter().flatten().all(|&i| i < n), "not a tensor rule")?;
            Ok(Slot::Densities(Densities { rule: &self.rules[n], points, columns }, data))
        };
        kernels
            .iter()
            .map(|(address, slots, constants)| {
                require(*address != 0, "kernel without an address")?;
                // SAFETY: the address is that of an FFCx kernel, which Python keeps loaded.
                let tabulate = unsafe {
                    std::mem::transmute::<*const (), TabulateTensor>(*address as *const ())
                };
                let slots = slots.iter().map(slot).collect::<PyResult<_>>()?;
                Ok(Kernel { tabulate, slots, constants: constants.clone() })
            })
            .collect()
    }

    fn coefficients<'a>(&self, coefficients: &'a PyReadonlyArray1<f64>) -> PyResult<&'a [f64]> {
        let coefficients = coefficients.as_slice()?;
        let expected = self.cells.coefficients(self.location.grid.cells);
        require(coefficients.len() == expected, "wrong number of grid coefficients")?;
        Ok(coefficients)
    }

    fn selection<'a>(
        &self,
        (start, unknown, weight, unknowns): &'a SelectionOf,
    ) -> PyResult<Selection<'a>> {
        let (start, unknown) = (start.as_slice()?, unknown.as_slice()?);
        let selection = Selection {
            start,
            unknown,
            weight: weight.as_slice()?,
            unknowns: unknowns.as_slice()?,
        };
        let rows = self.cells.coefficients(self.location.grid.cells);
        let inside = |&u: &i32| u >= 0 && (u as usize) < selection.unknowns.len();
        let fits = start.len() == rows + 1
            && start.windows(2).all(|w| 0 <= w[0] && w[0] <= w[1])
            && start[rows] as usize == unknown.len()
            && unknown.len() == selection.weight.len()
            && unknown.iter().all(inside);
        require(fits, "not a selection of these coefficients")?;
        Ok(selection)
    }
}

/// Starts, unknowns and weights of the compressed rows of S, and the coefficient of each unknown.
type SelectionOf<'py> = (
    PyReadonlyArray1<'py, i32>,
    PyReadonlyArray1<'py, i32>,
    PyReadonlyArray1<'py, f64>,
    PyReadonlyArray1<'py, i64>,
);

#[pymethods]
impl PyAssembler {
    #[new]
    fn new(
        location: &PyLocation,
        basis: &str,
        nodes: [[usize; 2]; 9],
        vertices: [[usize; 2]; 4],
        bilinear: bool,
    ) -> PyResult<Self> {
        require(nodes.iter().flatten().all(|&p| p < 3), "nodes of a cell")?;
        require(vertices.iter().flatten().all(|&p| p < 2), "vertices of a cell")?;
        let cells = Cells { basis: basis.parse()?, nodes, vertices, bilinear };
        let rules = (0..=MAX_POINTS).map(Rule::gauss).collect();
        Ok(Self { location: Arc::clone(&location.0), cells, rules })
    }

    /// The form's vector on all coefficients.
    fn vector<'py>(
        &self,
        py: Python<'py>,
        kernels: Vec<KernelOf>,
        volume: PyReadonlyArray1<f64>,
        coefficients: PyReadonlyArray1<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let volume = volume.as_slice()?;
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        let kernels = self.kernels(&kernels)?;
        let coefficients = self.coefficients(&coefficients)?;
        let sums = assembly::vector(&self.cells, &kernels, &self.location, volume, coefficients);
        Ok(sums.to_pyarray(py))
    }

    /// Compressed rows of the reduced matrix: starts and columns.
    #[allow(clippy::type_complexity)]
    fn pattern<'py>(
        &self,
        py: Python<'py>,
        selection: SelectionOf,
    ) -> PyResult<(Bound<'py, PyArray1<i32>>, Bound<'py, PyArray1<i32>>)> {
        let selection = self.selection(&selection)?;
        let (start, columns) = assembly::pattern(&self.cells, &self.location, &selection);
        Ok((start.to_pyarray(py), columns.to_pyarray(py)))
    }

    /// Fill the values of the reduced matrix in its pattern.
    #[allow(clippy::too_many_arguments)]
    fn matrix(
        &self,
        kernels: Vec<KernelOf>,
        volume: PyReadonlyArray1<f64>,
        coefficients: PyReadonlyArray1<f64>,
        selection: SelectionOf,
        start: PyReadonlyArray1<i32>,
        columns: PyReadonlyArray1<i32>,
        mut values: PyReadwriteArray1<f64>,
    ) -> PyResult<()> {
        let volume = volume.as_slice()?;
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        let (start, columns, values) =
            (start.as_slice()?, columns.as_slice()?, values.as_slice_mut()?);
        let selection = self.selection(&selection)?;
        let fits = start.len() == selection.unknowns.len() + 1
            && start.windows(2).all(|w| 0 <= w[0] && w[0] <= w[1])
            && start[start.len() - 1] as usize == columns.len()
            && columns.len() == values.len();
        require(fits, "not the pattern of this selection")?;
        let kernels = self.kernels(&kernels)?;
        let coefficients = self.coefficients(&coefficients)?;
        assembly::matrix(
            &self.cells,
            &kernels,
            &self.location,
            volume,
            coefficients,
            &selection,
            (start, columns),
            values,
        );
        Ok(())
    }
}
