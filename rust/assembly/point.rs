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

use super::cell::Local;
use super::kernel::{State, TabulateTensor};
use crate::grid::{products_of, Functions};
use crate::space::{number_of, Index, Point, DIM, FUNCTIONS, SYMMETRIC, VERTICES};
use crate::transfer::cells::{mean_of_cell, sum_of_cell};

/// A function, its first derivatives, and its second ones (xx, yy, xy).
pub const DERIVATIVES: usize = 1 + DIM + SYMMETRIC;

/// Components of all fields.
const COMPONENTS: usize = DIM + 1;

/// Most numbers that a kernel reads of the fields at a point.
pub const MAX_ENTRIES: usize = COMPONENTS * DERIVATIVES;

/// The interval on which kernels of points are compiled, whose length is 1.
const INTERVAL: [f64; 6] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0];

/// A value or derivative of a component of the fields.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// Component: those of the displacement, then the linear field.
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
        let inside = component < COMPONENTS && axes.iter().all(|&axis| axis < DIM);
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

    /// Whether a field that the grid does not have is among them.
    #[must_use]
    pub fn fit(&self, linear: bool) -> bool {
        linear || self.distinct.iter().all(|entry| entry.component < DIM)
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
    fn add(&mut self, factor: f64, other: &Self) {
        self.0.iter_mut().zip(&other.0).for_each(|(a, b)| *a += factor * b);
    }
}

/// Memory of one thread for a cell with `M` coefficients in rows of `P` numbers, and with `W` functions of the
/// displacement along each axis.
pub(super) struct Points<const M: usize, const P: usize, const W: usize> {
    /// Coefficients of each component on the cell.
    coefficients: [[f64; FUNCTIONS]; COMPONENTS],
    displacement: Derivatives,
    /// Those of the linear field, in the order of the vertices.
    linear: Derivatives,
    /// `rows[e]`: entry e of the functions behind each coefficient, zero for other components.
    rows: [Row<P>; MAX_ENTRIES],
    /// `D B`.
    half: [Row<P>; MAX_ENTRIES],
    packed: Vec<f64>,
    /// r or D.
    result: [f64; MAX_ENTRIES * MAX_ENTRIES],
}

impl<const M: usize, const P: usize, const W: usize> Points<M, P, W> {
    /// Functions of the displacement on a cell.
    const FUNCTIONS: usize = W.pow(DIM as u32);

    pub(super) fn new() -> Self {
        Self {
            coefficients: [[0.0; FUNCTIONS]; COMPONENTS],
            displacement: [[0.0; FUNCTIONS]; DERIVATIVES],
            linear: [[0.0; FUNCTIONS]; DERIVATIVES],
            rows: [Row::ZERO; MAX_ENTRIES],
            half: [Row::ZERO; MAX_ENTRIES],
            packed: Vec::new(),
            result: [0.0; MAX_ENTRIES * MAX_ENTRIES],
        }
    }

    /// Add kernels of rank 1 on the a-th active cell to a vector on its coefficients.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    pub(super) unsafe fn add_vectors(
        &mut self,
        kernels: &[PointKernel],
        state: &State,
        a: usize,
        local: &Local,
        out: &mut [f64; M],
    ) {
        // SAFETY: the caller's.
        unsafe {
            self.evaluate(kernels, state, a, local, |points, entries, weight| {
                points.add_vector(entries, weight, out);
            });
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
        out: &mut [Row<P>; M],
    ) {
        for kernel in kernels {
            self.rows[..kernel.entries.distinct.len()].fill(Row::ZERO);
            let kernel = std::slice::from_ref(kernel);
            // SAFETY: the caller's.
            unsafe {
                self.evaluate(kernel, state, a, local, |points, entries, weight| {
                    points.add_matrix(entries, weight, out);
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
        for (k, &c) in numbers.iter().enumerate() {
            let (component, function) = if k < DIM * Self::FUNCTIONS {
                (k % DIM, k / DIM)
            } else {
                (DIM, k - DIM * Self::FUNCTIONS)
            };
            self.coefficients[component][function] = state.coefficients[c];
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
    fn functions(&self, entry: Entry) -> &[f64] {
        if entry.component < DIM {
            &self.displacement[entry.derivative][..Self::FUNCTIONS]
        } else {
            &self.linear[entry.derivative][..VERTICES]
        }
    }

    /// Places of the coefficients of a component: first and step.
    #[inline(always)]
    fn places(component: usize) -> (usize, usize) {
        if component < DIM {
            (component, DIM)
        } else {
            (DIM * Self::FUNCTIONS, 1)
        }
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
        self.displacement =
            derivatives::<W>(&cells.displacement(grid.cells), cell, xi, grid.h, entries.second);
        if let Some(linear) = cells.linear(grid.cells) {
            let at = derivatives::<2>(&linear, cell, xi, grid.h, entries.second);
            for (k, &vertex) in cells.vertices_of_cell().iter().enumerate() {
                let from = number_of(vertex, [2; DIM]);
                self.linear.iter_mut().zip(&at).for_each(|(to, at)| to[k] = at[from]);
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
                            (self.functions(entry), &self.coefficients[entry.component]);
                        let value = functions.iter().zip(c).map(|(b, c)| b * c).sum();
                        self.packed.push(value);
                    }
                }
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
        let result = &mut self.result[..rows * columns.max(1)];
        result.fill(0.0);
        // SAFETY: the caller guarantees the kernel, which writes rows x columns numbers.
        unsafe {
            (kernel.tabulate)(
                result.as_mut_ptr(),
                self.packed.as_ptr(),
                kernel.constants.as_ptr(),
                INTERVAL.as_ptr(),
                std::ptr::null(),
                std::ptr::null(),
                std::ptr::null_mut::<c_void>(),
            );
        }
    }

    /// `out += weight B^T r`.
    fn add_vector(&self, entries: &Entries, weight: f64, out: &mut [f64; M]) {
        for (r, &e) in self.result.iter().zip(&entries.test) {
            let entry = entries.distinct[e];
            let (first, step) = Self::places(entry.component);
            let r = weight * r;
            let places = out[first..].iter_mut().step_by(step);
            places.zip(self.functions(entry)).for_each(|(o, b)| *o += r * b);
        }
    }

    /// `out += weight B^T D B`.
    fn add_matrix(&mut self, entries: &Entries, weight: f64, out: &mut [Row<P>; M]) {
        for (e, &entry) in entries.distinct.iter().enumerate() {
            let (first, step) = Self::places(entry.component);
            let places = self.rows[e].0[first..].iter_mut().step_by(step);
            let functions = if entry.component < DIM {
                &self.displacement[entry.derivative][..Self::FUNCTIONS]
            } else {
                &self.linear[entry.derivative][..VERTICES]
            };
            places.zip(functions).for_each(|(place, b)| *place = *b);
        }
        let lines = self.result.chunks_exact(entries.trial.len()).take(entries.test.len());
        for (half, d) in self.half.iter_mut().zip(lines) {
            let mut sum = Row::ZERO;
            for (d, &column) in d.iter().zip(&entries.trial).filter(|(d, _)| **d != 0.0) {
                sum.add(weight * d, &self.rows[column]);
            }
            *half = sum;
        }
        for group in &entries.components {
            let half = &self.half[group.clone()];
            let mut functions: [&[f64]; DERIVATIVES] = [&[]; DERIVATIVES];
            for (functions, &e) in functions.iter_mut().zip(&entries.test[group.clone()]) {
                *functions = self.functions(entries.distinct[e]);
            }
            let component = entries.distinct[entries.test[group.start]].component;
            let (first, step) = Self::places(component);
            let lines = out[first..].iter_mut().step_by(step);
            for (f, out) in (0..functions[0].len()).zip(lines) {
                let mut sum = *out;
                for (functions, half) in functions.iter().zip(half) {
                    sum.add(functions[f], half);
                }
                *out = sum;
            }
        }
    }
}

/// Values and derivatives of the functions of a cell at a position in it, `W` along each axis.
#[inline(always)]
fn derivatives<const W: usize>(
    functions: &Functions,
    cell: Index,
    xi: Point,
    h: f64,
    second: bool,
) -> Derivatives {
    let along = functions.at(cell, xi);
    let values = along.each_ref().map(|local| &local.value);
    let mut out = [[0.0; FUNCTIONS]; DERIVATIVES];
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
    out
}

/// Value of the linear function of a vertex at a position in a cell.
fn at_vertex(vertex: Index, xi: Point) -> f64 {
    vertex.iter().zip(xi).map(|(&i, t)| if i == 0 { 1.0 - t } else { t }).product()
}
