//! One cell: what a kernel reads, its call, and the extraction of its splines.

use std::ffi::c_void;

use ndarray::ArrayView2;

use crate::adjoint::{cell_mean, Densities};
use crate::basis::Basis;
use crate::grid::Location;

/// Signature of an FFCx kernel: element tensor, coefficients, constants, coordinates of the vertices
/// (3 each), local facet, permutations, user data. FFCx has the last from 0.10 on; a function without
/// it leaves it unread under the calling conventions of Linux on x86-64 and AArch64 (caller cleans
/// up), which are those that Debian's dolfinx is built for.
pub type TabulateTensor = unsafe extern "C" fn(
    *mut f64,
    *const f64,
    *const f64,
    *const f64,
    *const i32,
    *const u8,
    *mut c_void,
);

/// Degrees of freedom of a cell: 9 nodes with 2 components, then 4 vertices.
const DISPLACEMENT: usize = 18;
pub(super) const MAX_DOFS: usize = DISPLACEMENT + 4;

/// One coefficient that a kernel reads, in packed order.
pub enum Slot<'a> {
    /// Values of the fields at the degrees of freedom of the cell.
    Fields,
    /// Densities of one array of particle data.
    Densities(Densities<'a>, ArrayView2<'a, f64>),
    /// Means over the particles of the cell.
    Means(&'a [usize], ArrayView2<'a, f64>),
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

/// A kernel with what it reads.
pub struct Kernel<'a> {
    /// The C function.
    pub tabulate: TabulateTensor,
    /// Its coefficients in packed order.
    pub slots: Vec<Slot<'a>>,
    /// Its constants.
    pub constants: Vec<f64>,
}

/// What the matrix of a cell is made of: `sum kernels + sum left right^T`.
pub struct Bilinear<'a> {
    /// Kernels of rank 2.
    pub kernels: Vec<Kernel<'a>>,
    /// Pairs of kernels of rank 1, whose products couple what is taken at the particles with what is
    /// taken at the cell's centre (B-bar).
    pub couplings: Vec<[Kernel<'a>; 2]>,
}

/// Where the kernels' degrees of freedom are in a cell, and the coefficients behind them.
#[derive(Debug, Clone)]
pub struct Cells {
    /// Basis of the displacement.
    pub basis: Basis,
    /// Position 0, 1 or 2 along x and y of each biquadratic node.
    pub nodes: [[usize; 2]; 9],
    /// Position 0 or 1 along x and y of each vertex.
    pub vertices: [[usize; 2]; 4],
    /// Whether there is a bilinear field besides the displacement.
    pub bilinear: bool,
}

/// Coefficients of the fields on one cell and the extraction that gives the nodal values.
pub(super) struct Local {
    /// Index of each local coefficient: function by function, two components; then the vertices.
    pub coefficients: Vec<usize>,
    /// `values[node][function]` of the displacement.
    values: [[f64; 9]; 9],
    functions: usize,
}

impl Cells {
    /// Number of degrees of freedom of a kernel.
    #[must_use]
    pub fn dofs(&self) -> usize {
        DISPLACEMENT + if self.bilinear { 4 } else { 0 }
    }

    /// Number of displacement coefficients on a grid; those of the bilinear field follow.
    #[must_use]
    pub fn displacement(&self, cells: [usize; 2]) -> usize {
        2 * self.basis.len(cells[0]) * self.basis.len(cells[1])
    }

    /// Number of coefficients of all fields on a grid.
    #[must_use]
    pub fn coefficients(&self, cells: [usize; 2]) -> usize {
        let vertices = if self.bilinear { (cells[0] + 1) * (cells[1] + 1) } else { 0 };
        self.displacement(cells) + vertices
    }

    pub(super) fn local(&self, location: &Location, a: usize) -> Local {
        let [nx, ny] = location.grid.cells;
        let [i, j] = location.grid.cell_ij(location.active[a] as usize);
        let width = self.basis.per_cell();
        let (at_x, at_y) = (
            [0.0, 0.5, 1.0].map(|t| self.basis.at(nx, i, t).value),
            [0.0, 0.5, 1.0].map(|t| self.basis.at(ny, j, t).value),
        );
        let mut local = Local {
            coefficients: Vec::with_capacity(MAX_DOFS),
            values: [[0.0; 9]; 9],
            functions: width * width,
        };
        for (value, &[p, q]) in local.values.iter_mut().zip(&self.nodes) {
            for b in 0..width {
                for a in 0..width {
                    value[a + width * b] = at_x[p][a] * at_y[q][b];
                }
            }
        }
        let row = self.basis.len(nx);
        for b in 0..width {
            for a in 0..width {
                let function = self.basis.first(i) + a + row * (self.basis.first(j) + b);
                local.coefficients.extend([2 * function, 2 * function + 1]);
            }
        }
        if self.bilinear {
            let first = self.displacement([nx, ny]);
            let at = |&[p, q]: &[usize; 2]| first + i + p + (nx + 1) * (j + q);
            local.coefficients.extend(self.vertices.iter().map(at));
        }
        local
    }

    /// Vertices of a cell in the kernels' order, three coordinates each, from the cell's own corner:
    /// no form names the position, and far from the origin the cell's size would be rounded.
    fn vertices_of_cell(&self, h: f64) -> [f64; 12] {
        let mut x = [0.0; 12];
        for (k, position) in self.vertices.iter().enumerate() {
            for axis in 0..2 {
                x[3 * k + axis] = h * position[axis] as f64;
            }
        }
        x
    }
}

impl Local {
    /// Values at the degrees of freedom: `T c`.
    fn nodal(&self, coefficients: &[f64], out: &mut [f64]) {
        for (node, value) in self.values.iter().enumerate() {
            for k in 0..2 {
                let term = |f: usize| value[f] * coefficients[self.coefficients[2 * f + k]];
                out[2 * node + k] = (0..self.functions).map(term).sum();
            }
        }
        let vertices = &self.coefficients[2 * self.functions..];
        for (o, &c) in out[DISPLACEMENT..].iter_mut().zip(vertices) {
            *o = coefficients[c];
        }
    }

    /// `T^T a` for `columns` vectors at once: `a` is degrees of freedom x columns.
    pub fn transposed(&self, a: &[f64], columns: usize, out: &mut [f64]) {
        let of_u = 2 * self.functions * columns;
        out[..of_u].fill(0.0);
        for (node, value) in self.values.iter().enumerate() {
            for k in 0..2 {
                let row = &a[(2 * node + k) * columns..][..columns];
                for (f, v) in value.iter().take(self.functions).enumerate() {
                    if *v == 0.0 {
                        continue;
                    }
                    let target = &mut out[(2 * f + k) * columns..][..columns];
                    for (t, r) in target.iter_mut().zip(row) {
                        *t += v * r;
                    }
                }
            }
        }
        let rest = &a[DISPLACEMENT * columns..];
        out[of_u..][..rest.len()].copy_from_slice(rest);
    }
}

impl Bilinear<'_> {
    /// Matrix of the a-th active cell, into `element`.
    ///
    /// # Safety
    /// As [`matrix`](super::matrix).
    pub(super) unsafe fn tabulate(
        &self,
        cells: &Cells,
        location: &Location,
        volume: &[f64],
        at: (usize, &Local, &[f64]),
        packed: &mut Vec<f64>,
        element: &mut [f64],
    ) {
        // SAFETY: the caller's; kernels of rank 2 write `dofs x dofs` numbers.
        unsafe { tabulate(cells, &self.kernels, location, volume, at, packed, element) };
        let n = cells.dofs();
        for pair in &self.couplings {
            let mut sides = [[0.0; MAX_DOFS]; 2];
            for (kernel, side) in pair.iter().zip(&mut sides) {
                let kernel = std::slice::from_ref(kernel);
                // SAFETY: the caller's; kernels of rank 1 write `dofs` numbers.
                unsafe { tabulate(cells, kernel, location, volume, at, packed, &mut side[..n]) };
            }
            for (row, left) in element.chunks_exact_mut(n).zip(&sides[0]) {
                row.iter_mut().zip(&sides[1]).for_each(|(e, right)| *e += left * right);
            }
        }
    }
}

/// Sum of the kernels' results on the a-th active cell, into `element`.
///
/// # Safety
/// As [`vector`] and [`matrix`]; `element` is as long as the kernels write.
pub(super) unsafe fn tabulate(
    cells: &Cells,
    kernels: &[Kernel],
    location: &Location,
    volume: &[f64],
    (a, local, coefficients): (usize, &Local, &[f64]),
    packed: &mut Vec<f64>,
    element: &mut [f64],
) {
    element.fill(0.0);
    let x = cells.vertices_of_cell(location.grid.h);
    for kernel in kernels {
        packed.clear();
        for slot in &kernel.slots {
            let start = packed.len();
            packed.resize(start + slot.len(cells), 0.0);
            let out = &mut packed[start..];
            match slot {
                Slot::Fields => local.nodal(coefficients, out),
                Slot::Densities(densities, data) => {
                    densities.of_cell(location, a, volume, *data, out);
                }
                Slot::Means(columns, data) => cell_mean(location, a, volume, *data, columns, out),
            }
        }
        // SAFETY: the caller vouches for the kernel and the length of `element`; for integrals over
        // cells, facet, permutations and user data are not read.
        unsafe {
            (kernel.tabulate)(
                element.as_mut_ptr(),
                packed.as_ptr(),
                kernel.constants.as_ptr(),
                x.as_ptr(),
                std::ptr::null(),
                std::ptr::null(),
                std::ptr::null_mut(),
            );
        }
    }
}
