//! Element kernels over the active cells, straight into the reduced matrix.
//!
//! A kernel is the C function that FFCx made of a part of the form: of the integrand of sums over particles at
//! one point (`point`), or of an integral over a cell with Lagrange elements for the fields. For each
//! cell this module gathers the coefficients of the kernels, calls them, brings their results to the
//! coefficients of the basis (with the functions at the point, or `T^T A T`, T the extraction of the
//! cell) and adds that to known entries of a matrix in compressed rows. The result is `P^T K P` without P, K
//! or their product.
//!
//! Rows of cells along x are treated in colours. No two rows of one colour share a function, so they can
//! run at the same time; the order of summation does not depend on the number of threads.

mod cell;
mod kernel;
mod matrix;
mod pattern;
mod point;
mod reference;
mod selection;

use std::ops::Range;

use rayon::prelude::*;

use crate::grid::Location;
use crate::space::{number_of, DIM, FUNCTIONS_1D, ROWS};
use kernel::Work;

pub use cell::{Cells, Field};
pub use kernel::{Bilinear, Kernel, Kernels, Slot, State, TabulateTensor};
pub use matrix::matrix;
pub use pattern::{pattern, Pattern};
pub use point::{Entries, Entry, Place, PointKernel, PointSlot};
pub use reference::Reference;
pub use selection::Selection;

/// Most coefficients of all fields on a cell.
pub const MAX_COEFFICIENTS: usize = 64;

/// Call a function for rows long enough for the coefficients of a cell. The length is constant, which the
/// compiler turns into vector instructions without loops.
macro_rules! with_rows {
    ($cells:expr, $function:ident($($argument:expr),*)) => {
        match $cells.local_len().div_ceil(8) {
            0 | 1 => $function::<8>($($argument),*),
            2 => $function::<16>($($argument),*),
            3 => $function::<24>($($argument),*),
            4 => $function::<32>($($argument),*),
            5 | 6 => $function::<48>($($argument),*),
            _ => $function::<{ crate::assembly::MAX_COEFFICIENTS }>($($argument),*),
        }
    };
}
use with_rows;

/// Active cells in rows along x, in colours: within a colour no two rows share a function, since a function
/// reaches over as many rows as a cell has rows of functions.
fn colours(location: &Location) -> [Vec<Range<usize>>; ROWS] {
    let mut colours: [Vec<Range<usize>>; ROWS] = Default::default();
    for row in location.rows() {
        let mut index = location.active_index(row.start).map(|i| i % FUNCTIONS_1D);
        index[0] = 0;
        colours[number_of(index, [FUNCTIONS_1D; DIM]) / FUNCTIONS_1D].push(row);
    }
    colours
}

/// A slice that several threads add to, at indices that no two of them share.
#[derive(Clone, Copy)]
struct Shared {
    start: *mut f64,
    len: usize,
}

// SAFETY: see `add`; users of a shared one write to disjoint indices only.
unsafe impl Send for Shared {}
unsafe impl Sync for Shared {}

impl Shared {
    fn new(values: &mut [f64]) -> Self {
        Self { start: values.as_mut_ptr(), len: values.len() }
    }

    /// Part of the slice.
    ///
    /// # Safety
    /// The part is inside the slice, and no other thread uses it at the same time.
    unsafe fn part<'a>(self, start: usize, len: usize) -> &'a mut [f64] {
        debug_assert!(start + len <= self.len, "part outside the shared slice");
        // SAFETY: inside the slice, and the caller is alone with this part.
        unsafe { std::slice::from_raw_parts_mut(self.start.add(start), len) }
    }

    /// # Safety
    /// The index is inside the slice, and no other thread uses it at the same time.
    unsafe fn add(self, index: usize, value: f64) {
        debug_assert!(index < self.len, "index outside the shared slice");
        // SAFETY: inside the slice, and the caller is alone with this index.
        unsafe { *self.start.add(index) += value };
    }
}

/// The form's vector on all coefficients: `E^T r`. With `absolute`, the sums of the absolute values of what
/// each point, and each cell with integrals, contributes to it.
///
/// # Safety
/// Each kernel is a loaded FFCx kernel of rank 1 of these cells. It reads as many coefficients as its slots
/// have and as many constants as it has. The coefficients are those of all fields.
pub unsafe fn vector(state: &State, kernels: &Kernels, absolute: bool) -> Vec<f64> {
    // SAFETY: the caller's.
    unsafe { with_rows!(state.cells, vector_of(state, kernels, absolute)) }
}

/// [`vector`] for cells whose coefficients fit into rows of `P` numbers.
///
/// # Safety
/// As [`vector`].
unsafe fn vector_of<const P: usize>(state: &State, kernels: &Kernels, absolute: bool) -> Vec<f64> {
    let mut sums = vec![0.0; state.coefficients.len()];
    let shared = Shared::new(&mut sums);
    for rows in colours(state.location) {
        rows.into_par_iter().for_each(|row| {
            let mut work = Work::<P>::new(state.cells);
            for a in row {
                let local = state.cells.local(state.location, a);
                // SAFETY: the caller's.
                let of_cell = unsafe { work.vector(state, kernels, a, &local, absolute) };
                for (&c, &value) in local.numbers().iter().zip(&of_cell.0) {
                    // SAFETY: the coefficient is one of all; rows of one colour share none.
                    unsafe { shared.add(c, value) };
                }
            }
        });
    }
    sums
}
