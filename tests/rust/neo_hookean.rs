//! Neo-Hookean elasticity: closed forms, its inverse, and the digits of small strains.

use proptest::prelude::*;
use tawami::law::{Elastic, Law, LinearElastic, NeoHookean};
use tawami::tensor::{Strain, Stress, Sym};

const MU: f64 = 2.0;

fn law() -> NeoHookean {
    NeoHookean::new(LinearElastic::from_k_mu(5.0, MU).unwrap())
}

fn stress(strain: &Strain) -> Stress {
    law().respond(strain, &Stress::default(), &[], &mut []).0
}

fn size(e: &Sym) -> f64 {
    e.iter().fold(0.0, |most, e| most.max(e.abs()))
}

prop_compose! {
    /// Of every size.
    fn strains()(
        e in [-1.0..1.0_f64, -1.0..1.0_f64, -1.0..1.0_f64],
        digits in 0..18_i32,
        volume in -0.3..0.3_f64,
    ) -> Strain {
        let e = e.map(|e| e * 10.0_f64.powi(-digits));
        Strain { deviator: [e[0], e[1], -e[0] - e[1], e[2]], volume }
    }
}

/// `exp(a)` of a symmetric tensor in the plane: Taylor's series of a/2^10, squared ten times.
fn exponential(a: [[f64; 2]; 2]) -> [[f64; 2]; 2] {
    let times = |a: &[[f64; 2]; 2], b: &[[f64; 2]; 2]| -> [[f64; 2]; 2] {
        std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
    };
    let small = a.map(|row| row.map(|x| x / 1024.0));
    let (mut term, mut sum) = ([[1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [0.0, 1.0]]);
    for n in 1..12 {
        term = times(&term, &small).map(|row| row.map(|x| x / f64::from(n)));
        (0..2).for_each(|i| (0..2).for_each(|j| sum[i][j] += term[i][j]));
    }
    (0..10).for_each(|_| sum = times(&sum, &sum));
    sum
}

proptest! {
    #[test]
    fn the_stress_is_that_of_the_exponential(e in strains()) {
        let [xx, yy, zz, gamma] = e.deviator;
        let b = exponential([[2.0 * xx, gamma], [gamma, 2.0 * yy]]);
        let (b_zz, found) = ((2.0 * zz).exp(), stress(&e));
        let third = (b[0][0] + b[1][1] + b_zz) / 3.0;
        let expected = [b[0][0] - third, b[1][1] - third, b_zz - third, b[0][1]];
        for (s, expected) in found.deviator.iter().zip(expected) {
            prop_assert!((s - MU * expected).abs() < 1e-11 * third);
        }
        prop_assert_eq!(found.mean, 5.0 * e.volume);
    }

    #[test]
    fn the_elastic_strain_is_the_inverse(e in strains()) {
        let found = law().elastic_strain(&stress(&e));
        for (e_found, expected) in found.deviator.iter().zip(e.deviator) {
            // the smallest stretch is known as well as the largest stress
            prop_assert!((e_found - expected).abs() < 1e-13 * size(&e.deviator), "{found:?}");
        }
        prop_assert!((found.volume - e.volume).abs() < 1e-15);
    }

    #[test]
    fn small_strains_give_the_linear_law_with_all_digits(e in strains(), digits in 3..12_i32) {
        let e = Strain { deviator: e.deviator.map(|e| e * 10.0_f64.powi(-digits)), ..e };
        let largest = size(&e.deviator);
        let (found, c) = law().respond(&e, &Stress::default(), &[], &mut []);
        let linear = [2.0 * MU, 2.0 * MU, 2.0 * MU, MU];
        for (i, stiffness) in linear.iter().enumerate() {
            let expected = stiffness * e.deviator[i];
            let error = (found.deviator[i] - expected).abs();
            prop_assert!(error <= (20.0 * largest + 1e-14) * largest);
            let change: f64 = (0..4).map(|j| c.dev_dev[i][j] * e.deviator[j]).sum();
            prop_assert!((change - expected).abs() <= (40.0 * largest + 1e-14) * largest);
        }
        let energy = law().elastic_energy(&Strain { volume: 0.0, ..e });
        let expected = 0.5 * (0..4).map(|i| linear[i] * e.deviator[i].powi(2)).sum::<f64>();
        prop_assert!((energy - expected).abs() <= (20.0 * largest + 1e-14) * expected);
    }
}

#[test]
fn no_stress_is_no_strain_and_a_huge_one_is_inverted() {
    assert_eq!(law().elastic_strain(&Stress::default()).deviator, [0.0; 4]);
    for stretch in [10.0_f64, 100.0, 1e4] {
        // uniaxial and isochoric: b = (l^2, 1/l, 1/l)
        let third = (stretch.powi(2) + 2.0 / stretch) / 3.0;
        let s = [stretch.powi(2) - third, 1.0 / stretch - third, 1.0 / stretch - third, 0.0];
        let found = law().elastic_strain(&Stress { deviator: s.map(|s| MU * s), mean: 0.0 });
        let digits = 1e-16 * stretch.powi(3); // of 1/l beside l^2
        assert!((found.deviator[0] - stretch.ln()).abs() < 1e-14 + digits);
        assert!((found.deviator[1] + 0.5 * stretch.ln()).abs() < 1e-14 + digits);
    }
}
