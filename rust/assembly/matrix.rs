//! Values of the reduced matrix.

use std::ops::Range;

use rayon::prelude::*;

use super::cell::Cells;
use super::kernel::{Bilinear, State, Work};
use super::pattern::Pattern;
use super::point::Row;
use super::selection::{self, Entry, Selection};
use super::{colours, with_rows, Shared};

/// The reduced matrix in its pattern: `P^T K P`; with `add`, it is added to the values. False if the pattern
/// does not contain these cells or belongs to another selection; `values` are then meaningless.
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
    add: bool,
) -> bool {
    // SAFETY: the caller's.
    unsafe { with_rows!(state.cells, matrix_of(state, form, selection, pattern, values, add)) }
}

/// Memory of one thread: the matrix of the cell and its unknowns.
struct Scatter<const P: usize> {
    work: Work<P>,
    entries: Vec<Entry>,
    /// Entries whose unknowns follow one another.
    runs: Vec<Range<usize>>,
    /// Places of the runs in the rows of the matrix. Those of the last cell are tried first: along a row of
    /// cells they hardly change.
    places: Vec<usize>,
    /// The matrix of the cell.
    of_cell: Vec<Row<P>>,
}

impl<const P: usize> Scatter<P> {
    fn new(cells: &Cells) -> Self {
        let (work, of_cell) = (Work::new(cells), vec![Row::ZERO; cells.local_len()]);
        let entries = Vec::with_capacity(of_cell.len());
        Self { work, entries, runs: Vec::new(), places: Vec::new(), of_cell }
    }
}

/// [`matrix`] for cells whose coefficients fit into rows of `P` numbers.
///
/// # Safety
/// As [`matrix`].
unsafe fn matrix_of<const P: usize>(
    state: &State,
    form: &Bilinear,
    selection: &Selection,
    pattern: &Pattern,
    values: &mut [f64],
    add: bool,
) -> bool {
    let (Some(start), Some(columns), Some(reaching)) = (
        pattern.start.as_slice(),
        pattern.columns.as_slice(),
        pattern.reaching(&state.location.active),
    ) else {
        return false;
    };
    if !add {
        values.par_chunks_mut(1 << 16).for_each(|part| part.fill(0.0));
    }
    let shared = Shared::new(values);
    let add_cell = |a: usize, scatter: &mut Scatter<P>| {
        let Scatter { work, entries, runs, places, of_cell } = scatter;
        let local = state.cells.local(state.location, a);
        selection.of_cell(&local, entries);
        // SAFETY: the caller's.
        unsafe { work.matrix(state, form, a, &local, of_cell) };
        selection::runs(entries, runs);
        places.resize(entries.len() * runs.len(), 0);
        for (places, &(r, k, wr)) in places.chunks_mut(runs.len().max(1)).zip(entries.iter()) {
            let row = start[r as usize] as usize..start[r as usize + 1] as usize;
            let columns = &columns[row.clone()];
            let mut latest = 0;
            for (place, run) in places.iter_mut().zip(runs.iter()) {
                let (c, l, wc) = entries[run.start];
                if columns.get(*place) != Some(&(c as i32)) {
                    let before = columns[latest..].iter().take_while(|&&x| x < c as i32);
                    *place = latest + before.count();
                }
                latest = *place;
                // ascending columns: if the first and the last are those of the run, so are all
                let last = run.len() - 1;
                let ends = [columns.get(latest), columns.get(latest + last)];
                if ends != [Some(&(c as i32)), Some(&(c as i32 + last as i32))] {
                    return false;
                }
                // SAFETY: inside the row. Rows of the grid of one colour share no unknown; the cells
                // whose unknowns reach further follow one after the other.
                let values = unsafe { shared.part(row.start + latest, run.len()) };
                let of_cell = &of_cell[k].0[l..];
                values.iter_mut().zip(of_cell).for_each(|(v, a)| *v += wr * wc * a);
            }
        }
        true
    };
    for rows in colours(state.location) {
        let fits = rows.into_par_iter().all(|row| {
            let mut scatter = Scatter::new(state.cells);
            row.filter(|&a| !reaching[a]).all(|a| add_cell(a, &mut scatter))
        });
        if !fits {
            return false;
        }
    }
    let mut scatter = Scatter::new(state.cells);
    (0..reaching.len()).filter(|&a| reaching[a]).all(|a| add_cell(a, &mut scatter))
}
