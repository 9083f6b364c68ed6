//! Element kernels into the reduced matrix.

use std::sync::Arc;

use numpy::{PyArray1, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use super::adjoint::points_per_axis;
use super::array::{Read1, Read2, Write1};
use super::grid::PyLocation;
use super::{require, view, InputError};
use crate::adjoint::{Densities, MAX_POINTS};
use crate::assembly::{self, Bilinear, Cells, Kernel, Pattern, Selection, Slot, TabulateTensor};
use crate::grid::Location;
use crate::quadrature::Rule;

/// Particle data of one rule, at which points (indices along x and y, or none for cell means), whether
/// these are the vertices rather than Gauss points, and which columns.
type Source<'py> = (Read2<'py, f64>, Vec<[usize; 2]>, bool, Vec<usize>);

/// Address of an FFCx kernel, its rank, the number of its packed coefficients, these in packed order
/// (none stands for the fields), and its constants.
type KernelOf<'py> = (usize, usize, usize, Vec<Option<Source<'py>>>, Vec<f64>);

/// Element kernels over the cells with particles; see `rust/assembly`.
#[pyclass(name = "Assembler", frozen)]
pub(super) struct PyAssembler {
    location: Arc<Location>,
    cells: Cells,
    rules: Vec<Rule>,
    ends: Rule,
}

impl PyAssembler {
    fn kernels<'a>(&'a self, rank: usize, kernels: &'a [KernelOf]) -> PyResult<Vec<Kernel<'a>>> {
        let slot = |source: &'a Option<Source>| -> PyResult<Slot<'a>> {
            let Some((data, points, vertices, columns)) = source else { return Ok(Slot::Fields) };
            let data = data.as_array();
            let per_axis = points_per_axis(&self.location, &data, points, columns)?;
            require(!vertices || per_axis == 2, "a cell has two vertices along each axis")?;
            let rule = if *vertices { &self.ends } else { &self.rules[per_axis] };
            Ok(match per_axis {
                0 => Slot::Means(columns, data),
                _ => Slot::Densities(Densities { rule, points, columns }, data),
            })
        };
        kernels
            .iter()
            .map(|(address, its_rank, width, slots, constants)| {
                require(*address != 0 && *its_rank == rank, "a kernel of another rank")?;
                // SAFETY: the address is that of an FFCx kernel, which `compilation.Integral` keeps
                // loaded; rank and number of coefficients are checked against what it says of it.
                let tabulate = unsafe {
                    std::mem::transmute::<*const (), TabulateTensor>(*address as *const ())
                };
                let slots = slots.iter().map(slot).collect::<PyResult<Vec<_>>>()?;
                let packed: usize = slots.iter().map(|slot| slot.len(&self.cells)).sum();
                require(packed == *width, "a kernel of other coefficients")?;
                Ok(Kernel { tabulate, slots, constants: constants.clone() })
            })
            .collect()
    }

    fn coefficients<'a>(&self, coefficients: &'a Read1<f64>) -> PyResult<&'a [f64]> {
        let coefficients = coefficients.as_slice()?;
        let expected = self.cells.coefficients(self.location.grid.cells);
        require(coefficients.len() == expected, "wrong number of grid coefficients")?;
        Ok(coefficients)
    }
}

/// Starts, unknowns and weights of the compressed rows of S, and the coefficient of each unknown.
type SelectionOf<'py> = (Read1<'py, i32>, Read1<'py, i32>, Read1<'py, f64>, Read1<'py, i64>);

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
        Ok(Self { location: Arc::clone(&location.0), cells, rules, ends: Rule::ends() })
    }

    /// The form's vector on all coefficients.
    fn vector<'py>(
        &self,
        py: Python<'py>,
        kernels: Vec<KernelOf>,
        volume: Read1<f64>,
        coefficients: Read1<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let volume = volume.as_slice()?;
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        let kernels = self.kernels(1, &kernels)?;
        let coefficients = self.coefficients(&coefficients)?;
        // SAFETY: kernels as in `kernels`, of rank 1; the coefficients' number was checked.
        let sums = unsafe {
            assembly::vector(&self.cells, &kernels, &self.location, volume, coefficients)
        };
        Ok(sums.to_pyarray(py))
    }

    /// Pattern of the reduced matrix for a selection.
    fn pattern(&self, selection: SelectionOf) -> PyResult<PyPattern> {
        let (start, unknown, weight, coefficient) = &selection;
        let (start, unknown) = (start.as_slice()?.to_vec(), unknown.as_slice()?.to_vec());
        let (weight, coefficient) = (weight.as_slice()?.to_vec(), coefficient.as_slice()?.to_vec());
        let count = self.cells.coefficients(self.location.grid.cells);
        let Some(selection) = Selection::new(count, start, unknown, weight, coefficient) else {
            return Err(PyRuntimeError::new_err(
                "internal: not a selection of these coefficients (please report this)",
            ));
        };
        let Some(pattern) = assembly::pattern(&self.cells, &self.location, &selection) else {
            return Err(InputError::new_err(
                "the reduced matrix has more than 2147483647 entries: expected a coarser grid",
            ));
        };
        Ok(PyPattern { location: Arc::clone(&self.location), selection, pattern })
    }

    /// Fill the values of the reduced matrix in its pattern; `couplings` are pairs of rank 1.
    #[allow(clippy::too_many_arguments)]
    fn matrix(
        &self,
        kernels: Vec<KernelOf>,
        couplings: Vec<[KernelOf; 2]>,
        volume: Read1<f64>,
        coefficients: Read1<f64>,
        pattern: &PyPattern,
        mut values: Write1<f64>,
    ) -> PyResult<()> {
        let (volume, values) = (volume.as_slice()?, values.as_slice_mut()?);
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        let mine = Arc::ptr_eq(&pattern.location, &self.location);
        require(mine && values.len() == pattern.pattern.columns.len(), "another pattern")?;
        let pair = |pair| -> PyResult<[Kernel; 2]> {
            let kernels = self.kernels(1, pair)?;
            kernels.try_into().map_err(|_| PyRuntimeError::new_err("internal: not a pair"))
        };
        let couplings = couplings.iter().map(|p| pair(p)).collect::<PyResult<_>>()?;
        let form = Bilinear { kernels: self.kernels(2, &kernels)?, couplings };
        let coefficients = self.coefficients(&coefficients)?;
        // SAFETY: kernels as in `kernels`, of the ranks asked for; the pattern is one that `assembly::pattern`
        // made of this location, and the lengths were checked.
        let fits = unsafe {
            assembly::matrix(
                &self.cells,
                &form,
                &self.location,
                volume,
                coefficients,
                &pattern.selection,
                &pattern.pattern,
                values,
            )
        };
        require(fits, "not the pattern of this matrix")
    }
}

/// Compressed rows of the reduced matrix of one selection.
#[pyclass(name = "Pattern", frozen)]
pub(super) struct PyPattern {
    location: Arc<Location>,
    selection: Selection,
    pattern: Pattern,
}

#[pymethods]
impl PyPattern {
    /// Start of each row; one more than rows.
    #[getter]
    fn start<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<i32>>> {
        view(|p: &Self| &p.pattern.start, slf)
    }

    /// Columns of the rows, ascending.
    #[getter]
    fn columns<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<i32>>> {
        view(|p: &Self| &p.pattern.columns, slf)
    }
}
