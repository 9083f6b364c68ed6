//! Element kernels over the active cells, straight into the reduced matrix.
//!
//! A kernel is the C function that FFCx made of one integral of the form: biquadratic displacement
//! and a bilinear field on one cell. Cell by cell this module gathers what it reads (fields and
//! densities), calls it, passes its result to spline coefficients (`T^T A T`, T the extraction of
//! the cell) and adds that to known slots of a CSR matrix, `P^T K P` without P, K or their product.
//!
//! Rows of cells go in three colours, so that no two that run at the same time share a function;
//! the order of summation does not depend on the number of threads.

use std::ffi::c_void;

use ndarray::ArrayView2;
use rayon::prelude::*;

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
const MAX_DOFS: usize = DISPLACEMENT + 4;

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
struct Local {
    /// Index of each local coefficient: function by function, two components; then the vertices.
    coefficients: Vec<usize>,
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

    /// Number of coefficients of all fields on a grid.
    #[must_use]
    pub fn coefficients(&self, cells: [usize; 2]) -> usize {
        let vertices = if self.bilinear { (cells[0] + 1) * (cells[1] + 1) } else { 0 };
        2 * self.basis.len(cells[0]) * self.basis.len(cells[1]) + vertices
    }

    fn local(&self, location: &Location, a: usize) -> Local {
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
            let first = 2 * row * self.basis.len(ny);
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
    fn transposed(&self, a: &[f64], columns: usize, out: &mut [f64]) {
        let of_u = 2 * self.functions * columns;
        out[..of_u].fill(0.0);
        for (node, value) in self.values.iter().enumerate() {
            for k in 0..2 {
                let row = &a[(2 * node + k) * columns..][..columns];
                for (f, v) in value.iter().take(self.functions).enumerate() {
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

/// Sum of the kernels' results on the a-th active cell, into `element`.
///
/// # Safety
/// As [`vector`] and [`matrix`]; `element` is as long as the kernels write.
unsafe fn tabulate(
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

/// Active cells in runs of one row of the grid, in three colours: within a colour no two rows share
/// a function.
fn colours(location: &Location) -> [Vec<std::ops::Range<usize>>; 3] {
    let mut colours: [Vec<std::ops::Range<usize>>; 3] = Default::default();
    let row = |a: usize| location.active[a] as usize / location.grid.cells[0];
    let mut start = 0;
    for a in 1..=location.active.len() {
        if a == location.active.len() || row(a) != row(start) {
            colours[row(start) % 3].push(start..a);
            start = a;
        }
    }
    colours
}

/// A slice that several threads add to, at indices that no two of them share.
#[derive(Clone, Copy)]
struct Shared {
    start: *mut f64,
    len: usize,
}

// SAFETY: see `add`; who shares one keeps to disjoint indices.
unsafe impl Send for Shared {}
unsafe impl Sync for Shared {}

impl Shared {
    fn new(values: &mut [f64]) -> Self {
        Self { start: values.as_mut_ptr(), len: values.len() }
    }

    /// # Safety
    /// The index is inside the slice, and no other thread touches it at the same time.
    unsafe fn add(self, index: usize, value: f64) {
        debug_assert!(index < self.len, "index outside the shared slice");
        // SAFETY: inside the slice, and the caller is alone with this index.
        unsafe { *self.start.add(index) += value };
    }
}

/// The form's vector on all coefficients: `E^T r`.
///
/// # Safety
/// Each kernel is an FFCx kernel of rank 1 of these cells, loaded, that reads as many coefficients as
/// its slots have and as many constants as it has; `coefficients` are those of all fields.
pub unsafe fn vector(
    cells: &Cells,
    kernels: &[Kernel],
    location: &Location,
    volume: &[f64],
    coefficients: &[f64],
) -> Vec<f64> {
    let mut sums = vec![0.0; coefficients.len()];
    let shared = Shared::new(&mut sums);
    for rows in colours(location) {
        rows.into_par_iter().for_each(|row| {
            let (mut packed, mut element) = (Vec::new(), [0.0; MAX_DOFS]);
            let mut reduced = [0.0; MAX_DOFS];
            for a in row {
                let local = cells.local(location, a);
                let at = (a, &local, coefficients);
                let element = &mut element[..cells.dofs()];
                // SAFETY: the caller's; kernels of rank 1 write `dofs` numbers.
                unsafe { tabulate(cells, kernels, location, volume, at, &mut packed, element) };
                local.transposed(element, 1, &mut reduced);
                for (&c, &value) in local.coefficients.iter().zip(&reduced) {
                    // SAFETY: a local coefficient is one of all; rows of one colour share none.
                    unsafe { shared.add(c, value) };
                }
            }
        });
    }
    sums
}

/// S as compressed rows: the unknowns behind each coefficient and their weights.
#[derive(Debug, Clone, Copy)]
pub struct Selection<'a> {
    /// Start of each coefficient's entries; one more than coefficients.
    pub start: &'a [i32],
    /// Unknown of each entry.
    pub unknown: &'a [i32],
    /// Weight of each entry.
    pub weight: &'a [f64],
    /// Coefficient that each unknown is.
    pub unknowns: &'a [i64],
}

impl<'a> Selection<'a> {
    fn of(&self, coefficient: usize) -> impl Iterator<Item = (u32, f64)> + use<'a> {
        let range = self.start[coefficient] as usize..self.start[coefficient + 1] as usize;
        let (unknown, weight) = (&self.unknown[range.clone()], &self.weight[range]);
        unknown.iter().zip(weight).map(|(&u, &w)| (u as u32, w))
    }

    /// Unknowns of a cell: unknown, local coefficient, weight; by unknown. And whether each belongs
    /// to this cell's own functions (a point constraint reaches further).
    fn of_cell(&self, local: &Local) -> (Vec<(u32, usize, f64)>, bool) {
        let mut entries = Vec::with_capacity(MAX_DOFS);
        let mut own = true;
        for (k, &c) in local.coefficients.iter().enumerate() {
            let before = entries.len();
            entries.extend(self.of(c).map(|(u, w)| (u, k, w)));
            own &= entries[before..].iter().all(|e| self.unknowns[e.0 as usize] == c as i64);
        }
        entries.sort_unstable_by_key(|e| (e.0, e.1));
        (entries, own)
    }
}

/// Pattern of the reduced matrix.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Start of each row in `columns`; one more than rows.
    pub start: Vec<i32>,
    /// Columns of the rows, ascending.
    pub columns: Vec<i32>,
    /// Active cells whose unknowns reach beyond their own functions (point constraints), ascending.
    pub reaching: Vec<u32>,
}

/// Pattern of the reduced matrix; `None` if it has more entries than its indices can count.
#[must_use]
pub fn pattern(cells: &Cells, location: &Location, selection: &Selection) -> Option<Pattern> {
    let (unknowns, own): (Vec<Vec<u32>>, Vec<bool>) = (0..location.active.len())
        .into_par_iter()
        .map(|a| {
            let (entries, own) = selection.of_cell(&cells.local(location, a));
            let mut mine: Vec<u32> = entries.into_iter().map(|e| e.0).collect();
            mine.dedup();
            (mine, own)
        })
        .unzip();
    let reaching = (0..).zip(&own).filter(|(_, own)| !**own).map(|(a, _)| a).collect();
    let mut first = vec![0usize; selection.unknowns.len() + 1];
    for &u in unknowns.iter().flatten() {
        first[u as usize + 1] += 1;
    }
    for u in 0..selection.unknowns.len() {
        first[u + 1] += first[u];
    }
    let mut cells_of = vec![0u32; first[selection.unknowns.len()]];
    let mut next = first.clone();
    for (a, mine) in unknowns.iter().enumerate() {
        for &u in mine {
            cells_of[next[u as usize]] = a as u32;
            next[u as usize] += 1;
        }
    }
    let rows: Vec<Vec<i32>> = (0..selection.unknowns.len())
        .into_par_iter()
        .map(|u| {
            let around = &cells_of[first[u]..first[u + 1]];
            let columns = around.iter().flat_map(|&a| &unknowns[a as usize]);
            let mut row: Vec<i32> = columns.map(|&c| c as i32).collect();
            row.sort_unstable();
            row.dedup();
            row
        })
        .collect();
    let mut start = Vec::with_capacity(selection.unknowns.len() + 1);
    let mut end = 0;
    start.push(0);
    for row in &rows {
        end += row.len();
        start.push(i32::try_from(end).ok()?);
    }
    Some(Pattern { start, columns: rows.concat(), reaching })
}

/// The reduced matrix in its pattern: `P^T K P`. False if the pattern is not that of these cells and
/// this selection; `values` are then of no use.
///
/// # Safety
/// As [`vector`], with kernels of rank 2; `values` is as long as the columns of the pattern, whose
/// rows are disjoint (`start` ascends).
#[allow(clippy::too_many_arguments)]
pub unsafe fn matrix(
    cells: &Cells,
    kernels: &[Kernel],
    location: &Location,
    volume: &[f64],
    coefficients: &[f64],
    selection: &Selection,
    pattern: &Pattern,
    values: &mut [f64],
) -> bool {
    values.fill(0.0);
    let shared = Shared::new(values);
    let add = |a: usize, reaching: bool, packed: &mut Vec<f64>, work: &mut Work| {
        let local = cells.local(location, a);
        let (entries, own) = selection.of_cell(&local);
        if own == reaching {
            return true;
        }
        let (n, m) = (cells.dofs(), local.coefficients.len());
        let element = &mut work.element[..n * n];
        let at = (a, &local, coefficients);
        // SAFETY: the caller's; kernels of rank 2 write `dofs x dofs` numbers.
        unsafe { tabulate(cells, kernels, location, volume, at, packed, element) };
        // T^T A, then (T^T (T^T A)^T)^T = T^T A T
        local.transposed(element, n, &mut work.half);
        transpose(&work.half[..m * n], n, &mut work.turned);
        local.transposed(&work.turned[..n * m], m, &mut work.reduced);
        for &(r, k, wr) in &entries {
            let row = pattern.start[r as usize] as usize..pattern.start[r as usize + 1] as usize;
            let columns = &pattern.columns[row.clone()];
            let mut slot = 0;
            for &(c, l, wc) in &entries {
                slot += columns[slot..].iter().take_while(|&&x| x < c as i32).count();
                if columns.get(slot) != Some(&(c as i32)) {
                    return false;
                }
                // SAFETY: inside the row. In parallel, rows of the grid of one colour share no
                // unknown; the cells whose unknowns reach further come one after the other.
                unsafe { shared.add(row.start + slot, wr * wc * work.reduced[l * m + k]) };
            }
        }
        true
    };
    for rows in colours(location) {
        let fits = rows.into_par_iter().all(|mut row| {
            let (mut packed, mut work) = (Vec::new(), Work::new());
            row.all(|a| add(a, false, &mut packed, &mut work))
        });
        if !fits {
            return false;
        }
    }
    let (mut packed, mut work) = (Vec::new(), Work::new());
    pattern.reaching.iter().all(|&a| add(a as usize, true, &mut packed, &mut work))
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

/// Element matrices on their way to the coefficients.
struct Work {
    element: [f64; MAX_DOFS * MAX_DOFS],
    half: [f64; MAX_DOFS * MAX_DOFS],
    turned: [f64; MAX_DOFS * MAX_DOFS],
    reduced: [f64; MAX_DOFS * MAX_DOFS],
}

impl Work {
    fn new() -> Self {
        let zero = [0.0; MAX_DOFS * MAX_DOFS];
        Self { element: zero, half: zero, turned: zero, reduced: zero }
    }
}
