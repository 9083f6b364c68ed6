//! Element kernels over the active cells, straight into the reduced matrix.
//!
//! A kernel is the C function that FFCx made of one integral of the form: quadratic displacement and a linear
//! field on one cell. For each cell this module gathers the coefficients of the kernel (fields and
//! densities), calls it, transforms its result to the coefficients of the basis (`T^T A T`, T the
//! extraction of the cell) and adds that to known entries of a matrix in compressed rows. The result is
//! `P^T K P` without P, K or their product.
//!
//! Rows of cells along x are treated in colours. No two rows of one colour share a function, so they can
//! run at the same time; the order of summation does not depend on the number of threads.

mod cell;
mod kernel;
mod matrix;
mod pattern;
mod selection;

use std::ops::Range;

use rayon::prelude::*;

use crate::grid::Location;
use crate::space::{number_of, DIM, FUNCTIONS_1D, MAX_DOFS, ROWS};

pub use cell::Cells;
pub use kernel::{Bilinear, Kernel, Slot, State, TabulateTensor};
pub use matrix::matrix;
pub use pattern::{pattern, Pattern};
pub use selection::Selection;

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

// SAFETY: see `add`; whoever shares one keeps to disjoint indices.
unsafe impl Send for Shared {}
unsafe impl Sync for Shared {}

impl Shared {
    fn new(values: &mut [f64]) -> Self {
        Self { start: values.as_mut_ptr(), len: values.len() }
    }

    /// # Safety
    /// The index is inside the slice, and no other thread uses it at the same time.
    unsafe fn add(self, index: usize, value: f64) {
        debug_assert!(index < self.len, "index outside the shared slice");
        // SAFETY: inside the slice, and the caller is alone with this index.
        unsafe { *self.start.add(index) += value };
    }
}

/// The form's vector on all coefficients: `E^T r`.
///
/// # Safety
/// Each kernel is a loaded FFCx kernel of rank 1 of these cells. It reads as many coefficients as its slots
/// have and as many constants as it has. The coefficients are those of all fields.
pub unsafe fn vector(state: &State, kernels: &[Kernel]) -> Vec<f64> {
    let mut sums = vec![0.0; state.coefficients.len()];
    let shared = Shared::new(&mut sums);
    for rows in colours(state.location) {
        rows.into_par_iter().for_each(|row| {
            let (mut packed, mut element) = (Vec::new(), [0.0; MAX_DOFS]);
            let mut reduced = [0.0; MAX_DOFS];
            let element = &mut element[..state.cells.dofs()];
            for a in row {
                let local = state.cells.local(state.location, a);
                // SAFETY: the caller's; kernels of rank 1 write `dofs` numbers.
                unsafe { state.tabulate(kernels, a, &local, &mut packed, element) };
                local.transposed(element, 1, &mut reduced);
                for (&c, &value) in local.numbers().iter().zip(&reduced) {
                    // SAFETY: the coefficient is one of all; rows of one colour share none.
                    unsafe { shared.add(c, value) };
                }
            }
        });
    }
    sums
}
