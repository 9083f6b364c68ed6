//! Pattern of the reduced matrix.

use std::borrow::Cow;
use std::collections::BTreeMap;

use ndarray::Array1;
use rayon::prelude::*;

use super::cell::{Cells, Field};
use super::selection::Selection;
use crate::grid::{Active, Functions, Location};
use crate::space::{indices, number_of, Block, Index};

/// Pattern of the reduced matrix in compressed rows.
#[derive(Debug, Clone)]
pub struct Pattern {
    /// Start of each row in `columns`; one more than rows.
    pub start: Array1<i32>,
    /// Columns of the rows, ascending.
    pub columns: Array1<i32>,
    /// The active cells of the pattern.
    active: Vec<u32>,
    /// Whether the unknowns of each of them reach beyond its functions (point constraints).
    reaching: Vec<bool>,
}

impl Pattern {
    /// Whether the unknowns of some cells, ascending, reach beyond their functions; `None` if one of them
    /// is not a cell of the pattern.
    pub(super) fn reaching(&self, cells: &[u32]) -> Option<Cow<'_, [bool]>> {
        if cells == self.active {
            return Some(Cow::Borrowed(&self.reaching));
        }
        let of_cell = |cell| Some(self.reaching[self.active.binary_search(cell).ok()?]);
        cells.iter().map(of_cell).collect::<Option<Vec<_>>>().map(Cow::Owned)
    }
}

/// The functions of a field, and its place among the coefficients.
struct Place {
    functions: Functions,
    /// First coefficient.
    first: usize,
    components: usize,
}

/// Intersection of two blocks.
fn intersection(a: Block, b: Block) -> Block {
    std::array::from_fn(|axis| [a[axis][0].max(b[axis][0]), a[axis][1].min(b[axis][1])])
}

impl Place {
    /// The fields of these cells.
    fn of(cells: &Cells, grid: Index) -> Vec<Self> {
        let mut next = 0;
        let place = |field: &Field| {
            let (functions, components, first) = (field.functions(grid), field.components, next);
            next += components * functions.len();
            Self { functions, first, components }
        };
        cells.fields().iter().map(place).collect()
    }

    /// Cells of the support of the function that a coefficient belongs to.
    fn support(&self, coefficient: usize) -> Block {
        self.functions.support((coefficient - self.first) / self.components)
    }

    /// Append the unknowns whose functions share an active cell with a support.
    fn sharing(&self, active: &Active, support: Block, selection: &Selection, row: &mut Vec<i32>) {
        let cells: usize = support.iter().map(|[first, last]| last + 1 - first).product();
        let full = active.count(support) == cells;
        // lines along x have consecutive coefficients
        let [first, last] = self.functions.basis.on(support[0]);
        let mut lines = support.map(|cells| self.functions.basis.on(cells));
        lines[0] = [first, first];
        for line in indices(lines) {
            let coefficient = self.first + self.components * self.functions.number(line);
            if full {
                row.extend(selection.unknowns(coefficient, self.components * (last + 1 - first)));
                continue;
            }
            for along in 0..=last - first {
                let mut index = line;
                index[0] += along;
                let shared = intersection(support, self.functions.support_at(index));
                if active.count(shared) > 0 {
                    let coefficient = coefficient + self.components * along;
                    row.extend(selection.unknowns(coefficient, self.components));
                }
            }
        }
    }
}

/// Rows that one task makes, and tasks at a time.
const ROWS: usize = 512;
const TASKS: usize = 64;

/// Pattern of the reduced matrix; `None` if it has more entries than its indices can count.
///
/// On the structured grid it is known which functions share an active cell. Only the cells at point
/// constraints are visited one by one.
#[must_use]
pub fn pattern(cells: &Cells, location: &Location, selection: &Selection) -> Option<Pattern> {
    let active = Active::new(location.grid, &location.active);
    let fields = Place::of(cells, location.grid.cells);
    let support = |c: usize| {
        let field = fields.iter().rev().find(|field| c >= field.first).unwrap_or(&fields[0]);
        field.support(c)
    };
    let (reaching, further) = reach(cells, location, selection, support);
    let of_task = |(task, unknowns): (usize, &[i64])| {
        let (mut lengths, mut columns) = (Vec::new(), Vec::new());
        // the components of a function have the same row: it is made once
        let (mut row, mut of_support) = (Vec::new(), None);
        for (k, &c) in unknowns.iter().enumerate() {
            let support = (c >= 0).then(|| support(c as usize));
            if support.is_none() || of_support != support {
                row.clear();
                for (field, support) in fields.iter().filter_map(|f| support.map(|s| (f, s))) {
                    field.sharing(&active, support, selection, &mut row);
                }
                sort(&mut row);
                of_support = support;
            }
            let start = columns.len();
            columns.extend_from_slice(&row);
            if let Some(more) = further.get(&((task * ROWS + k) as u32)) {
                let mut all = columns.split_off(start);
                all.extend(more.iter().map(|&u| u as i32));
                sort(&mut all);
                columns.append(&mut all);
            }
            lengths.push(columns.len() - start);
        }
        (lengths, columns)
    };
    let tasks: Vec<_> = selection.coefficients().chunks(ROWS).enumerate().collect();
    let mut start = Vec::with_capacity(selection.coefficients().len() + 1);
    let mut columns = Vec::new();
    let mut end = 0;
    start.push(0);
    // some tasks at a time: all of their rows would need as much memory again as the pattern
    for some in tasks.chunks(TASKS) {
        let rows: Vec<_> = some.par_iter().map(|&task| of_task(task)).collect();
        for (lengths, of_rows) in rows {
            columns.extend(of_rows);
            for length in lengths {
                end += length;
                start.push(i32::try_from(end).ok()?);
            }
        }
    }
    columns.shrink_to_fit();
    let (start, columns) = (start.into(), columns.into());
    Some(Pattern { start, columns, active: location.active.clone(), reaching })
}

/// Sort the columns of a row, each once.
fn sort(row: &mut Vec<i32>) {
    if !row.is_sorted() {
        row.sort_unstable();
    }
    row.dedup();
}

/// The active cells with coefficients that depend on others, and what they add to the pattern: for each
/// unknown of such a cell, all of its unknowns.
fn reach(
    cells: &Cells,
    location: &Location,
    selection: &Selection,
    support: impl Fn(usize) -> Block,
) -> (Vec<bool>, BTreeMap<u32, Vec<u32>>) {
    let mut reaching = vec![false; location.active.len()];
    for c in selection.dependent() {
        for index in indices(support(c)) {
            let cell = number_of(index, location.grid.cells) as u32;
            if let Ok(a) = location.active.binary_search(&cell) {
                reaching[a] = true;
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
