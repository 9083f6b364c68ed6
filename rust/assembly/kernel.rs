//! Element kernels: the coefficients that they read, and their call.

use std::ffi::c_void;

use ndarray::ArrayView2;

use super::cell::{Cells, Local, Nodal, Vertices, COORDINATES};
use super::point::{PointKernel, Points, Row};
use crate::grid::Location;
use crate::space::DIM;
use crate::transfer::cells::mean_of_cell;

/// Signature of an FFCx kernel: element tensor, coefficients, constants, coordinates of the vertices
/// (3 each), local facet, permutations, user data.
///
/// The user data exist from FFCx 0.10 on. A function without them leaves the argument unread under the
/// calling conventions of Linux on x86-64 and AArch64, where the caller cleans up; Debian's dolfinx is
/// built for these.
pub type TabulateTensor = unsafe extern "C" fn(
    *mut f64,
    *const f64,
    *const f64,
    *const f64,
    *const i32,
    *const u8,
    *mut c_void,
);

/// One coefficient of a kernel, in packed order.
pub enum Slot<'a> {
    /// Values of the fields at the degrees of freedom of the cell.
    Fields,
    /// Means over the particles of the cell.
    Means(&'a [usize], ArrayView2<'a, f64>),
}

/// A kernel and its arguments.
pub struct Kernel<'a> {
    /// The C function.
    pub tabulate: TabulateTensor,
    /// Its coefficients in packed order.
    pub slots: Vec<Slot<'a>>,
    /// Its constants.
    pub constants: &'a [f64],
    /// Whether it reads the position; otherwise it gets positions relative to the corner of the cell.
    pub reads_position: bool,
}

/// Kernels whose results are added.
#[derive(Default)]
pub struct Kernels<'a> {
    /// Integrals over a cell.
    pub cells: Vec<Kernel<'a>>,
    /// Integrands at points.
    pub points: Vec<PointKernel<'a>>,
}

/// The matrix of a cell: `sum kernels + sum left right^T`.
pub struct Bilinear<'a> {
    /// Kernels of rank 2.
    pub kernels: Kernels<'a>,
    /// Pairs of sums of kernels of rank 1. Their products couple terms at the particles with terms at the
    /// centre of the cell (B-bar).
    pub couplings: Vec<[Kernels<'a>; 2]>,
}

/// The state of an assembly, common to all cells.
#[derive(Clone, Copy)]
pub struct State<'a> {
    /// The cells and their fields.
    pub cells: &'a Cells,
    /// Where the particles are.
    pub location: &'a Location,
    /// Volumes of the particles.
    pub volume: &'a [f64],
    /// Coefficients of all fields.
    pub coefficients: &'a [f64],
    /// Vertices of a cell.
    pub(super) vertices: Vertices,
}

impl Slot<'_> {
    /// Number of packed coefficients.
    pub fn len(&self, cells: &Cells) -> usize {
        match self {
            Slot::Fields => cells.dofs(),
            Slot::Means(columns, _) => columns.len(),
        }
    }
}

impl<'a> State<'a> {
    /// The state of an assembly.
    #[must_use]
    pub fn new(
        cells: &'a Cells,
        location: &'a Location,
        volume: &'a [f64],
        coefficients: &'a [f64],
    ) -> Self {
        let vertices = cells.vertices(location.grid.h);
        Self { cells, location, volume, coefficients, vertices }
    }

    /// Sum of the results of kernels on the a-th active cell, into `element`.
    ///
    /// # Safety
    /// As [`vector`](super::vector) and [`matrix`](super::matrix); `element` has the length that the kernels
    /// write.
    unsafe fn tabulate(
        &self,
        kernels: &[Kernel],
        a: usize,
        nodal: &Nodal,
        numbers: &[usize],
        packed: &mut Vec<f64>,
        element: &mut [f64],
    ) {
        element.fill(0.0);
        for kernel in kernels {
            packed.clear();
            for slot in &kernel.slots {
                let start = packed.len();
                packed.resize(start + slot.len(self.cells), 0.0);
                let out = &mut packed[start..];
                match slot {
                    Slot::Fields => nodal.values(numbers, self.coefficients, out),
                    Slot::Means(columns, data) => {
                        mean_of_cell(self.location, a, self.volume, *data, columns, out);
                    }
                }
            }
            let mut vertices = self.vertices;
            if kernel.reads_position {
                let corner = self.location.grid.position(self.location.active_index(a), [0.0; DIM]);
                for x in vertices.chunks_exact_mut(COORDINATES) {
                    x.iter_mut().zip(corner).for_each(|(x, corner)| *x += corner);
                }
            }
            // SAFETY: the caller guarantees the kernel and the length of `element`. Integrals over cells
            // do not read facet, permutations and user data.
            unsafe {
                (kernel.tabulate)(
                    element.as_mut_ptr(),
                    packed.as_ptr(),
                    kernel.constants.as_ptr(),
                    vertices.as_ptr(),
                    std::ptr::null(),
                    std::ptr::null(),
                    std::ptr::null_mut(),
                );
            }
        }
    }
}

/// Memory of one thread, for cells whose coefficients fit into rows of `P` numbers.
pub(super) struct Work<const P: usize> {
    packed: Vec<f64>,
    points: Points<P>,
    nodal: Nodal,
    element: Vec<f64>,
    half: Vec<f64>,
    turned: Vec<f64>,
}

impl<const P: usize> Work<P> {
    pub(super) fn new(cells: &Cells) -> Self {
        let (packed, nodal, points) = (Vec::new(), Nodal::default(), Points::new(cells));
        let [element, half, turned] = [(); 3].map(|()| vec![0.0; cells.dofs() * cells.dofs()]);
        Self { packed, points, nodal, element, half, turned }
    }

    /// Vector of the a-th active cell on its coefficients; or, with `absolute`, the sums of the absolute
    /// values of what each point and the kernels of the cell contribute to it.
    ///
    /// # Safety
    /// As [`vector`](super::vector).
    pub(super) unsafe fn vector(
        &mut self,
        state: &State,
        kernels: &Kernels,
        a: usize,
        local: &Local,
        absolute: bool,
    ) -> Row<P> {
        let mut out = Row::ZERO;
        if !kernels.cells.is_empty() {
            self.nodal.set(state.cells, state.location, a);
            let dofs = state.cells.dofs();
            let numbers = local.numbers();
            // SAFETY: the caller's; kernels of rank 1 write `dofs` numbers.
            unsafe {
                let (nodal, packed) = (&self.nodal, &mut self.packed);
                let element = &mut self.element[..dofs];
                state.tabulate(&kernels.cells, a, nodal, numbers, packed, element);
            };
            self.nodal.transposed(&self.element[..dofs], 1, &mut out.0);
            if absolute {
                out.0 = out.0.map(f64::abs);
            }
        }
        // SAFETY: the caller's.
        unsafe { self.points.add_vectors(&kernels.points, state, a, local, absolute, &mut out) };
        out
    }

    /// Matrix of the a-th active cell on its coefficients.
    ///
    /// # Safety
    /// As [`matrix`](super::matrix).
    pub(super) unsafe fn matrix(
        &mut self,
        state: &State,
        form: &Bilinear,
        a: usize,
        local: &Local,
        out: &mut [Row<P>],
    ) {
        out.fill(Row::ZERO);
        let (n, m) = (state.cells.dofs(), out.len());
        if !form.kernels.cells.is_empty() {
            self.nodal.set(state.cells, state.location, a);
            let nodal = &self.nodal;
            let numbers = local.numbers();
            // SAFETY: the caller's; kernels of rank 2 write `dofs x dofs` numbers.
            unsafe {
                let (packed, element) = (&mut self.packed, &mut self.element[..n * n]);
                state.tabulate(&form.kernels.cells, a, nodal, numbers, packed, element);
            };
            // T^T A, then (T^T (T^T A)^T)^T = T^T A T
            nodal.transposed(&self.element[..n * n], n, &mut self.half);
            transpose(&self.half[..m * n], n, &mut self.turned);
            nodal.transposed(&self.turned[..n * m], m, &mut self.half);
            for (i, row) in out.iter_mut().enumerate() {
                (0..m).for_each(|j| row.0[j] = self.half[j * m + i]);
            }
        }
        // SAFETY: the caller's.
        unsafe { self.points.add_matrices(&form.kernels.points, state, a, local, out) };
        for [left, right] in &form.couplings {
            // SAFETY: the caller's.
            let (left, right) = unsafe {
                let left = self.vector(state, left, a, local, false);
                (left, self.vector(state, right, a, local, false))
            };
            for (row, left) in out.iter_mut().zip(left.0) {
                row.add(left, &right);
            }
        }
    }
}

/// `a` is rows x columns; `out` becomes its transpose.
fn transpose(a: &[f64], columns: usize, out: &mut [f64]) {
    let rows = a.len() / columns;
    for (i, row) in a.chunks_exact(columns).enumerate() {
        for (j, value) in row.iter().enumerate() {
            out[j * rows + i] = *value;
        }
    }
}
