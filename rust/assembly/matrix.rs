//! Values of the reduced matrix.

use rayon::prelude::*;

use super::kernel::{Bilinear, State};
use super::pattern::Pattern;
use super::selection::{Entry, Selection};
use super::{colours, Shared};
use crate::space::MAX_DOFS;

/// The reduced matrix in its pattern: `P^T K P`. False if the pattern does not belong to these cells and this
/// selection; `values` are then meaningless.
///
/// # Safety
/// As [`vector`](super::vector), with kernels of the ranks that [`Bilinear`] says. `values` is as long as the
/// columns of the pattern, whose rows are disjoint (`start` ascends).
pub unsafe fn matrix(
    state: &State,
    form: &Bilinear,
    selection: &Selection,
    pattern: &Pattern,
    values: &mut [f64],
) -> bool {
    values.par_chunks_mut(1 << 16).for_each(|part| part.fill(0.0));
    let (Some(start), Some(columns)) = (pattern.start.as_slice(), pattern.columns.as_slice())
    else {
        return false;
    };
    let shared = Shared::new(values);
    let add = |a: usize, work: &mut Work| {
        // SAFETY: the caller's.
        unsafe { work.reduce(state, form, selection, a) };
        let Work { entries, places, reduced, width, .. } = work;
        let n = entries.len();
        places.resize(n * n, 0);
        for (places, &(r, k, wr)) in places.chunks_mut(n.max(1)).zip(entries.iter()) {
            let row = start[r as usize] as usize..start[r as usize + 1] as usize;
            let columns = &columns[row.clone()];
            let mut latest = 0;
            for (place, &(c, l, wc)) in places.iter_mut().zip(entries.iter()) {
                if columns.get(*place) != Some(&(c as i32)) {
                    let before = columns[latest..].iter().take_while(|&&x| x < c as i32);
                    *place = latest + before.count();
                    if columns.get(*place) != Some(&(c as i32)) {
                        return false;
                    }
                }
                latest = *place;
                let value = wr * wc * reduced[l * *width + k];
                // SAFETY: inside the row. Rows of the grid of one colour share no unknown; the cells
                // whose unknowns reach further follow one after the other.
                unsafe { shared.add(row.start + latest, value) };
            }
        }
        true
    };
    for rows in colours(state.location) {
        let fits = rows.into_par_iter().all(|row| {
            let mut work = Work::new();
            row.filter(|&a| !pattern.reaching[a]).all(|a| add(a, &mut work))
        });
        if !fits {
            return false;
        }
    }
    let mut work = Work::new();
    (0..pattern.reaching.len()).filter(|&a| pattern.reaching[a]).all(|a| add(a, &mut work))
}

/// Memory of one thread: coefficients of the kernels, unknowns of the cell, and the matrix of the cell on its
/// way to the coefficients.
struct Work {
    packed: Vec<f64>,
    entries: Vec<Entry>,
    /// Places of the cell's entries in the rows of the matrix. Those of the last cell are tried first: along
    /// a row of cells they hardly change.
    places: Vec<usize>,
    element: [f64; MAX_DOFS * MAX_DOFS],
    half: [f64; MAX_DOFS * MAX_DOFS],
    turned: [f64; MAX_DOFS * MAX_DOFS],
    /// `T^T A T`, transposed.
    reduced: [f64; MAX_DOFS * MAX_DOFS],
    /// Number of its columns.
    width: usize,
}

impl Work {
    fn new() -> Self {
        let zero = [0.0; MAX_DOFS * MAX_DOFS];
        Self {
            packed: Vec::new(),
            entries: Vec::with_capacity(MAX_DOFS),
            places: Vec::new(),
            element: zero,
            half: zero,
            turned: zero,
            reduced: zero,
            width: 0,
        }
    }

    /// The matrix of the a-th active cell and its unknowns.
    ///
    /// # Safety
    /// As [`matrix`].
    unsafe fn reduce(&mut self, state: &State, form: &Bilinear, selection: &Selection, a: usize) {
        let local = state.cells.local(state.location, a);
        selection.of_cell(&local, &mut self.entries);
        let (n, m) = (state.cells.dofs(), local.numbers().len());
        let element = &mut self.element[..n * n];
        // SAFETY: the caller's.
        unsafe { state.tabulate_matrix(form, a, &local, &mut self.packed, element) };
        // T^T A, then (T^T (T^T A)^T)^T = T^T A T
        local.transposed(element, n, &mut self.half);
        transpose(&self.half[..m * n], n, &mut self.turned);
        local.transposed(&self.turned[..n * m], m, &mut self.reduced);
        self.width = m;
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
