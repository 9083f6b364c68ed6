//! Element kernels over the active cells, straight into the reduced matrix.
//!
//! A kernel is the C function that FFCx made of one integral of the form: biquadratic displacement
//! and a bilinear field on one cell. Cell by cell this module gathers what it reads (fields and
//! densities), calls it, passes its result to spline coefficients (`T^T A T`, T the extraction of
//! the cell) and adds that to known slots of a CSR matrix, `P^T K P` without P, K or their product.
//!
//! Rows of cells go in three colours, so that no two that run at the same time share a function;
//! the order of summation does not depend on the number of threads.

mod element;
mod reduced;

use rayon::prelude::*;

use crate::grid::Location;

pub use element::{Bilinear, Cells, Kernel, Slot, TabulateTensor};
pub use reduced::{matrix, pattern, Pattern, Selection};

use element::{tabulate, MAX_DOFS};

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
