//! Properties of the one-dimensional bases.

use proptest::prelude::*;
use tawami::grid::Basis;

fn any_basis() -> impl Strategy<Value = Basis> {
    prop_oneof![Just(Basis::QuadraticSpline), Just(Basis::Bilinear), Just(Basis::Biquadratic)]
}

fn cell_in_row() -> impl Strategy<Value = (usize, usize)> {
    (1usize..9).prop_flat_map(|n| (Just(n), 0..n))
}

/// Value of function `i` of the row at cell + t.
fn value(basis: Basis, n: usize, i: usize, cell: usize, t: f64) -> f64 {
    let local = basis.at(n, cell, t);
    let k = i.wrapping_sub(local.first);
    if k < basis.per_cell() {
        local.value[k]
    } else {
        0.0
    }
}

proptest! {
    #[test]
    fn values_sum_to_one_and_derivatives_to_zero(
        basis in any_basis(), (n, cell) in cell_in_row(), t in 0.0..=1.0,
    ) {
        let local = basis.at(n, cell, t);
        prop_assert!((local.value.iter().sum::<f64>() - 1.0).abs() < 1e-14);
        prop_assert!(local.derivative.iter().sum::<f64>().abs() < 1e-13);
        prop_assert!(local.first + basis.per_cell() <= basis.len(n));
    }

    #[test]
    fn derivative_is_the_central_difference(
        basis in any_basis(), (n, cell) in cell_in_row(), t in 0.1..0.9,
    ) {
        let d = 1e-3; // exact for quadratics
        let (plus, minus) = (basis.at(n, cell, t + d), basis.at(n, cell, t - d));
        let at = basis.at(n, cell, t);
        for k in 0..3 {
            let difference = (plus.value[k] - minus.value[k]) / (2.0 * d);
            prop_assert!((difference - at.derivative[k]).abs() < 1e-11);
        }
    }

    #[test]
    fn splines_and_their_slopes_are_continuous_and_not_negative(n in 2usize..9, edge in 1usize..8) {
        prop_assume!(edge < n);
        let basis = Basis::QuadraticSpline;
        for i in 0..basis.len(n) {
            let left = value(basis, n, i, edge - 1, 1.0);
            prop_assert!((left - value(basis, n, i, edge, 0.0)).abs() < 1e-15);
            let slope = |cell: usize, t: f64| {
                let local = basis.at(n, cell, t);
                let k = i.wrapping_sub(local.first);
                if k < 3 { local.derivative[k] } else { 0.0 }
            };
            prop_assert!((slope(edge - 1, 1.0) - slope(edge, 0.0)).abs() < 1e-14);
            prop_assert!(left >= 0.0);
        }
    }
}

#[test]
fn one_cell_of_splines_is_the_bernstein_basis() {
    let t = 0.3_f64;
    let expected = [(1.0 - t).powi(2), 2.0 * t * (1.0 - t), t * t];
    for (a, b) in Basis::QuadraticSpline.at(1, 0, t).value.iter().zip(expected) {
        assert!((a - b).abs() < 1e-15);
    }
}

#[test]
fn an_unknown_basis_is_named_with_those_that_exist() {
    let message = "cubic".parse::<Basis>().unwrap_err().to_string();
    assert!(message.contains("'cubic'") && message.contains("'quadratic_spline'"), "{message}");
}
