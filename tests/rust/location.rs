//! Location of particles in the grid, and positions that are rejected.

use proptest::prelude::*;
use tawami::error::Error;
use tawami::grid::{Basis, Functions, Grid};
use tawami::space::{indices_below, Extent, Point, Position};

proptest! {
    #[test]
    fn a_particle_is_where_its_cell_says(
        origin in [-1e3..1e3_f64, -1e3..1e3_f64], h in 1e-3..1e3_f64,
        s in prop::collection::vec([0.0..=1.0_f64, 0.0..=1.0_f64], 1..30),
    ) {
        let grid = Grid::new(origin, h, [5, 3]).unwrap();
        let x: Vec<Point> = s.iter().map(|s| [
            origin[0] + 5.0 * h * s[0], origin[1] + 3.0 * h * s[1],
        ]).collect();
        let location = grid.locate(&x).unwrap();
        for (p, x) in x.iter().enumerate() {
            let ij = grid.cell_index(location.cell[p] as usize);
            for a in 0..2 {
                prop_assert!((0.0..=1.0).contains(&location.xi[p][a]));
                let back = origin[a] + h * (ij[a] as f64 + location.xi[p][a]);
                prop_assert!((back - x[a]).abs() <= 1e-8 * h + 1e-12 * x[a].abs());
            }
        }
        // every particle in exactly one list, ascending within a cell
        let mut seen = vec![0; s.len()];
        for a in 0..location.active.len() {
            let mine = location.particles_of(a);
            prop_assert!(!mine.is_empty() && mine.windows(2).all(|w| w[0] < w[1]));
            for &p in mine {
                seen[p as usize] += 1;
                prop_assert_eq!(location.cell[p as usize], location.active[a]);
            }
        }
        prop_assert!(seen.iter().all(|&n| n == 1));
    }
}

#[test]
fn edges_belong_to_the_upper_cell_and_the_border_to_the_grid() {
    let grid = Grid::new([0.0, 0.0], 0.1, [3, 1]).unwrap();
    let x = [[0.1, 0.0], [0.30000000000000004, 0.1], [-1e-12, 0.05], [0.15, 0.05]];
    let location = grid.locate(&x).unwrap();
    assert_eq!(location.cell, [1, 2, 0, 1]);
    assert_eq!(location.xi[1], [1.0, 1.0]);
}

#[test]
fn a_body_that_ends_on_a_line_takes_no_part_in_the_cells_beyond() {
    let grid = Grid::new([0.0, 0.0], 1.0, [4, 4]).unwrap();
    let line = [0.0, 0.5, 1.0, 1.5, 2.0];
    let x: Vec<Point> = line.iter().flat_map(|&y| line.iter().map(move |&x| [x, y])).collect();
    let location = grid.locate(&x).unwrap();
    assert_eq!(location.active, [0, 1, 4, 5]);
    assert_eq!(location.xi[24], [1.0, 1.0]);
    assert_eq!(location.cell[24], 5);
}

#[test]
fn particles_outside_are_counted_and_the_first_is_named() {
    let grid = Grid::new([0.0, 0.0], 1.0, [2, 2]).unwrap();
    let error = grid.locate(&[[1.0, 1.0], [2.5, 1.0], [1.0, -3.0]]).unwrap_err();
    let expected = Error::OutsideGrid {
        count: 2,
        total: 3,
        index: 1,
        position: Position([2.5, 1.0]),
        extent: Extent([0.0, 0.0], [2.0, 2.0]),
    };
    assert_eq!(error, expected);
    assert!(error.to_string().contains("particle 1 at (2.5, 1), the grid covers [0, 2] x [0, 2]."));
}

#[test]
fn bad_input_is_rejected() {
    let grid = Grid::new([0.0, 0.0], 1.0, [2, 2]).unwrap();
    assert!(grid.locate(&[]).unwrap().is_empty());
    let error = grid.locate(&[[0.5, 0.5], [f64::NAN, 0.5]]).unwrap_err();
    assert!(matches!(error, Error::NotFinite { index: 1, count: 1, .. }), "{error}");
    for (h, cells) in [(0.0, [1, 1]), (f64::NAN, [1, 1]), (-1.0, [1, 1]), (1.0, [0, 1])] {
        assert!(matches!(Grid::new([0.0, 0.0], h, cells), Err(Error::Parameter { .. })));
    }
    assert!(Grid::new([f64::INFINITY, 0.0], 1.0, [1, 1]).is_err());
}

proptest! {
    #[test]
    fn a_part_of_a_grid_has_its_positions_and_functions(
        first in [0..3_usize, 0..3_usize], cells in [3..6_usize, 3..6_usize], xi in [0.0..1.0_f64, 0.0..1.0_f64],
    ) {
        let grid = Grid::new([0.1, -3.0], 0.3, [9, 9]).unwrap();
        let part = grid.window(first, cells);
        for cell in indices_below(cells) {
            let whole = [first[0] + cell[0], first[1] + cell[1]];
            prop_assert_eq!(part.position(cell, xi), grid.position(whole, xi));
            // functions away from the ends of the part
            let inner = (0..2).all(|a| cell[a] > 0 && cell[a] + 1 < cells[a]);
            for basis in [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic] {
                let values = |cells, cell| Functions { basis, cells }.values(cell, xi);
                if inner && (0..2).all(|a| whole[a] > 0 && whole[a] < 8) {
                    prop_assert_eq!(values(cells, cell), values([9, 9], whole));
                }
            }
        }
    }
}
