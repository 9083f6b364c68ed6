//! The matrix of the unknowns that the supports leave: its pattern, and its values.

use std::collections::BTreeMap;

use ndarray::Array1;
use rayon::prelude::*;

use super::element::{Bilinear, Cells, Local, MAX_DOFS};
use super::{colours, Shared};
use crate::active::{support, Active};
use crate::basis::Basis;
use crate::grid::Location;

/// S as compressed rows: the unknowns behind each coefficient and their weights.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Start of each coefficient's entries; one more than coefficients.
    start: Vec<i32>,
    /// Unknown of each entry.
    unknown: Vec<i32>,
    /// Weight of each entry.
    weight: Vec<f64>,
    /// Coefficient that each unknown is.
    coefficient: Vec<i64>,
    /// The unknown that each coefficient is; -1 for held ones and those of a point constraint.
    own: Vec<i32>,
}

impl Selection {
    /// From the compressed rows and the coefficient that each unknown is; `None` if they are not
    /// those of `coefficients` coefficients.
    #[must_use]
    pub fn new(
        coefficients: usize,
        start: Vec<i32>,
        unknown: Vec<i32>,
        weight: Vec<f64>,
        coefficient: Vec<i64>,
    ) -> Option<Self> {
        let inside = |index: i64, len: usize| index >= 0 && (index as usize) < len;
        let fits = start.len() == coefficients + 1
            && start.windows(2).all(|w| 0 <= w[0] && w[0] <= w[1])
            && start[coefficients] as usize == unknown.len()
            && unknown.len() == weight.len()
            && unknown.iter().all(|&u| inside(i64::from(u), coefficient.len()))
            && coefficient.iter().all(|&c| inside(c, coefficients));
        if !fits {
            return None;
        }
        let mut own = vec![-1; coefficients];
        for (u, &c) in coefficient.iter().enumerate() {
            own[c as usize] = u as i32;
        }
        Some(Self { start, unknown, weight, coefficient, own })
    }

    /// Whether a coefficient follows from unknowns other than itself.
    fn depends(&self, coefficient: usize) -> bool {
        self.own[coefficient] < 0 && self.start[coefficient] < self.start[coefficient + 1]
    }

    /// Unknowns of a cell: unknown, local coefficient, weight; by unknown.
    fn of_cell(&self, local: &Local, entries: &mut Vec<(u32, usize, f64)>) {
        entries.clear();
        for (k, &c) in local.coefficients.iter().enumerate() {
            if self.own[c] >= 0 {
                entries.push((self.own[c] as u32, k, 1.0));
                continue;
            }
            for e in self.start[c] as usize..self.start[c + 1] as usize {
                entries.push((self.unknown[e] as u32, k, self.weight[e]));
            }
        }
        entries.sort_unstable_by_key(|e| (e.0, e.1));
    }
}

/// Pattern of the reduced matrix.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Start of each row in `columns`; one more than rows.
    pub start: Array1<i32>,
    /// Columns of the rows, ascending.
    pub columns: Array1<i32>,
    /// Whether the unknowns of each active cell reach beyond its functions (point constraints).
    reaching: Vec<bool>,
}

/// Functions of one field on the grid, and the coefficient of each of their components.
struct Functions {
    basis: Basis,
    cells: [usize; 2],
    first: usize,
    components: usize,
}

impl Functions {
    /// The fields of the cells' forms.
    fn of(cells: &Cells, grid: [usize; 2]) -> Vec<Self> {
        let u = Self { basis: cells.basis, cells: grid, first: 0, components: 2 };
        let first = cells.displacement(grid);
        let bilinear = Self { basis: Basis::Bilinear, cells: grid, first, components: 1 };
        std::iter::once(u).chain(cells.bilinear.then_some(bilinear)).collect()
    }

    /// Cells of the support of the function that a coefficient belongs to.
    fn support(&self, coefficient: usize) -> [[usize; 2]; 2] {
        support(self.basis, self.cells, (coefficient - self.first) / self.components)
    }

    /// Append the unknowns whose functions share an active cell with a support.
    fn sharing(&self, active: &Active, support: [[usize; 2]; 2], own: &[i32], row: &mut Vec<i32>) {
        let [x, y] = support;
        let size = (x[1] + 1 - x[0]) * (y[1] + 1 - y[0]);
        let full = active.count(support) == size;
        let both = |a: [usize; 2], b: [usize; 2]| [a[0].max(b[0]), a[1].min(b[1])];
        let width = self.basis.len(self.cells[0]);
        let ([x0, x1], [y0, y1]) = (self.basis.on(x), self.basis.on(y));
        for g in y0..=y1 {
            let shared_y = both(y, self.basis.support(self.cells[1], g));
            for f in x0..=x1 {
                let shared = [both(x, self.basis.support(self.cells[0], f)), shared_y];
                if full || active.count(shared) > 0 {
                    let c = self.first + self.components * (f + width * g);
                    row.extend(own[c..c + self.components].iter().filter(|&&u| u >= 0));
                }
            }
        }
    }
}

/// Rows that one task makes.
const ROWS: usize = 512;

/// Pattern of the reduced matrix; `None` if it has more entries than its indices can count.
///
/// On the structured grid it is known which functions share an active cell; only the cells at point
/// constraints are gone through one by one.
#[must_use]
pub fn pattern(cells: &Cells, location: &Location, selection: &Selection) -> Option<Pattern> {
    let active = Active::new(location.grid, &location.active);
    let fields = Functions::of(cells, location.grid.cells);
    let field_of =
        |c: usize| &fields[fields.len() - 1 - usize::from(c < fields[fields.len() - 1].first)];
    let (reaching, further) = reach(cells, location, selection, |c| field_of(c).support(c));
    let of_task = |(task, unknowns): (usize, &[i64])| {
        let (mut lengths, mut columns, mut row) = (Vec::new(), Vec::new(), Vec::new());
        for (k, &c) in unknowns.iter().enumerate() {
            row.clear();
            let support = field_of(c as usize).support(c as usize);
            for field in &fields {
                field.sharing(&active, support, &selection.own, &mut row);
            }
            let more = further.get(&((task * ROWS + k) as u32));
            row.extend(more.into_iter().flatten().map(|&u| u as i32));
            if !row.is_sorted() {
                row.sort_unstable();
            }
            row.dedup();
            lengths.push(row.len());
            columns.extend_from_slice(&row);
        }
        (lengths, columns)
    };
    let tasks = selection.coefficient.par_chunks(ROWS).enumerate().map(of_task);
    let (lengths, columns): (Vec<_>, Vec<_>) = tasks.unzip();
    let mut start = Vec::with_capacity(selection.coefficient.len() + 1);
    let mut end = 0;
    start.push(0);
    for length in lengths.iter().flatten() {
        end += length;
        start.push(i32::try_from(end).ok()?);
    }
    Some(Pattern { start: start.into(), columns: columns.concat().into(), reaching })
}

/// The active cells with coefficients that depend on others, and what these add to the pattern: for
/// each unknown of such a cell, all of them.
fn reach(
    cells: &Cells,
    location: &Location,
    selection: &Selection,
    support: impl Fn(usize) -> [[usize; 2]; 2],
) -> (Vec<bool>, BTreeMap<u32, Vec<u32>>) {
    let mut reaching = vec![false; location.active.len()];
    for c in (0..selection.own.len()).filter(|&c| selection.depends(c)) {
        let [x, y] = support(c);
        for j in y[0]..=y[1] {
            for i in x[0]..=x[1] {
                let cell = (i + j * location.grid.cells[0]) as u32;
                if let Ok(a) = location.active.binary_search(&cell) {
                    reaching[a] = true;
                }
            }
        }
    }
    let mut further = BTreeMap::<u32, Vec<u32>>::new();
    let mut entries = Vec::new();
    for a in (0..reaching.len()).filter(|&a| reaching[a]) {
        selection.of_cell(&cells.local(location, a), &mut entries);
        for &(u, ..) in &entries {
            further.entry(u).or_default().extend(entries.iter().map(|e| e.0));
        }
    }
    (reaching, further)
}

/// The reduced matrix in its pattern: `P^T K P`. False if the pattern is not that of these cells and
/// this selection; `values` are then of no use.
///
/// # Safety
/// As [`vector`](super::vector), with kernels of the ranks that `form` says; `values` is as long as the columns of the
/// pattern, whose rows are disjoint (`start` ascends).
#[allow(clippy::too_many_arguments)]
pub unsafe fn matrix(
    cells: &Cells,
    form: &Bilinear,
    location: &Location,
    volume: &[f64],
    coefficients: &[f64],
    selection: &Selection,
    pattern: &Pattern,
    values: &mut [f64],
) -> bool {
    values.par_chunks_mut(1 << 16).for_each(|part| part.fill(0.0));
    let (Some(start), Some(all)) = (pattern.start.as_slice(), pattern.columns.as_slice()) else {
        return false;
    };
    let shared = Shared::new(values);
    let add = |a: usize, work: &mut Work| {
        let local = cells.local(location, a);
        selection.of_cell(&local, &mut work.entries);
        let (n, m) = (cells.dofs(), local.coefficients.len());
        let element = &mut work.element[..n * n];
        let at = (a, &local, coefficients);
        // SAFETY: the caller's.
        unsafe { form.tabulate(cells, location, volume, at, &mut work.packed, element) };
        // T^T A, then (T^T (T^T A)^T)^T = T^T A T
        local.transposed(element, n, &mut work.half);
        transpose(&work.half[..m * n], n, &mut work.turned);
        local.transposed(&work.turned[..n * m], m, &mut work.reduced);
        for &(r, k, wr) in &work.entries {
            let row = start[r as usize] as usize..start[r as usize + 1] as usize;
            let columns = &all[row.clone()];
            let mut slot = 0;
            for &(c, l, wc) in &work.entries {
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
        let fits = rows.into_par_iter().all(|row| {
            let mut work = Work::new();
            row.filter(|&a| !pattern.reaching[a]).all(|a| add(a, &mut work))
        });
        if !fits {
            return false;
        }
    }
    let mut work = Work::new();
    (0..location.active.len()).filter(|&a| pattern.reaching[a]).all(|a| add(a, &mut work))
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

/// What one thread needs: coefficients of the kernels, unknowns of the cell, element matrices on
/// their way to the coefficients.
struct Work {
    packed: Vec<f64>,
    entries: Vec<(u32, usize, f64)>,
    element: [f64; MAX_DOFS * MAX_DOFS],
    half: [f64; MAX_DOFS * MAX_DOFS],
    turned: [f64; MAX_DOFS * MAX_DOFS],
    reduced: [f64; MAX_DOFS * MAX_DOFS],
}

impl Work {
    fn new() -> Self {
        let zero = [0.0; MAX_DOFS * MAX_DOFS];
        let (packed, entries) = (Vec::new(), Vec::with_capacity(MAX_DOFS));
        Self { packed, entries, element: zero, half: zero, turned: zero, reduced: zero }
    }
}
