//! Cells of points on a border: on the side of the body, or the nearest ones that hold particles.

use super::Grid;
use crate::space::{number_of, Index, Point, DIM};

/// How cells of points on a border are sought.
#[derive(Debug, Clone, Copy)]
pub struct Search<'a> {
    /// Cells of the whole grid along each axis.
    pub whole: Index,
    /// Whether each cell of the part holds particles.
    pub active: &'a [bool],
    /// Whether each cell of the part is treated here.
    pub own: &'a [bool],
    /// Distance by which a point is moved into the body to find its cell [cells].
    pub inward: f64,
    /// Cells along each axis in which a cell with particles is sought.
    pub reach: usize,
}

impl Grid {
    /// Cell of each point in the whole grid, of which this grid is a part, and whether no cell near it holds
    /// particles. A point whose cell is not treated here has none.
    ///
    /// # Arguments
    /// `x`: positions [m]; `normal`: outward unit normals.
    #[must_use]
    pub fn near(&self, search: &Search, x: &[Point], normal: &[Point]) -> Vec<(Option<u32>, bool)> {
        let cell = |index| Some(number_of(index, search.whole) as u32);
        let one = |(x, normal): (&Point, &Point)| {
            let scaled: Point = std::array::from_fn(|k| (x[k] - self.origin[k]) / self.h);
            let inside: Point = std::array::from_fn(|k| scaled[k] - search.inward * normal[k]);
            let index = clipped(inside, search.whole);
            let Some(here) = self.here(index).filter(|&here| search.own[here]) else {
                return (None, false);
            };
            if search.active[here] {
                return (cell(index), false);
            }
            let found = self.nearest(search, scaled, 1);
            // cells further away may be nearer than one that is a cell away
            let found = found
                .filter(|&(_, square)| square < 1.0)
                .or_else(|| self.nearest(search, scaled, search.reach));
            found.map_or((cell(clipped(scaled, search.whole)), true), |(index, _)| {
                (cell(index), false)
            })
        };
        x.iter().zip(normal).map(one).collect()
    }

    /// Number in this part of a cell of the whole grid.
    fn here(&self, index: Index) -> Option<usize> {
        let inside = |k: usize| (self.first[k]..self.first[k] + self.cells[k]).contains(&index[k]);
        let local = || std::array::from_fn(|k| index[k] - self.first[k]);
        (0..DIM).all(inside).then(|| number_of(local(), self.cells))
    }

    /// The nearest cell with particles at most `reach` cells away along each axis, and the square of its
    /// distance [cells].
    fn nearest(&self, search: &Search, scaled: Point, reach: usize) -> Option<(Index, f64)> {
        let (base, width) = (clipped(scaled, search.whole), 2 * reach + 1);
        let mut best: Option<(Index, f64)> = None;
        for change in 0..width.pow(DIM as u32) {
            let mut rest = change; // the last axis changes fastest
            let mut index = [0; DIM];
            for k in (0..DIM).rev() {
                index[k] = (base[k] + rest % width).wrapping_sub(reach);
                rest /= width;
            }
            if !self.here(index).is_some_and(|here| search.active[here]) {
                continue;
            }
            let away = |k: usize| {
                let before = index[k] as f64 - scaled[k];
                before.max(0.0).max(-1.0 - before)
            };
            let square = (0..DIM).map(|k| away(k) * away(k)).sum();
            if best.is_none_or(|(_, least)| square < least) {
                best = Some((index, square));
            }
        }
        best
    }
}

/// The cell of a position, or the one at the border of the grid nearest to it.
fn clipped(scaled: Point, cells: Index) -> Index {
    std::array::from_fn(|k| scaled[k].floor().clamp(0.0, (cells[k] - 1) as f64) as usize)
}
