//! Point kernels: the integrand of a form at one point, and its derivative, between the functions of a cell.
//!
//! FFCx compiles the integrand with values and gradients of the fields as the components of one vector `d`:
//! `r(d, data)` has one number per value or gradient of a test function, and `D = dr/dd` is its tangent
//! (`python/tawami/form/points.py`). With B, the values and gradients of the functions at the point,
//!
//! ```text
//! R += w B^T r(B c),    K += w B^T D B
//! ```
//!
//! at each particle, w = V_p, with its data; or at the centre or the vertices of the cell with w = 1 and the
//! data `sum_p V_p N(x_p) D_p` of the particles of the cell.

// Small functions of the innermost loops: without it, what they share is computed again.
#![allow(clippy::inline_always)]

use std::ffi::c_void;
use std::ops::Range;

use ndarray::ArrayView2;

use super::cell::{Cells, Local};
use super::kernel::{State, TabulateTensor};
use crate::grid::{products_of, Functions};
use crate::space::{Index, Point, DIM, FUNCTIONS, FUNCTIONS_1D, SYMMETRIC, VERTICES};
use crate::transfer::cells::{mean_of_cell, sum_of_cell};

/// A function, its first derivatives, and its second ones (xx, yy, xy).
pub const DERIVATIVES: usize = 1 + DIM + SYMMETRIC;

/// The interval on which kernels of points are compiled, whose length is 1.
const INTERVAL: [f64; 6] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];

/// A value or derivative of a component of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Number of the component among those of all fields.
    component: usize,
    /// 0 for the value; then the first and the second derivatives.
    derivative: usize,
}

impl Entry {
    /// From a component and the axes of the derivatives, at most two; `None` if there is no such entry.
    #[must_use]
    pub fn new(component: usize, axes: &[usize]) -> Option<Self> {
        let derivative = match *axes {
            [] => 0,
            [i] => 1 + i,
            [i, j] => {
                1 + DIM
                    + axes_of_second().iter().position(|&pair| pair == [i, j] || pair == [j, i])?
            }
            _ => return None,
        };
        let inside = axes.iter().all(|&axis| axis < DIM);
        inside.then_some(Self { component, derivative })
    }
}

/// Axes of each second derivative.
fn axes_of_second() -> [[usize; 2]; SYMMETRIC] {
    let mut pairs = [[0; 2]; SYMMETRIC];
    let mut mixed = DIM;
    for i in 0..DIM {
        pairs[i] = [i, i];
        for j in i + 1..DIM {
            pairs[mixed] = [i, j];
            mixed += 1;
        }
    }
    pairs
}

/// Values of the fields that a kernel reads, and the factors of the rows and columns of its result.
#[derive(Debug, Clone)]
pub struct Entries {
    /// All entries, each once.
    distinct: Vec<Entry>,
    /// Positions of the values of the fields among them.
    fields: Vec<usize>,
    /// Those of the test functions: the rows.
    test: Vec<usize>,
    /// Those of the changes of the fields: the columns; none for a kernel of rank 1.
    trial: Vec<usize>,
    /// Rows of each component.
    components: Vec<Range<usize>>,
    /// Whether there are second derivatives.
    second: bool,
}

impl Entries {
    /// From the entries of the fields, the test functions and the changes of the fields.
    #[must_use]
    pub fn new(fields: &[Entry], test: &[Entry], trial: &[Entry]) -> Self {
        let mut distinct: Vec<Entry> = Vec::new();
        let mut place = |entry: &Entry| {
            distinct.iter().position(|e| e == entry).unwrap_or_else(|| {
                distinct.push(*entry);
                distinct.len() - 1
            })
        };
        let [fields, test, trial]: [Vec<usize>; 3] =
            [fields, test, trial].map(|entries| entries.iter().map(&mut place).collect());
        let second = distinct.iter().any(|entry| entry.derivative > DIM);
        let component = |i: usize| distinct[test[i]].component;
        let mut components: Vec<Range<usize>> = Vec::new();
        for i in 0..test.len() {
            match components.last_mut() {
                Some(last) if component(last.start) == component(i) => last.end = i + 1,
                _ => components.push(i..i + 1),
            }
        }
        Self { distinct, fields, test, trial, components, second }
    }

    /// Rank of the kernel.
    #[must_use]
    pub fn rank(&self) -> usize {
        if self.trial.is_empty() {
            1
        } else {
            2
        }
    }

    /// Number of values of the fields that the kernel reads.
    #[must_use]
    pub fn num_fields(&self) -> usize {
        self.fields.len()
    }

    /// Whether they are entries of the fields of these cells.
    #[must_use]
    pub fn fit(&self, cells: &Cells) -> bool {
        let count = cells.components().len();
        self.distinct.iter().all(|entry| entry.component < count)
    }
}

/// Places where a kernel is evaluated.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// At each particle.
    Particles,
    /// At the centre of the cell.
    Centre,
    /// At its vertices.
    Vertices,
}

/// One coefficient of a point kernel, in packed order.
pub enum PointSlot<'a> {
    /// Values of the fields.
    Fields,
    /// Position of the point [m].
    Position,
    /// Columns of an array of particle data.
    Data(&'a [usize], ArrayView2<'a, f64>),
    /// Means over the particles of the cell.
    Means(&'a [usize], ArrayView2<'a, f64>),
}

/// A point kernel and its arguments.
pub struct PointKernel<'a> {
    /// The C function.
    pub tabulate: TabulateTensor,
    /// Where it is evaluated.
    pub place: Place,
    /// Its entries.
    pub entries: &'a Entries,
    /// Its coefficients in packed order.
    pub slots: Vec<PointSlot<'a>>,
    /// Its constants.
    pub constants: &'a [f64],
}

/// Values and derivatives [1/m, 1/m2] of the functions of a cell at a point.
type Derivatives = [[f64; FUNCTIONS]; DERIVATIVES];

/// A row of numbers, one for each coefficient of a cell, and zeros up to whole lines of the cache.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub(super) struct Row<const P: usize>(pub [f64; P]);

impl<const P: usize> Row<P> {
    pub(super) const ZERO: Self = Self([0.0; P]);

    #[inline(always)]
    pub(super) fn add(&mut self, factor: f64, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += factor * b);
    }
}

/// Memory of one thread for cells whose coefficients fit into rows of `P` numbers.
pub(super) struct Points<const P: usize> {
    /// Coefficients of each component on the cell.
    coefficients: Vec<[f64; FUNCTIONS]>,
    /// Vector of each component on the cell.
    sums: Vec<[f64; FUNCTIONS]>,
    /// The functions of each basis.
    tables: Vec<Derivatives>,
    /// `rows[e]`: entry e of the functions behind each coefficient, zero for other components.
    rows: Vec<Row<P>>,
    /// `D B`.
    half: Vec<Row<P>>,
    packed: Vec<f64>,
    /// r or D.
    result: Vec<f64>,
}

impl<const P: usize> Points<P> {
    pub(super) fn new(cells: &Cells) -> Self {
        Self {
            coefficients: vec![[0.0; FUNCTIONS]; cells.components().len()],
            sums: vec![[0.0; FUNCTIONS]; cells.components().len()],
            tables: vec![[[0.0; FUNCTIONS]; DERIVATIVES]; cells.bases().len()],
            rows: Vec::new(),
            half: Vec::new(),
            packed: Vec::new(),
            result: Vec::new(),
        }
    }

    /// Add kernels of rank 1 on the a-th active cell to a vector on its coefficients, or the absolute value
    /// of what each point contributes.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    pub(super) unsafe fn add_vectors(
        &mut self,
        kernels: &[PointKernel],
        state: &State,
        a: usize,
        local: &Local,
        absolute: bool,
        out: &mut Row<P>,
    ) {
        self.sums.fill([0.0; FUNCTIONS]);
        // SAFETY: the caller's.
        unsafe {
            self.evaluate(kernels, state, a, local, |points, entries, weight| {
                points.add_vector(entries, state.cells, weight, absolute);
            });
        }
        for (sums, component) in self.sums.iter().zip(state.cells.components()) {
            let places = out.0[component.first..].iter_mut().step_by(component.step);
            places.zip(&sums[..component.functions]).for_each(|(out, sum)| *out += sum);
        }
    }

    /// Add kernels of rank 2 on the a-th active cell to a matrix on its coefficients.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    pub(super) unsafe fn add_matrices(
        &mut self,
        kernels: &[PointKernel],
        state: &State,
        a: usize,
        local: &Local,
        out: &mut [Row<P>],
    ) {
        for kernel in kernels {
            self.rows.clear();
            self.rows.resize(kernel.entries.distinct.len(), Row::ZERO);
            self.half.resize(kernel.entries.test.len(), Row::ZERO);
            let kernel = std::slice::from_ref(kernel);
            // SAFETY: the caller's.
            unsafe {
                self.evaluate(kernel, state, a, local, |points, entries, weight| {
                    points.add_matrix(entries, state.cells, weight, out);
                });
            }
        }
    }

    /// Evaluate kernels at their points in a cell, and hand each result to `add` with its weight.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    #[inline(always)]
    unsafe fn evaluate(
        &mut self,
        kernels: &[PointKernel],
        state: &State,
        a: usize,
        local: &Local,
        mut add: impl FnMut(&mut Self, &Entries, f64),
    ) {
        if kernels.is_empty() {
            return;
        }
        let numbers = local.numbers();
        for (c, component) in self.coefficients.iter_mut().zip(state.cells.components()) {
            let mine = numbers[component.first..].iter().step_by(component.step);
            c.iter_mut().zip(mine).take(component.functions).for_each(|(c, &n)| {
                *c = state.coefficients[n];
            });
        }
        let location = state.location;
        for kernel in kernels {
            let at = |p: &u32| location.xi[*p as usize];
            let particles = location.particles_of(a);
            match kernel.place {
                Place::Particles => {
                    for p in particles {
                        let data = |columns: &[usize], data: &ArrayView2<f64>, out: &mut [f64]| {
                            let row = data.row(*p as usize);
                            out.iter_mut().zip(columns).for_each(|(o, &c)| *o = row[c]);
                        };
                        let weight = state.volume[*p as usize];
                        // SAFETY: the caller's.
                        unsafe { self.tabulate(kernel, state, a, at(p), data) };
                        add(self, kernel.entries, weight);
                    }
                }
                Place::Centre => {
                    let data = |columns: &[usize], data: &ArrayView2<f64>, out: &mut [f64]| {
                        sum_of_cell(location, a, state.volume, *data, columns.iter().copied(), out);
                    };
                    // SAFETY: the caller's.
                    unsafe { self.tabulate(kernel, state, a, [0.5; DIM], data) };
                    add(self, kernel.entries, 1.0);
                }
                Place::Vertices => {
                    for &vertex in state.cells.vertices_of_cell() {
                        let data = |columns: &[usize], data: &ArrayView2<f64>, out: &mut [f64]| {
                            out.fill(0.0);
                            for p in particles {
                                let row = data.row(*p as usize);
                                let w = state.volume[*p as usize] * at_vertex(vertex, at(p));
                                out.iter_mut().zip(columns).for_each(|(o, &c)| *o += w * row[c]);
                            }
                        };
                        let xi = vertex.map(|i| i as f64);
                        // SAFETY: the caller's.
                        unsafe { self.tabulate(kernel, state, a, xi, data) };
                        add(self, kernel.entries, 1.0);
                    }
                }
            }
        }
    }

    /// The functions behind an entry.
    #[inline(always)]
    fn functions(&self, entry: Entry, cells: &Cells) -> &[f64; FUNCTIONS] {
        &self.tables[cells.components()[entry.component].basis][entry.derivative]
    }

    /// Evaluate a kernel at a point: `result`, and the functions there.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    #[inline(always)]
    unsafe fn tabulate(
        &mut self,
        kernel: &PointKernel,
        state: &State,
        a: usize,
        xi: Point,
        data_at: impl Fn(&[usize], &ArrayView2<f64>, &mut [f64]),
    ) {
        let (entries, grid, cells) = (kernel.entries, &state.location.grid, state.cells);
        let cell = state.location.active_index(a);
        for (table, &basis) in self.tables.iter_mut().zip(cells.bases()) {
            let functions = Functions { basis, cells: grid.cells };
            match basis.per_cell() {
                2 => derivatives::<2>(&functions, cell, xi, grid.h, entries.second, table),
                _ => {
                    derivatives::<FUNCTIONS_1D>(
                        &functions,
                        cell,
                        xi,
                        grid.h,
                        entries.second,
                        table,
                    );
                }
            }
        }
        self.packed.clear();
        for slot in &kernel.slots {
            let start = self.packed.len();
            match slot {
                PointSlot::Fields => {
                    for &e in &entries.fields {
                        let entry = entries.distinct[e];
                        let (functions, c) =
                            (self.functions(entry, cells), &self.coefficients[entry.component]);
                        let value = functions.iter().zip(c).map(|(b, c)| b * c).sum();
                        self.packed.push(value);
                    }
                }
                PointSlot::Position => self.packed.extend(grid.position(cell, xi)),
                PointSlot::Data(columns, data) => {
                    self.packed.resize(start + columns.len(), 0.0);
                    data_at(columns, data, &mut self.packed[start..]);
                }
                PointSlot::Means(columns, data) => {
                    self.packed.resize(start + columns.len(), 0.0);
                    let out = &mut self.packed[start..];
                    mean_of_cell(state.location, a, state.volume, *data, columns, out);
                }
            }
        }
        let (rows, columns) = (entries.test.len(), entries.trial.len());
        self.result.resize(rows * columns.max(1), 0.0);
        self.result.fill(0.0);
        // SAFETY: the caller guarantees the kernel, which writes rows x columns numbers.
        unsafe {
            (kernel.tabulate)(
                self.result.as_mut_ptr(),
                self.packed.as_ptr(),
                kernel.constants.as_ptr(),
                INTERVAL.as_ptr(),
                std::ptr::null(),
                std::ptr::null(),
                std::ptr::null_mut::<c_void>(),
            );
        }
    }

    /// `sums += weight B^T r`, or its absolute value.
    #[inline(always)]
    fn add_vector(&mut self, entries: &Entries, cells: &Cells, weight: f64, absolute: bool) {
        for group in &entries.components {
            let mut sum = [0.0; FUNCTIONS];
            for (r, &e) in self.result[group.clone()].iter().zip(&entries.test[group.clone()]) {
                let (r, functions) = (weight * r, self.functions(entries.distinct[e], cells));
                sum.iter_mut().zip(functions).for_each(|(s, b)| *s += r * b);
            }
            let sums = &mut self.sums[entries.distinct[entries.test[group.start]].component];
            if absolute {
                sum = sum.map(f64::abs);
            }
            sums.iter_mut().zip(sum).for_each(|(sums, s)| *sums += s);
        }
    }

    /// `out += weight B^T D B`.
    #[inline(always)]
    fn add_matrix(&mut self, entries: &Entries, cells: &Cells, weight: f64, out: &mut [Row<P>]) {
        let (components, distinct) = (cells.components(), &entries.distinct);
        for (row, entry) in self.rows.iter_mut().zip(distinct) {
            let component = &components[entry.component];
            let functions = &self.tables[component.basis][entry.derivative];
            // constant numbers of functions, so that the loops are unrolled
            match (component.functions, component.step) {
                (FUNCTIONS, DIM) => place::<FUNCTIONS, DIM, P>(functions, component.first, row),
                (FUNCTIONS, _) => place::<FUNCTIONS, 1, P>(functions, component.first, row),
                (_, DIM) => place::<VERTICES, DIM, P>(functions, component.first, row),
                _ => place::<VERTICES, 1, P>(functions, component.first, row),
            }
        }
        let lines = self.result.chunks_exact(entries.trial.len());
        for (half, d) in self.half.iter_mut().zip(lines) {
            let mut sum = Row::ZERO;
            for (d, &column) in d.iter().zip(&entries.trial).filter(|(d, _)| **d != 0.0) {
                sum.add(weight * d, &self.rows[column]);
            }
            *half = sum;
        }
        for group in &entries.components {
            let (half, test) = (&self.half[group.clone()], &entries.test[group.clone()]);
            let component = &components[distinct[test[0]].component];
            let table = &self.tables[component.basis];
            let mut functions = [&table[0]; DERIVATIVES];
            for (functions, &e) in functions.iter_mut().zip(test) {
                *functions = &table[distinct[e].derivative];
            }
            match (component.functions, component.step) {
                (FUNCTIONS, DIM) => {
                    add_rows::<FUNCTIONS, DIM, P>(&functions, half, component.first, out);
                }
                (FUNCTIONS, _) => {
                    add_rows::<FUNCTIONS, 1, P>(&functions, half, component.first, out);
                }
                (_, DIM) => add_rows::<VERTICES, DIM, P>(&functions, half, component.first, out),
                _ => add_rows::<VERTICES, 1, P>(&functions, half, component.first, out),
            }
        }
    }
}

/// Put the values of `F` functions to the coefficients of a component, one of `S` of its field.
#[inline(always)]
fn place<const F: usize, const S: usize, const P: usize>(
    functions: &[f64; FUNCTIONS],
    first: usize,
    row: &mut Row<P>,
) {
    let places = &mut row.0[first..][..=S * (F - 1)];
    (0..F).for_each(|f| places[S * f] = functions[f]);
}

/// Add `sum_k functions_k half_k` to the rows of the `F` functions of a component, one of `S` of its field.
#[inline(always)]
fn add_rows<const F: usize, const S: usize, const P: usize>(
    functions: &[&[f64; FUNCTIONS]; DERIVATIVES],
    half: &[Row<P>],
    first: usize,
    out: &mut [Row<P>],
) {
    let lines = &mut out[first..][..=S * (F - 1)];
    for f in 0..F {
        let mut sum = lines[S * f];
        for (functions, half) in functions.iter().zip(half) {
            sum.add(functions[f], half);
        }
        lines[S * f] = sum;
    }
}

/// Values and derivatives of the functions of a cell at a position in it, `W` along each axis. The second
/// ones are left out if they are not needed.
#[inline(always)]
fn derivatives<const W: usize>(
    functions: &Functions,
    cell: Index,
    xi: Point,
    h: f64,
    second: bool,
    out: &mut Derivatives,
) {
    let along = functions.at(cell, xi);
    let values = along.each_ref().map(|local| &local.value);
    out[0] = products_of::<W>(values);
    for axis in 0..DIM {
        let mut factors = values;
        factors[axis] = &along[axis].derivative;
        out[1 + axis] = products_of::<W>(factors).map(|value| value / h);
    }
    if second {
        for (out, [i, j]) in out[1 + DIM..].iter_mut().zip(axes_of_second()) {
            let mut factors = values;
            factors[i] = &along[i].derivative;
            factors[j] = if i == j { &along[j].second } else { &along[j].derivative };
            *out = products_of::<W>(factors).map(|value| value / (h * h));
        }
    }
}

/// Value of the linear function of a vertex at a position in a cell.
fn at_vertex(vertex: Index, xi: Point) -> f64 {
    vertex.iter().zip(xi).map(|(&i, t)| if i == 0 { 1.0 - t } else { t }).product()
}
