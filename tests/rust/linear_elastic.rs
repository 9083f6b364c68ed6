//! Linear elasticity: its constants, its tangent, what it refuses.

use proptest::prelude::*;
use tawami::error::Error;
use tawami::law::{Elastic, Law, LinearElastic};
use tawami::tensor::{deviator, mean, trace, Strain, Stress};

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

proptest! {
    #[test]
    fn constants_agree_however_they_are_given(e in 1.0..1e9_f64, nu in -0.9..0.499_f64) {
        let law = LinearElastic::from_e_nu(e, nu).unwrap();
        let (k, mu) = (law.bulk_modulus(), law.shear_modulus());
        // E = 9 K mu / (3 K + mu), nu = (3 K - 2 mu) / (2 (3 K + mu))
        prop_assert!(close(e, 9.0 * k * mu / (3.0 * k + mu), 1e-12));
        prop_assert!((nu - (3.0 * k - 2.0 * mu) / (2.0 * (3.0 * k + mu))).abs() < 1e-12);
        prop_assert_eq!(LinearElastic::from_k_mu(k, mu).unwrap(), law);
        prop_assert_eq!(LinearElastic::from_e_one_minus_2nu(e, 1.0 - 2.0 * nu).unwrap(), law);
    }

    #[test]
    fn tangent_is_the_difference_and_uniaxial_strain_gives_the_textbook_modulus(
        strain in [-1e-2..1e-2_f64, -1e-2..1e-2_f64, -1e-2..1e-2_f64, -1e-2..1e-2_f64],
    ) {
        let (e, nu) = (2.5e6, 0.3);
        let law = LinearElastic::from_e_nu(e, nu).unwrap();
        let old = Stress { deviator: [1.0, -3.0, 2.0, 5.0], mean: -7.0 };
        let increment = Strain { deviator: deviator(&strain), volume: trace(&strain) };
        let (stress, c) = law.respond(&increment, &old, &[], &mut []);
        for i in 0..4 {
            let linear: f64 = (0..4).map(|j| c.dev_dev[i][j] * increment.deviator[j]).sum();
            let expected = old.deviator[i] + linear + c.dev_vol[i] * increment.volume;
            prop_assert!((stress.deviator[i] - expected).abs() < 1e-9);
        }
        let coupling: f64 = (0..4).map(|j| c.mean_dev[j] * increment.deviator[j]).sum();
        let expected = old.mean + coupling + c.mean_vol * increment.volume;
        prop_assert!((stress.mean - expected).abs() < 1e-9);

        let free = Stress { deviator: [0.0; 4], mean: 0.0 };
        let uniaxial = [strain[0], 0.0, 0.0, strain[3]];
        let increment = Strain { deviator: deviator(&uniaxial), volume: trace(&uniaxial) };
        let (stress, _) = law.respond(&increment, &free, &[], &mut []);
        let modulus = e * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
        prop_assert!((stress.deviator[0] + stress.mean - modulus * strain[0]).abs() < 1e-8);
        let shear = e / (2.0 * (1.0 + nu)) * strain[3]; // gamma, not eps_xy
        prop_assert!((stress.deviator[3] - shear).abs() < 1e-8);
        prop_assert!(mean(&stress.deviator).abs() < 1e-9);
    }
}

#[test]
fn the_digits_of_one_minus_2nu_are_kept() {
    let law = LinearElastic::from_e_one_minus_2nu(3.0, 2e-12).unwrap();
    assert!(close(law.bulk_modulus(), 3.0 / (3.0 * 2e-12), 1e-15));
}

#[test]
fn an_incompressible_material_takes_a_strain_without_volume() {
    let law = LinearElastic::from_e_nu(3.0, 0.5).unwrap();
    assert!(law.bulk_modulus().is_infinite() && close(law.shear_modulus(), 1.0, 1e-15));
    let increment = Strain { deviator: [1.0, -1.0, 0.0, 0.0], volume: 0.0 };
    let (stress, _) =
        law.respond(&increment, &Stress { deviator: [0.0; 4], mean: 4.0 }, &[], &mut []);
    assert!(close(stress.mean, 4.0, 1e-15) && close(stress.deviator[0], 2.0, 1e-15));
    assert!(close(law.elastic_energy(&increment), 2.0, 1e-15));
}

#[test]
fn parameters_out_of_range_are_named() {
    let name = |result: Result<LinearElastic, Error>| match result {
        Err(Error::Parameter { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(name(LinearElastic::from_e_nu(1.0, 0.50001)), "nu");
    assert_eq!(name(LinearElastic::from_e_nu(1.0, -1.0)), "nu");
    assert_eq!(name(LinearElastic::from_e_nu(1.0, f64::NAN)), "nu");
    assert_eq!(name(LinearElastic::from_e_nu(0.0, 0.3)), "E");
    assert_eq!(name(LinearElastic::from_e_nu(f64::INFINITY, 0.3)), "E");
    assert_eq!(name(LinearElastic::from_e_nu(5e-324, 0.3)), "E");
    assert_eq!(name(LinearElastic::from_e_one_minus_2nu(1e308, 1e-12)), "E");
    assert_eq!(name(LinearElastic::from_k_mu(-1.0, 1.0)), "K");
    assert_eq!(name(LinearElastic::from_k_mu(1.0, 0.0)), "mu");
    assert_eq!(name(LinearElastic::from_e_one_minus_2nu(1.0, -1e-9)), "one_minus_2nu");
    assert_eq!(name(LinearElastic::from_e_one_minus_2nu(1.0, 3.0)), "one_minus_2nu");
}
