//! Fields at the particles; particle data as densities, and as sums over functions and cells.

use ndarray::ArrayView2;
use numpy::{PyArray2, PyArrayMethods, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;

use super::array::{Read1, Read2, Write2};
use super::grid::{points, PyLocation};
use super::require;
use super::threads::detached;
use crate::grid::{Basis, Functions, Grid, Location, Rule, MAX_POINTS};
use crate::particles::kinematics::gradient;
use crate::space::{Index, Point, DIM};
use crate::transfer::border::carry;
use crate::transfer::cells::{cell_sums as sums_of_cells, mean_of_cell};
use crate::transfer::densities::{pack, Densities};
use crate::transfer::to_grid::nodal_sums as sums_of_functions;
use crate::transfer::to_particles::Field;

pub(super) fn field<'a, const C: usize>(
    grid: Grid,
    basis: Basis,
    coefficients: &'a Read1<f64>,
) -> PyResult<Field<'a, C>> {
    let coefficients = coefficients.as_slice()?;
    let expected = C * Functions { basis, cells: grid.cells }.len();
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
    let (basis, location) = (basis.parse()?, &*location.0);
    let values = match components {
        1 => {
            let field = field::<1>(location.grid, basis, &coefficients)?;
            detached(py, || field.at_particles(location)).into_flattened()
        }
        DIM => {
            let field = field::<DIM>(location.grid, basis, &coefficients)?;
            detached(py, || field.at_particles(location)).into_flattened()
        }
        _ => return Err(PyRuntimeError::new_err("internal: components of no field")),
    };
    values.to_pyarray(py).reshape([location.len(), components])
}

/// Gradients of a displacement at points, row by row (d u_x/dx, d u_x/dy, ...): points x 4. In axisymmetry
/// the tensor has a third row with the hoop strain: points x 9.
#[pyfunction]
pub(super) fn gradients<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
    coefficients: Read1<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let location = &*location.0;
    let u = field::<DIM>(location.grid, basis.parse()?, &coefficients)?;
    let geometry = location.grid.geometry;
    let width = geometry.tensor();
    let mut gradients = vec![0.0; location.len() * width];
    detached(py, || {
        gradients.par_chunks_exact_mut(width).enumerate().for_each(|(p, row)| {
            gradient(&u, location.cell_of(p), location.xi[p]).write(geometry, row);
        });
    });
    gradients.to_pyarray(py).reshape([location.len(), width])
}

/// Positions [m] and outward normals times areas of points on a border after a displacement, points x 2
/// each; lost points stay. See `transfer/border.rs`.
#[pyfunction]
#[allow(clippy::too_many_arguments, clippy::type_complexity)]
pub(super) fn carried<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
    coefficients: Read1<f64>,
    x: Read2<f64>,
    area: Read2<f64>,
    lost: Read1<bool>,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<f64>>)> {
    let location = &*location.0;
    let u = field::<DIM>(location.grid, basis.parse()?, &coefficients)?;
    let (mut x, mut area, lost) = (points(&x)?, points(&area)?, lost.as_slice()?);
    let n = location.len();
    require(x.len() == n && area.len() == n && lost.len() == n, "points of another border")?;
    carry(&u, location, lost, &mut x, &mut area);
    let array = |points: Vec<Point>| points.as_flattened().to_pyarray(py).reshape([n, DIM]);
    Ok((array(x)?, array(area)?))
}

/// Points per axis of a tensor rule with these points; 0 for means over cells, which have no points.
fn points_per_axis(points: &[Index], vertices: bool) -> PyResult<usize> {
    let most = (0..=MAX_POINTS).find(|n| n.pow(DIM as u32) == points.len());
    let tensor = most.filter(|&n| points.iter().flatten().all(|&i| i < n));
    let Some(n) = tensor else {
        return Err(PyRuntimeError::new_err("internal: not a tensor rule (please report this)"));
    };
    require(!vertices || n == 2, "a cell has two vertices along each axis")?;
    Ok(n)
}

/// Check that particle data belong to these particles and have the columns.
pub(super) fn check_data(
    location: &Location,
    data: &ArrayView2<f64>,
    columns: &[usize],
) -> PyResult<()> {
    require(data.nrows() == location.len(), "data of other particles")?;
    require(columns.iter().all(|&c| c < data.ncols()) && !columns.is_empty(), "columns")
}

/// Densities of particle data in the rows of a packed coefficient array; see `transfer/densities.rs`.
/// `points` holds the position along each axis of each quadrature point (Gauss, or the vertices). Without
/// points the packed numbers are the means over the particles of a cell.
#[pyfunction]
#[allow(clippy::too_many_arguments)]
pub(super) fn densities(
    py: Python,
    location: &PyLocation,
    volume: Read1<f64>,
    data: Read2<f64>,
    points: Vec<Index>,
    vertices: bool,
    rows: Read1<u32>,
    columns: Vec<usize>,
    offset: usize,
    mut out: Write2<f64>,
) -> PyResult<()> {
    let location = &*location.0;
    let (volume, data, rows) = (volume.as_slice()?, data.as_array(), rows.as_slice()?);
    let (height, width) = (out.as_array().nrows(), out.as_array().ncols());
    let out = out.as_slice_mut()?;
    let per_axis = points_per_axis(&points, vertices)?;
    check_data(location, &data, &columns)?;
    require(volume.len() == location.len(), "volumes of other particles")?;
    require(height == rows.len(), "packed array of other cells")?;
    require(rows.iter().all(|&r| (r as usize) < location.active.len()), "row of no active cell")?;
    let length = points.len().max(1) * columns.len();
    let end = offset.checked_add(length);
    require(end.is_some_and(|end| end <= width), "packed array too narrow")?;
    let place = (offset, length);
    detached(py, || {
        if per_axis == 0 {
            return pack(rows, place, width, out, |a, row| {
                mean_of_cell(location, a, volume, data, &columns, row);
            });
        }
        let rule = if vertices { Rule::ends() } else { Rule::gauss(per_axis) };
        let densities = Densities { rule: &rule, points: &points, columns: &columns };
        pack(rows, place, width, out, |a, row| {
            densities.of_cell(location, a, volume, data, row);
        });
    });
    Ok(())
}

/// `sum_p w_p D_p N_i(x_p)` over the functions of a basis, or with their squares: functions x columns.
#[pyfunction]
#[pyo3(signature = (location, weight, data, basis, squared = false))]
pub(super) fn nodal_sums<'py>(
    py: Python<'py>,
    location: &PyLocation,
    weight: Read1<f64>,
    data: Read2<f64>,
    basis: &str,
    squared: bool,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (weight, data) = particle_data(location, &weight, &data)?;
    let basis = basis.parse()?;
    Ok(detached(py, || sums_of_functions(&location.0, weight, data, basis, squared)).to_pyarray(py))
}

/// `sum_p w_p D_p` over the particles of each cell of the grid: cells x columns.
#[pyfunction]
pub(super) fn cell_sums<'py>(
    py: Python<'py>,
    location: &PyLocation,
    weight: Read1<f64>,
    data: Read2<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (weight, data) = particle_data(location, &weight, &data)?;
    Ok(detached(py, || sums_of_cells(&location.0, weight, data)).to_pyarray(py))
}

fn particle_data<'a>(
    location: &PyLocation,
    weight: &'a Read1<f64>,
    data: &'a Read2<f64>,
) -> PyResult<(&'a [f64], ArrayView2<'a, f64>)> {
    let (weight, data, n) = (weight.as_slice()?, data.as_array(), location.0.len());
    require(data.nrows() == n && weight.len() == n, "particle data")?;
    Ok((weight, data))
}
