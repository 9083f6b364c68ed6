//! Any numbers: an error, or an answer whose indices are inside; no panic.

use std::sync::Arc;

use ndarray::{Array1, Array2};
use proptest::prelude::*;
use tawami::grid::{Basis, Grid, Rule, MAX_CELLS};
use tawami::law::{Law, LinearElastic};
use tawami::particles::kinematics::Kinematics;
use tawami::particles::stage::check_materials;
use tawami::particles::Particles;
use tawami::transfer::cells::mean_of_cell;
use tawami::transfer::densities::{pack, Densities};
use tawami::transfer::to_grid::nodal_sums;
use tawami::transfer::to_particles::Field;

const BASES: [Basis; 3] = [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic];

fn number() -> impl Strategy<Value = f64> {
    use proptest::num::f64::ANY;
    let special = [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, -0.0, 5e-324, 1e308, -1e308];
    prop_oneof![ANY, prop::sample::select(special.to_vec()), -3.0..3.0_f64]
}

proptest! {
    #[test]
    fn any_numbers_make_a_grid_or_an_error(
        origin in [number(), number()], h in number(),
        nx in 0..=MAX_CELLS + 1, ny in prop_oneof![0..=3_usize, 0..=usize::MAX],
    ) {
        let valid = origin.iter().all(|o| o.is_finite()) && h.is_finite() && h > 0.0
            && [nx, ny].iter().all(|n| (1..=MAX_CELLS).contains(n));
        prop_assert_eq!(Grid::new(origin, h, [nx, ny]).is_ok(), valid);
    }

    #[test]
    fn any_points_are_in_a_cell_or_rejected(
        origin in [-2.0..2.0_f64, -2.0..2.0_f64],
        h in prop_oneof![0.5..2.0_f64, Just(5e-324), Just(1e-200), Just(1e200), Just(1e308)],
        x in prop::collection::vec([number(), number()], 0..6),
        margin in 0.0..=0.5_f64,
    ) {
        let grid = Grid::new(origin, h, [3, 2]).unwrap();
        let Ok(location) = grid.locate(&x) else { return Ok(()) };
        let n = x.len();
        prop_assert_eq!(location.len(), n);
        let mut order = location.order.clone();
        order.sort_unstable();
        prop_assert_eq!(order, (0..n as u32).collect::<Vec<_>>());
        let count: usize = (0..location.active.len()).map(|a| location.particles_of(a).len()).sum();
        prop_assert_eq!(count, n);
        for (&cell, xi) in location.cell.iter().zip(&location.xi) {
            prop_assert!((cell as usize) < grid.num_cells());
            prop_assert!(xi.iter().all(|t| (0.0..=1.0).contains(t)));
        }
        let inside = location.clone().away_from_sides(margin);
        prop_assert!(inside.xi.iter().flatten().all(|t| (margin..=1.0 - margin).contains(t)));
        for basis in BASES {
            let coefficients = vec![1.0; basis.len(3) * basis.len(2)];
            let field: Field<1> = Field { grid, basis, coefficients: &coefficients };
            for value in field.at_particles(&location) {
                prop_assert!((value[0] - 1.0).abs() < 1e-12); // the functions add up to 1
            }
        }
    }

    #[test]
    fn any_data_reach_their_cells(
        data in prop::collection::vec([number(), number()], 1..10), n in 1usize..=8,
    ) {
        let grid = Grid::new([0.0, 0.0], 1.0, [2, 2]).unwrap();
        let count = data.len();
        let at = |k: usize| 0.1 + 1.8 * k as f64 / (2 * count) as f64;
        let x: Vec<[f64; 2]> = (0..count).map(|p| [at(2 * p), at(2 * p + 1)]).collect();
        let location = grid.locate(&x).unwrap();
        let data = Array2::from_shape_fn((count, 2), |(p, k)| data[p][k]);
        let (volume, rule) = (vec![1.0; count], Rule::gauss(n));
        let points: Vec<_> = (0..n * n).map(|q| [q % n, q / n]).collect();
        let densities = Densities { rule: &rule, points: &points, columns: &[1] };
        let rows: Vec<u32> = (0..location.active.len() as u32).collect();
        let mut out = vec![0.0; rows.len() * n * n];
        pack(&rows, (0, n * n), n * n, &mut out, |a, row| {
            densities.of_cell(&location, a, &volume, data.view(), row);
        });
        let mut mean = [0.0];
        for a in 0..rows.len() {
            mean_of_cell(&location, a, &volume, data.view(), &[0], &mut mean);
            let not_finite = location.particles_of(a).iter().any(|&p| !data[[p as usize, 1]].is_finite());
            if not_finite {
                prop_assert!(out[a * n * n..][..n * n].iter().any(|d| !d.is_finite()));
            }
        }
        for basis in BASES {
            prop_assert_eq!(nodal_sums(&location, &volume, data.view(), basis, false).ncols(), 2);
        }
    }

    #[test]
    fn any_rows_make_particles_of_known_materials_or_an_error(
        values in prop::collection::vec(number(), 10), columns in 0usize..12,
    ) {
        let particles = Particles::new(
            Array2::zeros((2, 2)), Array1::ones(2), Array1::zeros(2),
        ).unwrap();
        let width = particles.rows().ncols();
        let rows = Array2::from_shape_fn((3, columns), |(_, k)| values[k % 10]);
        let made = particles.of_rows(&rows.view());
        prop_assert_eq!(made.is_some(), columns == width);
        if let Some(made) = made {
            let law: Arc<dyn Law> = Arc::new(LinearElastic::from_k_mu(1.0, 1.0).unwrap());
            let known = made.material().iter().all(|&m| m == 0);
            let checked = check_materials(&made, &[law], Kinematics::Displacement, false);
            prop_assert_eq!(checked.is_ok(), known);
            let sound = values.iter().all(|v| v.is_finite()) && values[2] > 0.0;
            prop_assert!(made.check().is_err() || made.volume().iter().all(|&v| v > 0.0));
            prop_assert!(made.check().is_ok() || !sound);
        }
    }
}
