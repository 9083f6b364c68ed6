//! From particles to rules, functions and cells: densities, nodal sums, sums over cells.

use ndarray::{Array2, ArrayView2};
use proptest::prelude::*;
use tawami::grid::{Basis, Grid, Rule};
use tawami::transfer::cells::{cell_sums, mean_of_cell};
use tawami::transfer::densities::{pack, Densities};
use tawami::transfer::to_grid::nodal_sums;

const CELLS: [usize; 2] = [3, 2];

fn grid() -> Grid {
    Grid::new([-0.3, 2.0], 0.25, CELLS).unwrap()
}

/// Positions on the grid from numbers in [0, 1], volumes and one datum each.
fn particles() -> impl Strategy<Value = Vec<([f64; 2], f64, f64)>> {
    let coordinate = || prop_oneof![0.0..=1.0, Just(0.0), Just(1.0), Just(1.0 / 3.0), Just(0.5)];
    prop::collection::vec(([coordinate(), coordinate()], 1e-3..2.0, -1e3..1e3_f64), 1..40)
}

fn on_grid(grid: &Grid, s: [f64; 2]) -> [f64; 2] {
    std::array::from_fn(|a| grid.origin[a] + grid.h * grid.cells[a] as f64 * s[a])
}

/// Row numbers of all active cells and a rule's tensor points, x fastest.
fn packing_of(active: usize, n: usize) -> (Vec<u32>, Vec<[usize; 2]>) {
    let points = (0..n * n).map(|q| [q % n, q / n]).collect();
    ((0..active as u32).collect(), points)
}

fn power(base: f64, exponent: usize) -> f64 {
    base.powi(exponent as i32)
}

proptest! {
    #[test]
    fn every_polynomial_of_the_rule_is_integrated_exactly(
        particles in particles(), n in 1usize..6, degrees in (0usize..6, 0usize..6),
    ) {
        let grid = grid();
        let (i, j) = (degrees.0 % n, degrees.1 % n);
        let x: Vec<[f64; 2]> = particles.iter().map(|p| on_grid(&grid, p.0)).collect();
        let volume: Vec<f64> = particles.iter().map(|p| p.1).collect();
        let data = Array2::from_shape_fn((particles.len(), 2), |(p, k)| {
            if k == 0 { particles[p].2 } else { 1.0 }
        });
        let location = grid.locate(&x).unwrap();
        let rule = Rule::gauss(n);
        let (rows, points) = packing_of(location.active.len(), n);
        let densities = Densities { rule: &rule, points: &points, columns: &[0, 1] };
        let mut out = Array2::from_elem((rows.len(), 3 + 2 * n * n), f64::NAN);
        out.column_mut(0).fill(7.0);
        let width = out.ncols();
        pack(&rows, (3, densities.len()), width, out.as_slice_mut().unwrap(), |a, row| {
            densities.of_cell(&location, a, &volume, data.view(), row);
        });

        for (row, a) in out.outer_iter().zip(0..) {
            for k in 0..2 {
                let by_rule: f64 = points.iter().enumerate().map(|(q, &[px, py])| {
                    let weight = rule.weights[px] * rule.weights[py] * grid.h * grid.h;
                    weight * row[3 + 2 * q + k] * power(rule.points[px], i) * power(rule.points[py], j)
                }).sum();
                let term = |p: usize| {
                    let xi = location.xi[p];
                    volume[p] * data[[p, k]] * power(xi[0], i) * power(xi[1], j)
                };
                let mine = location.particles_of(a);
                let by_particles: f64 = mine.iter().map(|&p| term(p as usize)).sum();
                let size: f64 = mine.iter().map(|&p| (volume[p as usize] * data[[p as usize, k]]).abs()).sum();
                prop_assert!((by_rule - by_particles).abs() <= 1e-11 * size.max(1e-300));
            }
            prop_assert_eq!(row[0], 7.0); // what is not the packing's is left alone
        }
    }

    #[test]
    fn nodal_sums_keep_the_total(particles in particles()) {
        let grid = grid();
        let x: Vec<[f64; 2]> = particles.iter().map(|p| on_grid(&grid, p.0)).collect();
        let volume: Vec<f64> = particles.iter().map(|p| p.1).collect();
        let data: Vec<f64> = particles.iter().map(|p| p.2).collect();
        let location = grid.locate(&x).unwrap();
        let view = ArrayView2::from_shape((data.len(), 1), &data).unwrap();
        let total: f64 = volume.iter().zip(&data).map(|(v, d)| v * d).sum();
        let size: f64 = volume.iter().zip(&data).map(|(v, d)| (v * d).abs()).sum();
        for basis in [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic] {
            let sums = nodal_sums(&location, &volume, view, basis, false);
            prop_assert!((sums.sum() - total).abs() <= 1e-12 * size);
        }
    }
}

#[test]
fn the_mean_of_a_cell_is_weighted_by_volume() {
    let grid = Grid::new([0.0, 0.0], 1.0, [2, 1]).unwrap();
    let location = grid.locate(&[[0.2, 0.5], [0.9, 0.5], [1.5, 0.5]]).unwrap();
    let data = ndarray::arr2(&[[1.0], [4.0], [9.0]]);
    let mut out = Array2::zeros((2, 1));
    pack(&[1, 0], (0, 1), 1, out.as_slice_mut().unwrap(), |a, row| {
        mean_of_cell(&location, a, &[2.0, 1.0, 5.0], data.view(), &[0], row);
    });
    assert_eq!(out, ndarray::arr2(&[[9.0], [2.0]]));
}

#[test]
fn sums_over_cells_go_to_their_cells() {
    let grid = Grid::new([0.0, 0.0], 1.0, [2, 2]).unwrap();
    let location = grid.locate(&[[0.2, 1.5], [1.9, 0.5], [0.7, 1.5]]).unwrap();
    let data = ndarray::arr2(&[[1.0, 10.0], [4.0, 40.0], [9.0, 90.0]]);
    let sums = cell_sums(&location, &[2.0, 1.0, 3.0], data.view());
    assert_eq!(sums, ndarray::arr2(&[[0.0, 0.0], [4.0, 40.0], [29.0, 290.0], [0.0, 0.0]]));
}

#[test]
fn gauss_rules_are_those_of_the_books() {
    let rule = Rule::gauss(2);
    assert!((rule.points[0] - 0.5 * (1.0 - 1.0 / 3f64.sqrt())).abs() < 1e-16);
    let rule = Rule::gauss(3);
    assert!((rule.weights[1] - 4.0 / 9.0).abs() < 1e-15);
    assert!((rule.points[2] - 0.5 * (1.0 + 0.6f64.sqrt())).abs() < 1e-15);
    for n in 1..9 {
        let rule = Rule::gauss(n);
        let integral: f64 =
            rule.points.iter().zip(&rule.weights).map(|(x, w)| w * power(*x, 2 * n - 1)).sum();
        assert!((integral - 1.0 / (2 * n) as f64).abs() < 1e-15);
    }
}
