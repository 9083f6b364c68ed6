//! Laws at a given mean stress: the law of the total strain, inverted, and the opening beyond the apex.

use proptest::prelude::*;
use tawami::law::{DruckerPrager, Friction, Law, LinearElastic, MohrCoulomb, NeoHookean};
use tawami::tensor::{deviator, AtMean, Strain, Stress, Sym};

use super::plasticity::{elastic, friction, history_of, laws, pyramid, strain, strains};

const OLD: Stress = Stress { deviator: [0.1, -0.05, -0.05, 0.02], mean: -0.3 };

/// Both frictional laws, whose apex is at the mean stress of the second.
fn with_apex(f: Friction) -> [(Box<dyn Law>, f64); 2] {
    let (phi, psi) = (f.phi.to_radians(), f.psi.to_radians().tan());
    let flow = 3.0 * psi / (9.0 + 12.0 * psi * psi).sqrt();
    let d = (1.0 - flow * flow / 3.0).sqrt() + flow * phi.sin() / 3.0;
    // c B / A = c cot phi: d cancels
    assert!(d > 0.0);
    let apex = f.c / phi.tan();
    [
        (Box::new(DruckerPrager::new(elastic(), f).unwrap()), apex),
        (Box::new(MohrCoulomb::new(elastic(), f).unwrap()), apex),
    ]
}

fn answer(law: &dyn Law, e: &Sym, mean: f64) -> (AtMean, Vec<f64>) {
    let history = history_of(law);
    let mut new = history.clone();
    (law.respond_at_mean(&deviator(e), &OLD.deviator, mean, &history, &mut new), new)
}

/// All derivatives in one list.
fn slopes(a: &AtMean) -> Vec<f64> {
    let mut all = a.dev_dev.concat();
    all.extend(a.dev_mean.iter().chain(&a.volume_dev).chain([&a.volume_mean]));
    all
}

fn apart(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |most, (x, y)| most.max((x - y).abs()))
}

/// Change of deviator and plastic volume along (de, dm): from the tangent, and as differences.
/// `None` across a kink.
fn derivatives(law: &dyn Law, e: &Sym, mean: f64, de: &Sym, dm: f64) -> Option<[[f64; 2]; 5]> {
    let h = 1e-7;
    let at = |s: f64| {
        let moved: Sym = std::array::from_fn(|k| e[k] + s * de[k]);
        answer(law, &moved, mean + s * dm).0
    };
    let (plus, minus, here) = (at(h), at(-h), at(0.0));
    if apart(&slopes(&plus), &slopes(&minus)) > 1e-4 {
        return None;
    }
    let de = deviator(de);
    let dot = |a: &Sym| (0..4).map(|j| a[j] * de[j]).sum::<f64>();
    let slope = |i: usize| match i {
        4 => dot(&here.volume_dev) + here.volume_mean * dm,
        i => dot(&here.dev_dev[i]) + here.dev_mean[i] * dm,
    };
    let part = |a: &AtMean, i: usize| if i == 4 { a.plastic_volume } else { a.deviator[i] };
    let difference = |i: usize| (part(&plus, i) - part(&minus, i)) / (2.0 * h);
    Some(std::array::from_fn(|i| [slope(i), difference(i)]))
}

proptest! {
    #[test]
    fn a_law_at_the_mean_stress_of_its_own_answer_is_that_answer(
        e in strains(), which in 0..laws().len(),
    ) {
        let law = &*laws()[which];
        let history = history_of(law);
        let mut new = history.clone();
        let increment = strain(&e);
        let (stress, moduli) = law.respond(&increment, &OLD, &history, &mut new);
        // below the apex, and not where the strain hardly determines the mean stress
        prop_assume!(moduli.mean_vol > 1e-2 * law.bulk_modulus());
        let (mine, mine_new) = answer(law, &e, stress.mean);
        let elastic = (stress.mean - OLD.mean) / law.bulk_modulus();
        let plastic = increment.volume - elastic;
        let total = AtMean::of_total(stress.deviator, plastic, &moduli, law.bulk_modulus());
        prop_assert!(apart(&mine.deviator, &stress.deviator) < 1e-13);
        prop_assert!((mine.plastic_volume - plastic).abs() < 1e-14);
        prop_assert!(apart(&slopes(&mine), &slopes(&total)) < 1e-10, "{which}: {mine:?} {total:?}");
        prop_assert!(apart(&mine_new, &new) < 1e-13);
    }

    #[test]
    fn tangents_at_a_mean_stress_are_differences(
        e in strains(), mean in -1.0..0.3_f64, de in strains(), dm in -0.3..0.3_f64,
        which in 0..laws().len(),
    ) {
        let compared = derivatives(&*laws()[which], &e, mean, &de, dm);
        prop_assume!(compared.is_some());
        for [slope, difference] in compared.unwrap() {
            prop_assert!(
                (slope - difference).abs() < 1e-5 * (1.0 + slope.abs()),
                "{which}: {slope} {difference}"
            );
        }
    }

    #[test]
    fn associated_flow_is_symmetric(e in strains(), mean in -1.0..0.0_f64, phi in 5.0..50.0_f64) {
        for (law, apex) in with_apex(friction(phi, 0.1, phi)) {
            prop_assume!(mean < apex);
            let (a, _) = answer(&*law, &e, mean);
            for i in 0..4 {
                prop_assert!((a.dev_mean[i] + a.volume_dev[i]).abs() < 1e-13);
                for j in 0..4 {
                    prop_assert!((a.dev_dev[i][j] - a.dev_dev[j][i]).abs() < 1e-12);
                }
            }
        }
    }

    #[test]
    fn beyond_the_apex_the_stress_is_isotropic_and_opens_the_material(
        e in strains(), psi in 0.0..30.0_f64, beyond in 1e-6..0.5_f64,
    ) {
        let mu = 2.0;
        for (law, apex) in with_apex(friction(30.0, 0.1, psi)) {
            let ((at, _), (below, _)) = (answer(&*law, &e, apex), answer(&*law, &e, apex - 1e-9));
            let (a, _) = answer(&*law, &e, apex + beyond);
            prop_assert!(a.deviator == [0.0; 4] && a.dev_dev == [[0.0; 4]; 4]);
            let opened = a.plastic_volume - at.plastic_volume;
            prop_assert!((opened - beyond / (0.1 * mu)).abs() < 1e-12 * opened.max(1.0));
            // continuous there
            prop_assert!(apart(&below.deviator, &at.deviator) < 1e-7);
            prop_assert!((below.plastic_volume - at.plastic_volume).abs() < 1e-6);
        }
    }

    #[test]
    fn other_laws_keep_their_volume(e in strains(), mean in -1.0..1.0_f64) {
        let linear = LinearElastic::from_e_nu(1.0, 0.5).unwrap();
        let (a, _) = answer(&linear, &e, mean);
        let (b, _) = linear.respond(
            &Strain { deviator: deviator(&e), volume: 0.0 }, &OLD, &[], &mut [],
        );
        prop_assert!(a.deviator == b.deviator && a.plastic_volume == 0.0);
        prop_assert!(a.dev_mean == [0.0; 4] && a.volume_dev == [0.0; 4] && a.volume_mean == 0.0);
        let (c, _) = answer(&NeoHookean::new(elastic()), &e, mean);
        prop_assert!(c.plastic_volume == 0.0 && c.volume_mean == 0.0);
        let (t, _) = answer(&pyramid(0.0, 0.3, 0.0), &e, mean);
        prop_assert!(t.plastic_volume == 0.0 && t.dev_mean.iter().all(|d| *d == 0.0));
    }
}

#[test]
fn dilation_at_a_mean_stress_ends_at_its_limit() {
    let limited = Friction { eps_v_max: 0.012, ..friction(30.0, 0.1, 20.0) };
    for (law, _) in with_apex(limited) {
        let (a, new) = answer(&*law, &[0.3, -0.3, 0.0, 0.0], -1.0);
        assert!((a.plastic_volume - 0.002).abs() < 1e-15 && (new[1] - 0.012).abs() < 1e-15);
        assert!(a.volume_mean == 0.0 && a.volume_dev.iter().all(|d| *d == 0.0));
    }
}
