//! The grid, where points are in it, and its bases.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, ToPyArray};
use pyo3::prelude::*;

use super::array::{Read1, Read2};
use super::require;
use super::threads::detached;
use crate::error::Error;
use crate::grid::{products, Active, Basis, Functions, Grid, Location, Rule, Search, MAX_CELLS};
use crate::space::{count, index_of, Index, Point, DIM, FUNCTIONS_1D};

/// Most points of a Gauss rule; the time to make one grows with their square.
const MAX_GAUSS: usize = 1000;

#[pyclass(name = "Grid", frozen)]
pub(super) struct PyGrid(pub(super) Grid);

#[pymethods]
impl PyGrid {
    #[new]
    #[pyo3(signature = (origin, h, cells, geometry = "plane_strain"))]
    fn new(origin: Point, h: f64, cells: Index, geometry: &str) -> PyResult<Self> {
        Ok(Self(Grid::new(origin, h, cells)?.with(geometry.parse()?)?))
    }

    /// A part of the grid, given by its first cell along each axis and its numbers of cells.
    fn window(&self, first: Index, cells: Index) -> PyResult<Self> {
        let n = self.0.cells;
        let inside =
            (0..DIM).all(|k| cells[k] > 0 && first[k] < n[k] && cells[k] <= n[k] - first[k]);
        require(inside, "a part beyond the grid")?;
        Ok(Self(self.0.window(first, cells)))
    }

    /// Cells of points [m] and positions in them.
    fn locate(&self, py: Python, x: Read2<f64>) -> PyResult<PyLocation> {
        let x = points(&x)?;
        Ok(PyLocation(Arc::new(detached(py, || self.0.locate(&x))?)))
    }

    /// Points of known cells, at positions in them that may lie outside: points x 2.
    fn place(&self, cell: Read1<u32>, xi: Read2<f64>) -> PyResult<PyLocation> {
        let (cell, xi) = (cell.as_slice()?, points(&xi)?);
        require(cell.len() == xi.len(), "cells and positions differ in number")?;
        let inside = cell.iter().all(|&c| (c as usize) < self.0.num_cells());
        require(inside, "a cell outside the grid")?;
        Ok(PyLocation(Arc::new(Location::new(self.0, cell.to_vec(), xi))))
    }

    /// Points [m] in known cells, which they may lie outside of.
    fn place_at(&self, cell: Read1<i64>, x: Read2<f64>) -> PyResult<PyLocation> {
        let (cell, mut x) = (cell.as_slice()?, points(&x)?);
        require(cell.len() == x.len(), "cells and positions differ in number")?;
        let inside = cell.iter().all(|&c| usize::try_from(c).is_ok_and(|c| c < self.0.num_cells()));
        require(inside, "a cell outside the grid")?;
        let cell: Vec<u32> = cell.iter().map(|&c| c as u32).collect();
        for (x, &c) in x.iter_mut().zip(&cell) {
            let index = self.0.cell_index(c as usize);
            for axis in 0..DIM {
                let scaled = (x[axis] - self.0.origin[axis]) / self.0.h;
                x[axis] = scaled - self.0.first[axis] as f64 - index[axis] as f64;
            }
        }
        Ok(PyLocation(Arc::new(Location::new(self.0, cell, x))))
    }

    /// Cells in the whole grid of points on a border, -1 for those in cells that are not treated here, and
    /// whether no cell near each holds particles; see `grid/near.rs`.
    #[allow(clippy::too_many_arguments, clippy::type_complexity)]
    fn near<'py>(
        &self,
        py: Python<'py>,
        whole: Index,
        active: Read1<bool>,
        own: Read1<bool>,
        x: Read2<f64>,
        normal: Read2<f64>,
        inward: f64,
        reach: usize,
    ) -> PyResult<(Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<bool>>)> {
        let (active, own, x, normal) =
            (active.as_slice()?, own.as_slice()?, points(&x)?, points(&normal)?);
        require(x.len() == normal.len(), "positions and normals differ in number")?;
        let cells = self.0.num_cells();
        require(active.len() == cells && own.len() == cells, "masks of other cells")?;
        require((0..DIM).all(|k| whole[k] > 0 && whole[k] <= MAX_CELLS), "an empty grid")?;
        require(reach <= MAX_CELLS, "a search beyond the grid")?;
        let search = Search { whole, active, own, inward, reach };
        let found = self.0.near(&search, &x, &normal);
        let (cell, lost): (Vec<_>, Vec<_>) =
            found.into_iter().map(|(cell, lost)| (cell.map_or(-1, i64::from), lost)).unzip();
        Ok((cell.to_pyarray(py), lost.to_pyarray(py)))
    }
}

/// Rows of positions as points.
pub(super) fn points(x: &Read2<f64>) -> PyResult<Vec<Point>> {
    let x = x.as_array();
    if x.ncols() != DIM {
        let expected = format!("(points, {DIM})");
        return Err(Error::Shape { name: "x", got: x.shape().to_vec(), expected }.into());
    }
    Ok(x.outer_iter().map(|x| std::array::from_fn(|axis| x[axis])).collect())
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
        self.0.xi.as_flattened().to_pyarray(py).reshape([self.0.len(), DIM])
    }

    fn __len__(&self) -> usize {
        self.0.len()
    }

    /// The same location, at least a part of a cell (up to a half) away from the sides of the cells.
    fn away_from_sides(&self, margin: f64) -> PyResult<Self> {
        require((0.0..=0.5).contains(&margin), "a margin beyond half a cell")?;
        Ok(Self(Arc::new((*self.0).clone().away_from_sides(margin))))
    }

    /// Location of some of the particles.
    fn select(&self, particles: Read1<u32>) -> PyResult<Self> {
        let particles = particles.as_slice()?;
        let inside = particles.iter().all(|&p| (p as usize) < self.0.len());
        require(inside, "a selection of other particles")?;
        Ok(Self(Arc::new(self.0.select(particles))))
    }
}

/// The active cells and the functions on them; see `grid/active.rs`.
#[pyclass(name = "Active", frozen)]
pub(super) struct PyActive(Active, Grid);

impl PyActive {
    fn functions_of(&self, basis: Basis) -> usize {
        Functions { basis, cells: self.1.cells }.len()
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

    /// Number of parts of the body that share no function, and the part of each cell, -1 for inactive cells.
    fn parts<'py>(
        &self,
        py: Python<'py>,
        basis: &str,
    ) -> PyResult<(usize, Bound<'py, PyArray1<i64>>)> {
        let (number, of_cells) = self.0.parts(basis.parse()?);
        Ok((number, of_cells.to_pyarray(py)))
    }

    /// For each function, the value of one of its active cells; -1 if it has none.
    fn spread<'py>(
        &self,
        py: Python<'py>,
        basis: &str,
        of_cells: Read1<i64>,
    ) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let of_cells = of_cells.as_slice()?;
        require(of_cells.len() == self.1.num_cells(), "values of other cells")?;
        Ok(self.0.spread(basis.parse()?, of_cells, -1).to_pyarray(py))
    }

    /// The active cells in the support of a function, by their positions along the axes: cells x 2.
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
        flat.to_pyarray(py).reshape([cells.len(), DIM])
    }
}

/// Functions of a basis on a row of `n` cells at positions `t` in `cell`: number of the first one, and the
/// values of up to three.
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
    let mut values = Vec::with_capacity(FUNCTIONS_1D * t.len());
    for (&c, &s) in cell.iter().zip(&t) {
        let local = basis.at(n, c as usize, s);
        first.push(local.first as i64);
        values.extend(local.value);
    }
    Ok((first.to_pyarray(py), values.to_pyarray(py).reshape([t.len(), FUNCTIONS_1D])?))
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

/// Extraction of cells of a grid of `size` cells: the functions that do not vanish on each cell (cells x
/// functions), and their values at nodes, given by positions 0 to 1 in the cell (cells x nodes x functions).
#[pyfunction]
#[allow(clippy::type_complexity)]
pub(super) fn extraction<'py>(
    py: Python<'py>,
    basis: &str,
    size: Index,
    cells: Read1<i64>,
    nodes: Read2<f64>,
) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray3<f64>>)> {
    let functions = Functions { basis: basis.parse()?, cells: size };
    let sound = size.iter().all(|n| (1..=MAX_CELLS).contains(n));
    require(sound, "more cells than a grid has")?;
    let (cells, nodes) = (cells.as_array(), points(&nodes)?);
    let inside = |&c: &i64| c >= 0 && (c as usize) < count(size);
    require(cells.iter().all(inside), "a cell outside the grid")?;
    let width = functions.per_cell();
    let mut numbers = Vec::with_capacity(cells.len() * width);
    let mut values = Vec::with_capacity(cells.len() * nodes.len() * width);
    for cell in cells.iter().map(|&c| index_of(c as usize, size)) {
        numbers.extend(functions.on_cell(cell).iter().map(|&f| f as i64));
        for &xi in &nodes {
            values.extend_from_slice(&functions.values(cell, xi)[..width]);
        }
    }
    let shape = [cells.len(), nodes.len(), width];
    let numbers = numbers.to_pyarray(py).reshape([cells.len(), width])?;
    Ok((numbers, values.to_pyarray(py).reshape(shape)?))
}

/// Functions of a basis at points: the numbers of those on the cell of each point (points x functions), their
/// values, and their gradients [1/m] (points x functions x 2).
#[pyfunction]
#[allow(clippy::type_complexity)]
pub(super) fn functions_at<'py>(
    py: Python<'py>,
    location: &PyLocation,
    basis: &str,
) -> PyResult<(Bound<'py, PyArray2<i64>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray3<f64>>)> {
    let location = &*location.0;
    let functions = Functions { basis: basis.parse()?, cells: location.grid.cells };
    let (n, width) = (location.len(), functions.per_cell());
    let mut numbers = Vec::with_capacity(n * width);
    let mut values = Vec::with_capacity(n * width);
    let mut gradients = Vec::with_capacity(n * width * DIM);
    for p in 0..n {
        let cell = location.cell_of(p);
        numbers.extend(functions.on_cell(cell).iter().map(|&f| f as i64));
        let along = functions.at(cell, location.xi[p]);
        values.extend_from_slice(&functions.values(cell, location.xi[p])[..width]);
        let slopes: [_; DIM] = std::array::from_fn(|axis| {
            let mut factors = along.each_ref().map(|local| &local.value);
            factors[axis] = &along[axis].derivative;
            products(factors, functions.basis.per_cell())
        });
        for f in 0..width {
            gradients.extend(slopes.iter().map(|slope| slope[f] / location.grid.h));
        }
    }
    Ok((
        numbers.to_pyarray(py).reshape([n, width])?,
        values.to_pyarray(py).reshape([n, width])?,
        gradients.to_pyarray(py).reshape([n, width, DIM])?,
    ))
}
