//! Element kernels: the coefficients that they read, and their call.

use std::ffi::c_void;

use ndarray::ArrayView2;

use super::cell::{Cells, Local, Vertices};
use crate::grid::Location;
use crate::space::MAX_DOFS;
use crate::transfer::cells::mean_of_cell;
use crate::transfer::densities::Densities;

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
    /// Densities of one array of particle data.
    Densities(Densities<'a>, ArrayView2<'a, f64>),
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
}

/// The matrix of a cell: `sum kernels + sum left right^T`.
pub struct Bilinear<'a> {
    /// Kernels of rank 2.
    pub kernels: Vec<Kernel<'a>>,
    /// Pairs of kernels of rank 1. Their products couple terms at the particles with terms at the centre
    /// of the cell (B-bar).
    pub couplings: Vec<[Kernel<'a>; 2]>,
}

/// The state of an assembly that all cells share.
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
            Slot::Densities(densities, _) => densities.len(),
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
    pub(super) unsafe fn tabulate(
        &self,
        kernels: &[Kernel],
        a: usize,
        local: &Local,
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
                    Slot::Fields => local.nodal(self.coefficients, out),
                    Slot::Densities(densities, data) => {
                        densities.of_cell(self.location, a, self.volume, *data, out);
                    }
                    Slot::Means(columns, data) => {
                        mean_of_cell(self.location, a, self.volume, *data, columns, out);
                    }
                }
            }
            // SAFETY: the caller vouches for the kernel and the length of `element`. Integrals over cells
            // do not read facet, permutations and user data.
            unsafe {
                (kernel.tabulate)(
                    element.as_mut_ptr(),
                    packed.as_ptr(),
                    kernel.constants.as_ptr(),
                    self.vertices.as_ptr(),
                    std::ptr::null(),
                    std::ptr::null(),
                    std::ptr::null_mut(),
                );
            }
        }
    }

    /// Matrix of the a-th active cell, into `element`.
    ///
    /// # Safety
    /// As [`matrix`](super::matrix).
    pub(super) unsafe fn tabulate_matrix(
        &self,
        form: &Bilinear,
        a: usize,
        local: &Local,
        packed: &mut Vec<f64>,
        element: &mut [f64],
    ) {
        // SAFETY: the caller's; kernels of rank 2 write `dofs x dofs` numbers.
        unsafe { self.tabulate(&form.kernels, a, local, packed, element) };
        let n = self.cells.dofs();
        for pair in &form.couplings {
            let mut sides = [[0.0; MAX_DOFS]; 2];
            for (kernel, side) in pair.iter().zip(&mut sides) {
                let kernel = std::slice::from_ref(kernel);
                // SAFETY: the caller's; kernels of rank 1 write `dofs` numbers.
                unsafe { self.tabulate(kernel, a, local, packed, &mut side[..n]) };
            }
            for (row, left) in element.chunks_exact_mut(n).zip(&sides[0]) {
                row.iter_mut().zip(&sides[1]).for_each(|(e, right)| *e += left * right);
            }
        }
    }
}
