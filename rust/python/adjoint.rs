//! Particle data as densities of packed arrays, and sums over functions.

use numpy::{PyArray2, PyReadonlyArray1, PyReadonlyArray2, PyReadwriteArray2, ToPyArray};
use pyo3::prelude::*;

use super::grid::PyLocation;
use super::require;
use crate::adjoint::{self, Densities};
use crate::quadrature::Rule;

/// Densities of particle data in the rows of a packed coefficient array; see `adjoint.rs`.
/// `points` holds the indices along x and y of each quadrature point; `mean` asks for the mean
/// over the particles of a cell instead.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(super) fn densities(
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
    let (height, width) = (out.as_array().nrows(), out.as_array().ncols());
    let out = out.as_slice_mut()?;
    require(data.nrows() == location.len() && volume.len() == location.len(), "particle data")?;
    require(height == rows.len(), "packed array of other cells")?;
    require(rows.iter().all(|&r| (r as usize) < location.active.len()), "row of no active cell")?;
    require(columns.iter().all(|&c| c < data.ncols()) && !columns.is_empty(), "columns")?;
    require(offset + points.len() * columns.len() <= width, "packed array too narrow")?;
    let per_axis = (points.len() as f64).sqrt().round() as usize;
    let tensor = per_axis * per_axis == points.len();
    require(tensor && points.iter().flatten().all(|&i| i < per_axis), "not a tensor rule")?;
    require(per_axis <= adjoint::MAX_POINTS, "too many points")?;
    if mean {
        adjoint::pack(rows, (offset, columns.len()), width, out, |a, row| {
            adjoint::cell_mean(location, a, volume, data, &columns, row);
        });
    } else {
        let rule = Rule::gauss(per_axis);
        let densities = Densities { rule: &rule, points: &points, columns: &columns };
        adjoint::pack(rows, (offset, densities.len()), width, out, |a, row| {
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
    volume: PyReadonlyArray1<f64>,
    data: PyReadonlyArray2<f64>,
    basis: &str,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (volume, data) = (volume.as_slice()?, data.as_array());
    require(data.nrows() == location.0.len() && volume.len() == location.0.len(), "particle data")?;
    Ok(adjoint::nodal_sums(&location.0, volume, data, basis.parse()?).to_pyarray(py))
}
