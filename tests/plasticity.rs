//! Von Mises and Drucker-Prager: yield, tangents against differences, Mohr-Coulomb in plane strain.

use proptest::prelude::*;
use tawami::error::Error;
use tawami::material::{
    DruckerPrager, Friction, LinearElastic, Material, Strain, Stress, VonMises,
};
use tawami::tensor::{deviator, trace, Sym};

fn elastic() -> LinearElastic {
    LinearElastic::from_k_mu(5.0, 2.0).unwrap()
}

fn friction(phi: f64, c: f64, psi: f64) -> Friction {
    Friction { phi, c, psi, eps_v_max: f64::INFINITY, tiny: false }
}

fn cone(phi: f64, c: f64, psi: f64) -> DruckerPrager {
    DruckerPrager::new(elastic(), friction(phi, c, psi)).unwrap()
}

fn strain(e: &Sym) -> Strain {
    Strain { deviator: deviator(e), volume: trace(e) }
}

fn laws() -> Vec<Box<dyn Material>> {
    vec![
        Box::new(VonMises::new(elastic(), 0.5, 0.0).unwrap()),
        Box::new(VonMises::new(elastic(), 0.5, 0.7).unwrap()),
        Box::new(cone(30.0, 0.1, 0.0)),
        Box::new(cone(30.0, 0.1, 12.0)),
        Box::new(cone(0.0, 0.3, 0.0)),
        Box::new(cone(45.0, 0.0, 45.0)),
        Box::new(
            DruckerPrager::new(
                elastic(),
                Friction { eps_v_max: 0.02, ..friction(30.0, 0.1, 20.0) },
            )
            .unwrap(),
        ),
    ]
}

fn history_of(law: &dyn Material) -> Vec<f64> {
    vec![0.01; law.history().len()]
}

prop_compose! {
    fn strains()(e in [-0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64]) -> Sym { e }
}

proptest! {
    #[test]
    fn tangents_are_differences(e in strains(), de in strains(), which in 0..7_usize) {
        let law = &*laws()[which];
        let history = history_of(law);
        let old = Stress { deviator: [0.1, -0.05, -0.05, 0.02], mean: -0.3 };
        let h = 1e-7;
        let at = |s: f64| {
            let moved = strain(&std::array::from_fn(|k| e[k] + s * de[k]));
            let mut new = history.clone();
            law.respond(&moved, &old, &history, &mut new)
        };
        let ((plus, c), (minus, d)) = (at(h), at(-h));
        // not across a kink: elastic on one side, or the apex
        prop_assume!((c.mean_vol - d.mean_vol).abs() < 1e-4 && (c.dev_dev[0][0] - d.dev_dev[0][0]).abs() < 1e-4);
        let (_, c) = at(0.0);
        let direction = strain(&de);
        for i in 0..4 {
            let slope = (0..4).map(|j| c.dev_dev[i][j] * direction.deviator[j]).sum::<f64>()
                + c.dev_vol[i] * direction.volume;
            let difference = (plus.deviator[i] - minus.deviator[i]) / (2.0 * h);
            prop_assert!((slope - difference).abs() < 1e-5, "{which}: {slope} {difference}");
        }
        let slope = (0..4).map(|j| c.mean_dev[j] * direction.deviator[j]).sum::<f64>()
            + c.mean_vol * direction.volume;
        prop_assert!((slope - (plus.mean - minus.mean) / (2.0 * h)).abs() < 1e-5);
    }

    #[test]
    fn stress_is_admissible_and_no_strain_changes_nothing(e in strains(), which in 0..7_usize) {
        let law = &*laws()[which];
        let history = history_of(law);
        let mut new = history.clone();
        let free = Stress { deviator: [0.0; 4], mean: 0.0 };
        let (stress, _) = law.respond(&strain(&e), &free, &history, &mut new);
        prop_assert!(new.iter().zip(&history).all(|(a, b)| a >= b || law.history().len() == 2));
        let mut same = new.clone();
        let (again, _) = law.respond(&strain(&[0.0; 4]), &stress, &new, &mut same);
        prop_assert!((again.mean - stress.mean).abs() < 1e-12);
        for k in 0..4 {
            prop_assert!((again.deviator[k] - stress.deviator[k]).abs() < 1e-12);
        }
        prop_assert!(stress.deviator.iter().take(3).sum::<f64>().abs() < 1e-13);
    }

    #[test]
    fn plane_strain_limits_are_those_of_mohr_coulomb(phi in 5.0..50.0_f64, part in 0.0..1.0_f64, c in 0.0..0.2_f64) {
        // shear at a constant mean in-plane stress until nothing changes; sigma_zz finds its place
        let law = cone(phi, c, part * phi);
        let mut stress = Stress { deviator: [0.0; 4], mean: -1.0 };
        let mut history = vec![0.0, 0.0];
        for _ in 0..4000 {
            let step = |volume: f64| {
                let mut new = history.clone();
                let e = [2e-3 + volume / 2.0, -2e-3 + volume / 2.0, 0.0, 0.0];
                let (s, _) = law.respond(&strain(&e), &stress, &history, &mut new);
                (s, new)
            };
            // the in-plane mean stress stays -1: one secant for the volume
            let plane = |s: &Stress| 0.5 * (s.deviator[0] + s.deviator[1]) + s.mean;
            let (mut a, mut b) = (0.0, 1e-5);
            for _ in 0..30 {
                let (fa, fb) = (plane(&step(a).0) + 1.0, plane(&step(b).0) + 1.0);
                if (fb - fa).abs() < 1e-15 { break; }
                (a, b) = (b, b - fb * (b - a) / (fb - fa));
            }
            let (s, new) = step(b);
            (stress, history) = (s, new);
        }
        let shear = 0.5 * (stress.deviator[0] - stress.deviator[1]);
        let phi = phi.to_radians();
        let expected = phi.sin() + c * phi.cos();
        prop_assert!((shear - expected).abs() < 2e-3 * expected, "{shear} {expected}");
    }
}

#[test]
fn von_mises_in_uniaxial_strain_follows_the_closed_form() {
    let (sigma_y, h) = (0.5, 0.7);
    let law = VonMises::new(elastic(), sigma_y, h).unwrap();
    let mut new = [0.0];
    let free = Stress { deviator: [0.0; 4], mean: 0.0 };
    let e = 0.4;
    let (stress, _) = law.respond(&strain(&[e, 0.0, 0.0, 0.0]), &free, &[0.0], &mut new);
    // q = 2 mu e before; kappa = (q - sigma_y) / (3 mu + H)
    let kappa = (2.0 * 2.0 * e - sigma_y) / (6.0 + h);
    assert!((new[0] - kappa).abs() < 1e-14);
    assert!((1.5 * stress.deviator[0] - (sigma_y + h * kappa)).abs() < 1e-14);
    assert!((stress.mean - 5.0 * e).abs() < 1e-14);
}

#[test]
fn tension_beyond_the_apex_leaves_its_stress() {
    for (c, psi) in [(0.0, 0.0), (0.1, 0.0), (0.1, 20.0)] {
        let law = cone(30.0, c, psi);
        let free = Stress { deviator: [0.0; 4], mean: 0.0 };
        let (stress, moduli) =
            law.respond(&strain(&[0.3, 0.29, 0.3, 0.0]), &free, &[0.0; 2], &mut [0.0; 2]);
        assert!(stress.deviator.iter().all(|&s| s == 0.0));
        assert_eq!(moduli.mean_vol, 0.0);
        // sin phi p = c cos phi in the plane for psi = 0
        if psi == 0.0 {
            assert!((stress.mean - c / 30.0_f64.to_radians().tan()).abs() < 1e-14);
        }
    }
}

#[test]
fn dilatancy_ends_where_it_is_told_to() {
    let limited = Friction { eps_v_max: 0.005, ..friction(30.0, 0.0, 20.0) };
    let law = DruckerPrager::new(elastic(), limited).unwrap();
    let old = Stress { deviator: [0.0; 4], mean: -1.0 };
    let shear = strain(&[0.5, -0.5, 0.0, 0.0]);
    let mut new = [0.0; 2];
    let (stress, _) = law.respond(&shear, &old, &[0.0, 0.004], &mut new);
    assert!((new[1] - 0.005).abs() < 1e-15);
    assert!((stress.mean - (old.mean - 5.0 * 0.001)).abs() < 1e-14);
    law.respond(&strain(&[0.15, -0.15, 0.0, 0.0]), &old, &[0.0, 0.0], &mut new);
    assert!(new[1] > 0.0 && new[1] < 0.0051);
    law.respond(&shear, &old, &[0.0, 0.005], &mut new);
    assert_eq!(new[1], 0.005);
}

#[test]
fn parameters_out_of_range_are_named() {
    let name = |f: Friction| match DruckerPrager::new(elastic(), f) {
        Err(Error::Parameter { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(name(friction(90.0, 0.0, 0.0)), "phi");
    assert_eq!(name(friction(-1.0, 0.0, 0.0)), "phi");
    assert_eq!(name(friction(f64::NAN, 0.0, 0.0)), "phi");
    assert_eq!(name(friction(0.52, 0.0, 0.0)), "phi"); // 30 degrees in radians
    assert!(
        DruckerPrager::new(elastic(), Friction { tiny: true, ..friction(0.52, 0.0, 0.0) }).is_ok()
    );
    assert_eq!(name(friction(30.0, 0.0, 31.0)), "psi");
    assert_eq!(name(friction(30.0, -1.0, 0.0)), "c");
    assert_eq!(name(friction(0.0, 0.0, 0.0)), "c");
    assert_eq!(name(Friction { eps_v_max: -1.0, ..friction(30.0, 0.0, 0.0) }), "eps_v_max");
    let name = |y: f64, h: f64| match VonMises::new(elastic(), y, h) {
        Err(Error::Parameter { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    assert_eq!(name(0.0, 0.0), "yield_stress");
    assert_eq!(name(1.0, -1.0), "hardening");
}
