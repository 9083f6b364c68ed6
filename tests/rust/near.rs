//! Cells of points on a border.

use tawami::grid::{Grid, Search};

/// A point on a line of the grid is on the side of the body. One in an empty cell goes to the nearest cell
/// with particles, and is lost if there is none.
#[test]
fn points_belong_to_cells_with_particles() {
    let grid = Grid::new([0.0, 0.0], 0.5, [6, 2]).unwrap();
    let mut active = [false; 12];
    active[1] = true;
    let own = [true; 12];
    let search = Search { whole: grid.cells, active: &active, own: &own, inward: 1e-6, reach: 2 };
    let x = [[1.0, 0.25], [0.2, 0.2], [1.9, 0.6], [2.9, 0.2]];
    let found = grid.near(&search, &x, &[[1.0, 0.0]; 4]);
    assert_eq!(found, [(Some(1), false), (Some(1), false), (Some(1), false), (Some(5), true)]);
}

/// Cells of another part of the grid are not treated here.
#[test]
fn points_in_other_cells_have_none() {
    let grid = Grid::new([0.0, 0.0], 0.5, [6, 2]).unwrap();
    let part = grid.window([2, 0], [2, 2]);
    let (active, own) = ([true; 4], [true, false, true, true]);
    let search = Search { whole: grid.cells, active: &active, own: &own, inward: 1e-6, reach: 2 };
    let x = [[1.2, 0.2], [1.7, 0.2], [0.2, 0.2]];
    let found = part.near(&search, &x, &[[0.0, 1.0]; 3]);
    assert_eq!(found, [(Some(2), false), (None, false), (None, false)]);
}
