//! The matrix of the unknowns that the supports leave: its pattern, and its values.

use rayon::prelude::*;

use super::element::{tabulate, Cells, Kernel, Local, MAX_DOFS};
use super::{colours, Shared};
use crate::grid::Location;

/// S as compressed rows: the unknowns behind each coefficient and their weights.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Start of each coefficient's entries; one more than coefficients.
    pub start: Vec<i32>,
    /// Unknown of each entry.
    pub unknown: Vec<i32>,
    /// Weight of each entry.
    pub weight: Vec<f64>,
    /// Coefficient that each unknown is.
    pub unknowns: Vec<i64>,
}

impl Selection {
    fn of(&self, coefficient: usize) -> impl Iterator<Item = (u32, f64)> + '_ {
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
