//! Modified Cam-Clay: closed forms, admissible stresses, softening, tension, rejected parameters.

use proptest::prelude::*;
use tawami::error::Error;
use tawami::law::{CamClay, Elastic, Law, LinearElastic};
use tawami::tensor::{Moduli, Stress, Sym};

use super::plasticity::{elastic, strain, strains};

const M: f64 = 1.1;
const THETA: f64 = 0.05;
const P_C: f64 = 0.4;
const P_T: f64 = 1e-3 * P_C;

pub fn clay() -> CamClay {
    CamClay::new(elastic(), M, THETA + 0.01, 0.01, P_C, 1e-3).unwrap()
}

fn q_of(s: &Sym) -> f64 {
    (1.5 * (s[0] * s[0] + s[1] * s[1] + s[2] * s[2] + 2.0 * s[3] * s[3])).sqrt()
}

/// The yield function over the square of the size of the ellipse.
fn excess(stress: &Stress, p_c: f64) -> f64 {
    let (q, p) = (q_of(&stress.deviator), -stress.mean);
    ((q / M).powi(2) + (p + P_T) * (p - p_c)) / (p_c + P_T).powi(2)
}

/// Deviator, mean stress and history after one step, and its tangent.
fn step(law: &dyn Law, e: &Sym, old: &Stress, history: &[f64]) -> (Stress, [f64; 2], Moduli) {
    let mut new = [0.0; 2];
    let (stress, moduli) = law.respond(&strain(e), old, history, &mut new);
    (stress, new, moduli)
}

proptest! {
    /// Flow is normal to the ellipse, p_c follows the plastic compression, and the stress lies on the ellipse.
    #[test]
    fn a_return_satisfies_the_equations(
        e in strains(), mean in -0.4..0.0_f64, shear in -0.1..0.1_f64, p_c in 0.1..0.8_f64,
    ) {
        let law = clay();
        let old = Stress { deviator: [shear, -0.5 * shear, -0.5 * shear, shear], mean };
        let (stress, new, _) = step(&law, &e, &old, &[p_c, 0.2]);
        prop_assert!(excess(&stress, new[0]) < 1e-11, "{}", excess(&stress, new[0]));
        let elastic = elastic();
        let (end, start) = (elastic.elastic_strain(&stress), elastic.elastic_strain(&old));
        let increment = strain(&e);
        let v = end.volume - start.volume - increment.volume;
        let plastic: Sym = std::array::from_fn(|i| {
            increment.deviator[i] + start.deviator[i] - end.deviator[i]
        });
        prop_assume!(new[1] > 0.2);
        prop_assert!(excess(&stress, new[0]).abs() < 1e-11);
        let expected = (p_c * (v / THETA).exp()).max(P_T);
        prop_assert!((new[0] - expected).abs() < 1e-9 * expected.max(p_c));
        // plastic deviator : v = 3 s / M^2 : g
        let g = P_T - 2.0 * stress.mean - new[0];
        for ((plastic, s), twice) in plastic.iter().zip(stress.deviator).zip([1.0, 1.0, 1.0, 2.0]) {
            prop_assert!((twice * 3.0 / (M * M) * s * v - plastic * g).abs() < 1e-10);
        }
        let [xx, yy, zz, xy] = plastic;
        let size = (2.0 / 3.0 * (xx * xx + yy * yy + zz * zz + 0.5 * xy * xy)).sqrt();
        prop_assert!((new[1] - 0.2 - size).abs() < 1e-9);
        // and it stays there
        let (again, same, _) = step(&law, &[0.0; 4], &stress, &new);
        prop_assert!((again.mean - stress.mean).abs() < 1e-12 && (same[0] - new[0]).abs() < 1e-12);
    }

    /// Shear at a constant volume strain ends at q = M (p + p_t), p = (p_c - p_t)/2, from both sides.
    #[test]
    fn shear_ends_at_the_critical_state(p in 0.02..0.39_f64, angle in 0.0..6.3_f64) {
        let law = clay();
        let (mut stress, mut history) = (Stress { deviator: [0.0; 4], mean: -p }, [P_C, 0.0]);
        let e = [angle.cos(), -angle.cos(), 0.0, 2.0 * angle.sin()].map(|e| 2e-3 * e);
        for _ in 0..600 {
            let (next, new, _) = step(&law, &e, &stress, &history);
            (stress, history) = (next, new);
        }
        let p = -stress.mean;
        prop_assert!((q_of(&stress.deviator) / (M * (p + P_T)) - 1.0).abs() < 1e-6);
        prop_assert!(((history[0] - P_T) / (2.0 * p) - 1.0).abs() < 1e-6);
    }
}

/// `p = p_c` on the virgin line: `eps_v = (p - p_0)/K + theta ln(p / p_0)`, in one step or in many.
#[test]
fn isotropic_compression_follows_the_virgin_line() {
    let law = clay();
    for steps in [1, 7] {
        let (mut stress, mut history) = (Stress::default(), [0.0; 2]);
        let p = 3.0;
        let volume = p / law.bulk_modulus() + THETA * (p / P_C).ln();
        let e = [1.0, 1.0, 1.0, 0.0].map(|one| -volume / 3.0 / f64::from(steps) * one);
        for _ in 0..steps {
            let (next, new, _) = step(&law, &e, &stress, &history);
            (stress, history) = (next, new);
        }
        assert!((stress.mean + p).abs() < 1e-12 && (history[0] - p).abs() < 1e-12, "{stress:?}");
        assert_eq!(history[1], 0.0);
    }
}

/// Isotropic expansion ends at the tensile strength, and softening when p_c is as small.
#[test]
fn tension_is_limited() {
    let law = clay();
    let free = Stress::default();
    let (stress, new, moduli) = step(&law, &[0.02, 0.02, 0.02, 0.0], &free, &[0.0; 2]);
    assert!((stress.mean - P_T).abs() < 1e-14, "{stress:?}");
    let v = -0.06 + P_T / law.bulk_modulus();
    assert!((new[0] / (P_C * (v / THETA).exp()) - 1.0).abs() < 1e-12);
    assert!(moduli.mean_vol.abs() < 1e-9 * law.bulk_modulus());
    let (stress, new, _) = step(&law, &[0.9, 0.5, 0.9, 0.3], &free, &[0.0; 2]);
    assert!((new[0] / P_T - 1.0).abs() < 1e-12 && excess(&stress, new[0]).abs() < 1e-9);
    // an opened clay closes before it carries load again
    let (stress, _, _) = step(&law, &[-0.02, -0.02, -0.02, 0.0], &free, &[P_T, 0.0]);
    assert!(-stress.mean < 0.01 * P_C && -stress.mean > P_T);
}

/// A mean stress beyond half the tensile strength opens the clay, with a slope, and lowers p_c.
#[test]
fn tension_at_a_mean_stress_opens_the_clay() {
    let (law, mu) = (clay(), 2.0);
    let at = |mean: f64| {
        let mut new = [0.0; 2];
        (law.respond_at_mean(&[0.02, -0.02, 0.0, 0.0], &[0.0; 4], mean, &[0.0; 2], &mut new), new)
    };
    let ((limit, before), (beyond, after)) = (at(0.5 * P_T), at(0.6 * P_T));
    let opened = 0.1 * P_T * (1.0 / (0.1 * mu) + THETA / (0.5 * P_T));
    assert!((beyond.plastic_volume - limit.plastic_volume - opened).abs() < 1e-12);
    assert_eq!(beyond.deviator, limit.deviator);
    let expected = (before[0] * (-opened / THETA).exp()).max(P_T);
    assert!((after[0] / expected - 1.0).abs() < 1e-12 && after[0] < before[0]);
}

#[test]
fn parameters_out_of_range_are_named() {
    let name = |given: [f64; 5]| {
        let [m, lambda, kappa, p_c, tension] = given;
        match CamClay::new(elastic(), m, lambda, kappa, p_c, tension) {
            Err(Error::Parameter { name, .. }) => name,
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(name([0.0, 0.2, 0.1, 0.4, 1e-3]), "M");
    assert_eq!(name([1.0, 0.1, 0.1, 0.4, 1e-3]), "lambda_star");
    assert_eq!(name([1.0, 0.1, -0.1, 0.4, 1e-3]), "kappa_star");
    assert_eq!(name([1.0, 0.2, 0.1, 0.0, 1e-3]), "preconsolidation");
    assert_eq!(name([1.0, 0.2, 0.1, 3.0, 1e-3]), "preconsolidation"); // 12 mu theta = 2.4
    assert_eq!(name([1.0, 0.2, 0.1, 0.4, 0.0]), "tension");
    let elastic = LinearElastic::from_k_mu(1.0, 1.0).unwrap();
    assert!(CamClay::new(elastic, 1.0, 0.2, 0.1, f64::NAN, 1e-3).is_err());
}
