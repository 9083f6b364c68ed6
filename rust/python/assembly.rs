//! Element kernels into the reduced matrix.

use std::sync::Arc;

use ndarray::ArrayView2;
use numpy::{PyArray1, ToPyArray};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use super::array::{Read1, Read2, Write1};
use super::grid::PyLocation;
use super::threads::detached;
use super::transfer::check_data;
use super::{require, view, InputError};
use crate::assembly::{
    self, Bilinear, Cells, Entries, Entry, Field, Kernel, Kernels, Pattern, Place, PointKernel,
    PointSlot, Reference, Selection, Slot, State, TabulateTensor,
};
use crate::grid::{Grid, Location};
use crate::space::{Index, DIM, NODES, NODES_1D, VERTICES};

/// Coefficient of a kernel.
#[derive(FromPyObject)]
enum SlotOf {
    /// `fields`, or `position`.
    Name(String),
    /// Number of the array of particle data, whether it is its means over cells, and columns.
    Data(usize, bool, Vec<usize>),
}

/// Component of the fields and axes of its derivatives.
type EntryOf = (usize, Vec<usize>);

/// Place of a point kernel, and the entries of the fields, of the rows and of the columns.
type PointOf = (String, Vec<EntryOf>, Vec<EntryOf>, Vec<EntryOf>);

/// Owner of an FFCx kernel, its address, its rank, the number of its packed coefficients, these in packed
/// order, its constants, whether it reads the position, and its points; without them it is one of cells.
type KernelOf = (Py<PyAny>, usize, usize, usize, Vec<SlotOf>, Vec<f64>, bool, Option<PointOf>);

/// A kernel and where its coefficients come from.
struct Plan {
    /// Keeps the code loaded.
    _owner: Py<PyAny>,
    tabulate: TabulateTensor,
    slots: Vec<Source>,
    constants: Vec<f64>,
    reads_position: bool,
    point: Option<(Place, Entries)>,
}

/// Where the coefficients of a kernel come from.
enum Source {
    /// Values of the fields.
    Fields,
    /// Position of a point.
    Position,
    /// Columns of an array of particle data, or their means over cells.
    Data { array: usize, means: bool, columns: Vec<usize> },
}

/// Element kernels of one rank, with the sources of their coefficients; made once.
#[pyclass(name = "Kernels", frozen, module = "tawami._rust")]
pub(super) struct PyKernels {
    plans: Vec<Plan>,
    rank: usize,
    dofs: usize,
}

impl Source {
    fn new(slot: SlotOf) -> PyResult<Self> {
        match slot {
            SlotOf::Name(name) if name == "fields" => Ok(Self::Fields),
            SlotOf::Name(name) => {
                require(name == "position", "a coefficient of no kernel")?;
                Ok(Self::Position)
            }
            SlotOf::Data(array, means, columns) => {
                require(!columns.is_empty(), "columns")?;
                Ok(Self::Data { array, means, columns })
            }
        }
    }

    /// Number of packed coefficients; `fields` of the fields.
    fn len(&self, fields: usize) -> usize {
        match self {
            Self::Fields => fields,
            Self::Position => DIM,
            Self::Data { columns, .. } => columns.len(),
        }
    }

    fn at_points<'a>(
        &'a self,
        location: &Location,
        data: &'a [Read2<f64>],
    ) -> PyResult<PointSlot<'a>> {
        Ok(match self {
            Self::Fields => PointSlot::Fields,
            Self::Position => PointSlot::Position,
            Self::Data { array, means: true, columns } => {
                PointSlot::Means(columns, array_of(*array, columns, location, data)?)
            }
            Self::Data { array, columns, .. } => {
                PointSlot::Data(columns, array_of(*array, columns, location, data)?)
            }
        })
    }

    fn on_cells<'a>(&'a self, location: &Location, data: &'a [Read2<f64>]) -> PyResult<Slot<'a>> {
        match self {
            Self::Fields => Ok(Slot::Fields),
            Self::Data { array, means: true, columns } => {
                Ok(Slot::Means(columns, array_of(*array, columns, location, data)?))
            }
            _ => Err(PyRuntimeError::new_err("internal: an integral over cells at particles")),
        }
    }
}

/// One of the arrays of particle data, with these columns.
fn array_of<'a>(
    array: usize,
    columns: &[usize],
    location: &Location,
    data: &'a [Read2<f64>],
) -> PyResult<ArrayView2<'a, f64>> {
    let Some(data) = data.get(array) else {
        return Err(PyRuntimeError::new_err("internal: kernels of other data"));
    };
    let data: ArrayView2<f64> = data.as_array();
    check_data(location, &data, columns)?;
    Ok(data)
}

#[pymethods]
impl PyKernels {
    #[new]
    fn new(assembler: &PyAssembler, rank: usize, kernels: Vec<KernelOf>) -> PyResult<Self> {
        let (cells, dofs) = (&assembler.cells, assembler.cells.dofs());
        let plan = |kernel: KernelOf| {
            let (owner, address, its_rank, width, slots, constants, reads_position, point) = kernel;
            require(address != 0 && its_rank == rank, "a kernel of another rank")?;
            let point = point.map(|point| entries(point, rank, cells)).transpose()?;
            let fields = point.as_ref().map_or(dofs, |(_, entries)| entries.num_fields());
            let slots: Vec<_> = slots.into_iter().map(Source::new).collect::<PyResult<_>>()?;
            let packed: usize = slots.iter().map(|slot| slot.len(fields)).sum();
            require(packed == width, "a kernel of other coefficients")?;
            // SAFETY: the address is that of an FFCx kernel, which its owner keeps loaded. Rank and
            // number of coefficients are checked against what the caller says of it.
            let tabulate =
                unsafe { std::mem::transmute::<*const (), TabulateTensor>(address as *const ()) };
            Ok(Plan { _owner: owner, tabulate, slots, constants, reads_position, point })
        };
        let plans = kernels.into_iter().map(plan).collect::<PyResult<_>>()?;
        Ok(Self { plans, rank, dofs })
    }

    /// Elasticity in the first components of the fields: an array of particle data has mu and lambda.
    #[staticmethod]
    fn elasticity(py: Python, assembler: &PyAssembler, geometry: &str) -> PyResult<Self> {
        Self::reference(py, assembler, Reference::Elasticity(geometry.parse()?))
    }

    /// `c q p` of the first component of the fields: an array of particle data has c.
    #[staticmethod]
    fn mass(py: Python, assembler: &PyAssembler) -> PyResult<Self> {
        Self::reference(py, assembler, Reference::Mass)
    }
}

/// Place and entries of a point kernel.
fn entries(
    (place, fields, test, trial): PointOf,
    rank: usize,
    cells: &Cells,
) -> PyResult<(Place, Entries)> {
    let place = match place.as_str() {
        "particle" => Place::Particles,
        "centre" => Place::Centre,
        _ => Place::Vertices,
    };
    let read = |of: Vec<EntryOf>| -> PyResult<Vec<Entry>> {
        of.into_iter()
            .map(|(component, axes)| {
                Entry::new(component, &axes)
                    .ok_or_else(|| PyRuntimeError::new_err("internal: an entry of other fields"))
            })
            .collect()
    };
    let entries = Entries::new(&read(fields)?, &read(test)?, &read(trial)?);
    require(entries.rank() == rank && entries.fit(cells), "entries of other fields")?;
    Ok((place, entries))
}

impl PyKernels {
    /// A reference operator of rank 2.
    fn reference(py: Python, assembler: &PyAssembler, of: Reference) -> PyResult<Self> {
        let columns = (0..of.columns()).collect();
        let mut slots = vec![Source::Data { array: 0, means: false, columns }];
        slots.extend(of.reads_position().then_some(Source::Position));
        let entries = of.entries().filter(|entries| entries.fit(&assembler.cells));
        let Some(entries) = entries else {
            return Err(PyRuntimeError::new_err("internal: an operator of other fields"));
        };
        let plan = Plan {
            _owner: py.None(),
            tabulate: of.kernel(),
            slots,
            constants: Vec::new(),
            reads_position: false,
            point: Some((Place::Particles, entries)),
        };
        Ok(Self { plans: vec![plan], rank: 2, dofs: assembler.cells.dofs() })
    }

    /// The kernels one by one, with their arguments.
    fn each<'a>(
        &'a self,
        assembler: &PyAssembler,
        rank: usize,
        data: &'a [Read2<f64>],
    ) -> PyResult<Vec<Kernels<'a>>> {
        require(self.rank == rank, "kernels of another rank")?;
        require(self.dofs == assembler.cells.dofs(), "kernels of other fields")?;
        let location = &assembler.location;
        let kernel = |plan: &'a Plan| {
            let (tabulate, constants) = (plan.tabulate, plan.constants.as_slice());
            let mut kernels = Kernels::default();
            if let Some((place, entries)) = &plan.point {
                let slot = |source: &'a Source| source.at_points(location, data);
                let slots = plan.slots.iter().map(slot).collect::<PyResult<_>>()?;
                let place = *place;
                kernels.points.push(PointKernel { tabulate, place, entries, slots, constants });
            } else {
                let slot = |source: &'a Source| source.on_cells(location, data);
                let slots = plan.slots.iter().map(slot).collect::<PyResult<_>>()?;
                let reads_position = plan.reads_position;
                kernels.cells.push(Kernel { tabulate, slots, constants, reads_position });
            }
            Ok(kernels)
        };
        self.plans.iter().map(kernel).collect()
    }

    /// The sum of the kernels.
    fn with<'a>(
        &'a self,
        assembler: &PyAssembler,
        rank: usize,
        data: &'a [Read2<f64>],
    ) -> PyResult<Kernels<'a>> {
        let mut sum = Kernels::default();
        for one in self.each(assembler, rank, data)? {
            sum.cells.extend(one.cells);
            sum.points.extend(one.points);
        }
        Ok(sum)
    }
}

/// Element kernels over the cells with particles; see `rust/assembly`.
#[pyclass(name = "Assembler", frozen, module = "tawami._rust")]
pub(super) struct PyAssembler {
    location: Arc<Location>,
    cells: Cells,
}

impl PyAssembler {
    fn state<'a>(
        &'a self,
        volume: &'a Read1<f64>,
        coefficients: &'a Read1<f64>,
    ) -> PyResult<State<'a>> {
        let (volume, coefficients) = (volume.as_slice()?, coefficients.as_slice()?);
        require(volume.len() == self.location.len(), "volumes of other particles")?;
        let expected = self.cells.coefficients(self.location.grid.cells);
        require(coefficients.len() == expected, "wrong number of grid coefficients")?;
        Ok(State::new(&self.cells, &self.location, volume, coefficients))
    }
}

/// Starts, unknowns and weights of the compressed rows of S, and the coefficient of each unknown.
type SelectionOf<'py> = (Read1<'py, i32>, Read1<'py, i32>, Read1<'py, f64>, Read1<'py, i64>);

#[pymethods]
impl PyAssembler {
    #[new]
    fn new(
        location: &PyLocation,
        fields: Vec<(String, usize, usize)>,
        nodes: [Index; NODES],
        vertices: [Index; VERTICES],
    ) -> PyResult<Self> {
        require(nodes.iter().flatten().all(|&p| p < NODES_1D), "nodes of a cell")?;
        require(vertices.iter().flatten().all(|&p| p < 2), "vertices of a cell")?;
        let field = |(basis, components, degree): (String, usize, usize)| {
            require(degree == 1 || degree == 2, "degree of an element")?;
            Ok(Field { basis: basis.parse()?, components, quadratic: degree == 2 })
        };
        let fields = fields.into_iter().map(field).collect::<PyResult<_>>()?;
        let Some(cells) = Cells::new(fields, nodes, vertices) else {
            return Err(PyRuntimeError::new_err("internal: too many coefficients on a cell"));
        };
        Ok(Self { location: Arc::clone(&location.0), cells })
    }

    /// The form's vector on all coefficients, or the sum of the absolute values of what each particle
    /// contributes; `data` are the arrays that the kernels count.
    #[pyo3(signature = (kernels, data, volume, coefficients, absolute = false))]
    fn vector<'py>(
        &self,
        py: Python<'py>,
        kernels: &PyKernels,
        data: Vec<Read2<f64>>,
        volume: Read1<f64>,
        coefficients: Read1<f64>,
        absolute: bool,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let kernels = kernels.with(self, 1, &data)?;
        let state = self.state(&volume, &coefficients)?;
        // SAFETY: kernels as in `PyKernels::new`, of rank 1; the number of coefficients was checked.
        let sums = detached(py, || unsafe { assembly::vector(&state, &kernels, absolute) });
        Ok(sums.to_pyarray(py))
    }

    /// Pattern of the reduced matrix for a selection.
    fn pattern(&self, py: Python, selection: SelectionOf) -> PyResult<PyPattern> {
        let (start, unknown, weight, coefficient) = &selection;
        let (start, unknown) = (start.as_slice()?.to_vec(), unknown.as_slice()?.to_vec());
        let (weight, coefficient) = (weight.as_slice()?.to_vec(), coefficient.as_slice()?.to_vec());
        let count = self.cells.coefficients(self.location.grid.cells);
        let Some(selection) = Selection::new(count, start, unknown, weight, coefficient) else {
            return Err(PyRuntimeError::new_err(
                "internal: not a selection of these coefficients (please report this)",
            ));
        };
        let pattern = detached(py, || assembly::pattern(&self.cells, &self.location, &selection));
        let Some(pattern) = pattern else {
            return Err(InputError::new_err(
                "the reduced matrix has more than 2147483647 entries: expected a coarser grid",
            ));
        };
        Ok(PyPattern { grid: self.location.grid, selection, pattern })
    }

    /// Fill the values of the reduced matrix in its pattern. `couplings` are kernels of rank 1; the products
    /// of the first and the second, of the third and the fourth, ... are added. With `add`, all of it is added to
    /// the values; the pattern may then be that of more cells.
    #[allow(clippy::too_many_arguments)]
    #[pyo3(signature = (kernels, couplings, data, volume, coefficients, pattern, values, add = false))]
    fn matrix(
        &self,
        py: Python,
        kernels: &PyKernels,
        couplings: &PyKernels,
        data: Vec<Read2<f64>>,
        volume: Read1<f64>,
        coefficients: Read1<f64>,
        pattern: &PyPattern,
        mut values: Write1<f64>,
        add: bool,
    ) -> PyResult<()> {
        let values = values.as_slice_mut()?;
        let mine = pattern.grid == self.location.grid;
        require(mine && values.len() == pattern.pattern.columns.len(), "another pattern")?;
        let mut sides = couplings.each(self, 1, &data)?.into_iter();
        let mut pairs = Vec::new();
        while let Some(left) = sides.next() {
            let Some(right) = sides.next() else {
                return Err(PyRuntimeError::new_err("internal: not a pair of kernels"));
            };
            pairs.push([left, right]);
        }
        let form = Bilinear { kernels: kernels.with(self, 2, &data)?, couplings: pairs };
        let state = self.state(&volume, &coefficients)?;
        // SAFETY: kernels as in `PyKernels::new`, of the ranks asked for; `assembly::pattern` made the
        // pattern, whose cells are compared with those of this location, and the lengths were checked.
        let fits = detached(py, || unsafe {
            assembly::matrix(&state, &form, &pattern.selection, &pattern.pattern, values, add)
        });
        require(fits, "not the pattern of this matrix")
    }
}

/// Compressed rows of the reduced matrix of one selection.
#[pyclass(name = "Pattern", frozen, module = "tawami._rust")]
pub(super) struct PyPattern {
    grid: Grid,
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
