//! S: the unknowns behind each coefficient.

use std::ops::Range;

use super::cell::Local;

/// S as compressed rows: the unknowns behind each coefficient and their weights.
#[derive(Debug, Clone)]
pub struct Selection {
    /// Start of the entries of each coefficient; one more than coefficients.
    start: Vec<i32>,
    /// Unknown of each entry.
    unknown: Vec<i32>,
    /// Weight of each entry.
    weight: Vec<f64>,
    /// Coefficient that each unknown is; -1 for one that is none of these.
    coefficient: Vec<i64>,
    /// Unknown that each coefficient is; -1 for held coefficients and those that depend on others.
    own: Vec<i32>,
}

/// An unknown of a cell: its number, the coefficient of the cell that it is behind, its weight.
pub(super) type Entry = (u32, usize, f64);

/// The runs of entries whose unknowns and coefficients follow one another, each with weight 1; other entries
/// are runs of their own.
#[allow(clippy::float_cmp)] // the weight of an unknown itself is exactly 1
pub(super) fn runs(entries: &[Entry], runs: &mut Vec<Range<usize>>) {
    runs.clear();
    let mut start = 0;
    for e in 1..=entries.len() {
        let follows = e < entries.len() && {
            let ((u, k, w), (v, l, x)) = (entries[e - 1], entries[e]);
            v == u + 1 && l == k + 1 && w == 1.0 && x == 1.0
        };
        if !follows {
            runs.push(start..e);
            start = e;
        }
    }
}

impl Selection {
    /// From the compressed rows and the coefficient that each unknown is; `None` if they do not belong to
    /// `coefficients` coefficients.
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
            && coefficient.iter().all(|&c| c == -1 || inside(c, coefficients));
        if !fits {
            return None;
        }
        let mut own = vec![-1; coefficients];
        for (u, &c) in coefficient.iter().enumerate().filter(|(_, &c)| c >= 0) {
            own[c as usize] = u as i32;
        }
        Some(Self { start, unknown, weight, coefficient, own })
    }

    /// Coefficient that each unknown is; -1 for one that is none of these.
    pub(super) fn coefficients(&self) -> &[i64] {
        &self.coefficient
    }

    /// The unknowns that coefficients are themselves, of those from `first` on.
    pub(super) fn unknowns(&self, first: usize, count: usize) -> impl Iterator<Item = i32> + '_ {
        self.own[first..first + count].iter().copied().filter(|&u| u >= 0)
    }

    /// The coefficients that follow from other unknowns.
    pub(super) fn dependent(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.own.len()).filter(|&c| self.own[c] < 0 && self.start[c] < self.start[c + 1])
    }

    /// Unknowns of a cell, sorted by unknown.
    pub(super) fn of_cell(&self, local: &Local, entries: &mut Vec<Entry>) {
        entries.clear();
        for (k, &c) in local.numbers().iter().enumerate() {
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
