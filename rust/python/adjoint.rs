//! Particle data as densities of packed arrays, and sums over functions.

use ndarray::ArrayView2;
use numpy::{PyArray2, ToPyArray};
use pyo3::prelude::*;

use super::array::{Read1, Read2, Write2};
use super::grid::PyLocation;
use super::require;
use crate::adjoint::{self, Densities};
use crate::grid::Location;
use crate::quadrature::Rule;

/// Points per axis of the tensor rule that `points` are of, 0 where there are none (means over cells),
/// once `data` is known to be of these particles and to have the columns.
pub(super) fn points_per_axis(
    location: &Location,
    data: &ArrayView2<f64>,
    points: &[[usize; 2]],
    columns: &[usize],
) -> PyResult<usize> {
    require(data.nrows() == location.len(), "data of other particles")?;
    require(columns.iter().all(|&c| c < data.ncols()) && !columns.is_empty(), "columns")?;
    let n = (points.len() as f64).sqrt().round() as usize;
    let tensor = n * n == points.len() && points.iter().flatten().all(|&i| i < n);
    require(tensor && n <= adjoint::MAX_POINTS, "not a tensor rule")?;
    Ok(n)
}

/// Densities of particle data in the rows of a packed coefficient array; see `adjoint.rs`.
/// `points` holds the indices along x and y of each quadrature point (Gauss, or the vertices); none
/// asks for the mean over the particles of a cell instead.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(super) fn densities(
    location: &PyLocation,
    volume: Read1<f64>,
    data: Read2<f64>,
    points: Vec<[usize; 2]>,
    vertices: bool,
    rows: Read1<u32>,
    columns: Vec<usize>,
    offset: usize,
    mut out: Write2<f64>,
) -> PyResult<()> {
    let location = &location.0;
    let (volume, data, rows) = (volume.as_slice()?, data.as_array(), rows.as_slice()?);
    let (height, width) = (out.as_array().nrows(), out.as_array().ncols());
    let out = out.as_slice_mut()?;
    let per_axis = points_per_axis(location, &data, &points, &columns)?;
    require(volume.len() == location.len(), "volumes of other particles")?;
    require(height == rows.len(), "packed array of other cells")?;
    require(rows.iter().all(|&r| (r as usize) < location.active.len()), "row of no active cell")?;
    let length = points.len().max(1) * columns.len();
    let end = offset.checked_add(length);
    require(end.is_some_and(|end| end <= width), "packed array too narrow")?;
    if per_axis == 0 {
        adjoint::pack(rows, (offset, length), width, out, |a, row| {
            adjoint::cell_mean(location, a, volume, data, &columns, row);
        });
    } else {
        require(!vertices || per_axis == 2, "a cell has two vertices along each axis")?;
        let rule = if vertices { Rule::ends() } else { Rule::gauss(per_axis) };
        let densities = Densities { rule: &rule, points: &points, columns: &columns };
        adjoint::pack(rows, (offset, length), width, out, |a, row| {
            densities.of_cell(location, a, volume, data, row);
        });
    }
    Ok(())
}

/// `sum_p V_p D_p N_i(x_p)` over the functions of a basis: functions x columns.
#[pyfunction]
pub(super) fn nodal_sums<'py>(
    py: Python<'py>,
    location: &PyLocation,
    volume: Read1<f64>,
    data: Read2<f64>,
    basis: &str,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (volume, data) = (volume.as_slice()?, data.as_array());
    require(data.nrows() == location.0.len() && volume.len() == location.0.len(), "particle data")?;
    Ok(adjoint::nodal_sums(&location.0, volume, data, basis.parse()?).to_pyarray(py))
}
