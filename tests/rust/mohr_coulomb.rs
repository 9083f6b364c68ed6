//! Mohr-Coulomb: closest point, tangents near corners and near the incompressible limit, Tresca.

use proptest::prelude::*;
use tawami::law::{Elastic, Law, LinearElastic, MohrCoulomb};
use tawami::tensor::{trace, Moduli, Stress, Sym};

use super::plasticity::{derivatives, elastic, friction, laws, pyramid, strain, strains};

/// Principal stresses, the largest first.
fn principal(stress: &Stress) -> [f64; 3] {
    let [xx, yy, zz, xy] = stress.deviator;
    let (middle, radius) = (0.5 * (xx + yy), (0.5 * (xx - yy)).hypot(xy));
    let mut values = [middle + radius, middle - radius, zz].map(|s| s + stress.mean);
    values.sort_by(|a, b| b.total_cmp(a));
    values
}

/// `s1 - s3 + (s1 + s3) sin phi - 2 c cos phi`.
fn yield_function(phi: f64, c: f64, stress: &Stress) -> f64 {
    let ([s1, _, s3], phi) = (principal(stress), phi.to_radians());
    s1 - s3 + (s1 + s3) * phi.sin() - 2.0 * c * phi.cos()
}

/// The admissible stress nearest to a trial stress in the elastic energy, by Hildreth's method:
/// the six planes one after the other, without a word about order, edges or apex.
fn nearest(elastic: &LinearElastic, phi: f64, c: f64, trial: [f64; 3]) -> [f64; 3] {
    let (mu, k) = (elastic.shear_modulus(), elastic.bulk_modulus());
    let (sin, cos) = phi.to_radians().sin_cos();
    let orders = [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)];
    let planes = orders.map(|(i, j)| {
        let mut normal = [0.0; 3];
        (normal[i], normal[j]) = (1.0 + sin, sin - 1.0);
        let stiff = normal.map(|n| 2.0 * mu * (n - 2.0 * sin / 3.0) + k * 2.0 * sin);
        (normal, stiff)
    });
    let dot = |a: &[f64; 3], b: &[f64; 3]| (0..3).map(|i| a[i] * b[i]).sum::<f64>();
    let (mut stress, mut multipliers) = (trial, [0.0_f64; 6]);
    for _ in 0..20_000 {
        let before = multipliers;
        for ((normal, stiff), multiplier) in planes.iter().zip(&mut multipliers) {
            let excess = (dot(normal, &stress) - 2.0 * c * cos) / dot(normal, stiff);
            let change = excess.max(-*multiplier);
            *multiplier += change;
            (0..3).for_each(|i| stress[i] -= change * stiff[i]);
        }
        if multipliers == before {
            break;
        }
    }
    stress
}

prop_compose! {
    /// Any strain, and ones with equal principal values: in the plane, or one of these and zz.
    fn cornered()(e in strains(), corner in 0..4) -> Sym {
        match corner {
            0 => [e[0], e[0], e[2], 0.0],
            1 => [e[0], e[1], e[0], 0.0],
            2 => [e[0], e[0], e[0], 0.0],
            _ => e,
        }
    }
}

proptest! {
    #[test]
    fn associated_mohr_coulomb_is_the_closest_point(
        e in cornered(), mean in -1.5..0.5_f64, phi in 0.0..60.0_f64, c in 0.01..0.3_f64,
    ) {
        let phi = if phi < 2.0 { 0.0 } else { phi };
        let law = pyramid(phi, c, phi);
        let old = Stress { deviator: [0.0; 4], mean };
        let (trial, _) = elastic().respond(&strain(&e), &old, &[], &mut []);
        let (stress, _) = law.respond(&strain(&e), &old, &[0.0; 2], &mut [0.0; 2]);
        let expected = nearest(&elastic(), phi, c, principal(&trial));
        for (s, expected) in principal(&stress).iter().zip(expected) {
            prop_assert!((s - expected).abs() < 1e-7, "{stress:?} {expected:?}");
        }
        // and its principal directions are those of the trial stress
        let (s, t) = (stress.deviator, trial.deviator);
        prop_assert!(((s[0] - s[1]) * t[3] - (t[0] - t[1]) * s[3]).abs() < 1e-13);
    }

    #[test]
    fn mohr_coulomb_is_never_exceeded_and_its_plastic_strain_is_the_rest(
        e in cornered(), mean in -1.5..0.5_f64, phi in 0.0..89.0_f64, part in 0.0..1.0_f64,
        c in 0.01..0.3_f64, ratio in 0.0..6.0_f64,
    ) {
        let phi = if phi < 2.0 { 0.0 } else { phi };
        let elastic = LinearElastic::from_k_mu(2.0 * 10.0_f64.powf(ratio), 2.0).unwrap();
        let law = MohrCoulomb::new(elastic, friction(phi, c, part * phi)).unwrap();
        let old = Stress { deviator: [0.0; 4], mean };
        let mut increment = strain(&e);
        increment.volume /= 10.0_f64.powf(ratio);
        let mut new = [0.0; 2];
        let (stress, moduli) = law.respond(&increment, &old, &[0.0; 2], &mut new);
        prop_assert!(yield_function(phi, c, &stress) < 1e-14 * elastic.bulk_modulus().max(10.0));
        let apex = moduli == Moduli::default();
        let elastic_part = law.elastic_strain(&Stress { mean: stress.mean - mean, ..stress });
        if !apex {
            prop_assert!((increment.volume - elastic_part.volume - new[1]).abs() < 1e-14);
        }
        let part = |i: usize| increment.deviator[i] - elastic_part.deviator[i];
        // half of gamma: the component of a tensor, as of a stress
        let plastic = [part(0), part(1), part(2), 0.5 * part(3)];
        let [e1, _, e3] = principal(&Stress { deviator: plastic, mean: 0.0 });
        prop_assert!((e1 - e3 - new[0]).abs() < 1e-13, "{} {}", e1 - e3, new[0]);
    }

    #[test]
    fn tangents_of_mohr_coulomb_hold_near_the_incompressible_limit(
        e in strains(), de in strains(), part in 0.0..1.0_f64,
    ) {
        let elastic = LinearElastic::from_k_mu(2e6, 2.0).unwrap();
        let law = MohrCoulomb::new(elastic, friction(30.0, 0.1, 30.0 * part)).unwrap();
        let small = |e: &Sym| {
            let volume = trace(e) * (1.0 - 1e-6) / 3.0;
            [e[0] - volume, e[1] - volume, e[2] - volume, e[3]]
        };
        let old = Stress { deviator: [0.0; 4], mean: -0.5 };
        let compared = derivatives(&law, &old, &small(&e), &small(&de));
        prop_assume!(compared.is_some());
        for [slope, difference] in compared.unwrap() {
            prop_assert!((slope - difference).abs() < 1e-3, "{slope} {difference}");
        }
    }

    #[test]
    fn equal_principal_stresses_are_no_special_case(
        gap in 0.0..1e-3_f64, exact: bool, zz in -0.3..0.3_f64, de in strains(),
        which in 0..laws().len(),
    ) {
        let e = [if exact { 0.1 } else { 0.1 + gap }, 0.1, zz, 0.0];
        let compared = derivatives(&*laws()[which], &Stress::default(), &e, &de);
        prop_assume!(compared.is_some());
        for [slope, difference] in compared.unwrap() {
            prop_assert!((slope - difference).abs() < 1e-4, "{which}: {slope} {difference}");
        }
    }
}

#[test]
fn tresca_in_shear_and_in_uniaxial_strain_follows_the_closed_form() {
    let (c, mu, k) = (0.3, 2.0, 5.0);
    let law = pyramid(0.0, c, 0.0);
    assert!(!law.pressure_dependent() && pyramid(20.0, 0.0, 0.0).pressure_dependent());
    let respond = |e: &Sym| {
        let mut new = [0.0; 2];
        (law.respond(&strain(e), &Stress::default(), &[0.0; 2], &mut new).0, new)
    };
    let gamma = 0.4;
    let (stress, new) = respond(&[0.0, 0.0, 0.0, gamma]);
    assert!((stress.deviator[3] - c).abs() < 1e-15 && stress.mean == 0.0);
    assert!((new[0] - (gamma - c / mu)).abs() < 1e-15 && new[1] == 0.0);
    // as von Mises with sigma_y = 2 c: an edge, where both agree
    let e = 0.4;
    let (stress, new) = respond(&[e, 0.0, 0.0, 0.0]);
    assert!((1.5 * stress.deviator[0] - 2.0 * c).abs() < 1e-15);
    assert!((stress.mean - k * e).abs() < 1e-15);
    assert!((new[0] - (e - c / mu)).abs() < 1e-15);
}
