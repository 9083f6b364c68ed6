//! Active functions, parts and owners, against what the bases say cell by cell.

use std::collections::BTreeSet;

use proptest::prelude::*;
use tawami::grid::{Active, Basis, Grid};

const BASES: [Basis; 3] = [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic];

/// Functions that do not vanish in the middle of a cell (nor anywhere else inside it).
fn functions_of(basis: Basis, grid: &Grid, cell: usize) -> BTreeSet<usize> {
    let [i, j] = grid.cell_index(cell);
    let [nx, ny] = grid.cells;
    let (x, y) = (basis.at(nx, i, 0.4), basis.at(ny, j, 0.4));
    let inside = |values: [f64; 3]| (0..3).filter(move |&k| values[k] != 0.0);
    let width = basis.len(nx);
    inside(y.value)
        .flat_map(|b| inside(x.value).map(move |a| x.first + a + (y.first + b) * width))
        .collect()
}

prop_compose! {
    fn some_cells()(nx in 1..9_usize, ny in 1..7_usize)
        (active in proptest::collection::btree_set(0..nx * ny, 0..nx * ny + 1), nx in Just(nx), ny in Just(ny))
        -> (Grid, Vec<u32>) {
        let grid = Grid::new([-1.0, 2.0], 0.25, [nx, ny]).unwrap();
        (grid, active.into_iter().map(|c| c as u32).collect())
    }
}

proptest! {
    #[test]
    fn functions_parts_and_supports((grid, cells) in some_cells()) {
        let active = Active::new(grid, &cells);
        for basis in BASES {
            let of_cells: Vec<BTreeSet<usize>> =
                cells.iter().map(|&c| functions_of(basis, &grid, c as usize)).collect();
            let all: BTreeSet<usize> = of_cells.iter().flatten().copied().collect();
            for (f, mask) in active.functions(basis).into_iter().enumerate() {
                prop_assert_eq!(mask, all.contains(&f));
                let support = active.support(basis, f);
                let mine = |k: &usize| of_cells[*k].contains(&f);
                let expected: Vec<[usize; 2]> =
                    (0..cells.len()).filter(mine).map(|k| grid.cell_index(cells[k] as usize)).collect();
                prop_assert_eq!(support, expected);
            }
            // two cells are of one part if and only if a chain of shared functions joins them
            let (count, part) = active.parts(basis);
            let mut groups: Vec<BTreeSet<usize>> = Vec::new();
            for functions in &of_cells {
                let (joined, mut apart): (Vec<_>, Vec<_>) =
                    groups.into_iter().partition(|group| !group.is_disjoint(functions));
                apart.push(joined.into_iter().flatten().chain(functions.iter().copied()).collect());
                groups = apart;
            }
            prop_assert_eq!(count, groups.len());
            for group in &groups {
                let mine = cells.iter().zip(&of_cells).filter(|(_, of_cell)| !group.is_disjoint(of_cell));
                let numbers: BTreeSet<i64> = mine.map(|(&c, _)| part[c as usize]).collect();
                prop_assert_eq!(numbers.len(), 1);
                prop_assert!(numbers.iter().all(|&n| n >= 0 && (n as usize) < count));
            }
            prop_assert!((0..part.len()).all(|c| cells.contains(&(c as u32)) == (part[c] >= 0)));
            // the value of a function is that of one of its cells
            let values: Vec<i64> = (0..grid.num_cells()).map(|c| 10 + c as i64).collect();
            for (f, value) in active.spread(basis, &values, -7).into_iter().enumerate() {
                let of_one = cells.iter().zip(&of_cells).any(|(&c, functions)| {
                    functions.contains(&f) && value == 10 + i64::from(c)
                });
                prop_assert_eq!(of_one, all.contains(&f));
                prop_assert!(all.contains(&f) || value == -7);
            }
        }
    }

    #[test]
    fn counts_in_rectangles((grid, cells) in some_cells(), a in 0..9_usize, b in 0..9_usize, c in 0..7_usize, d in 0..7_usize) {
        let [nx, ny] = grid.cells;
        let x = [a.min(b).min(nx - 1), a.max(b).min(nx - 1)];
        let y = [c.min(d).min(ny - 1), c.max(d).min(ny - 1)];
        let inside = |&&cell: &&u32| {
            let [i, j] = grid.cell_index(cell as usize);
            x[0] <= i && i <= x[1] && y[0] <= j && j <= y[1]
        };
        prop_assert_eq!(Active::new(grid, &cells).count([x, y]), cells.iter().filter(inside).count());
    }
}
