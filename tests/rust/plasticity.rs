//! Von Mises, Drucker-Prager, Mohr-Coulomb: yield, tangents against differences, limit states.

use proptest::prelude::*;
use tawami::error::Error;
use tawami::law::{DruckerPrager, Friction, Law, LinearElastic, MohrCoulomb, VonMises};
use tawami::tensor::{deviator, trace, Moduli, Strain, Stress, Sym};

pub fn elastic() -> LinearElastic {
    LinearElastic::from_k_mu(5.0, 2.0).unwrap()
}

pub fn friction(phi: f64, c: f64, psi: f64) -> Friction {
    Friction { phi, c, psi, eps_v_max: f64::INFINITY, tiny: false }
}

pub fn pyramid(phi: f64, c: f64, psi: f64) -> MohrCoulomb {
    MohrCoulomb::new(elastic(), friction(phi, c, psi)).unwrap()
}

/// Both frictional laws with the same parameters.
fn frictional(elastic: LinearElastic, friction: Friction) -> [Box<dyn Law>; 2] {
    [
        Box::new(DruckerPrager::new(elastic, friction).unwrap()),
        Box::new(MohrCoulomb::new(elastic, friction).unwrap()),
    ]
}

pub fn strain(e: &Sym) -> Strain {
    Strain { deviator: deviator(e), volume: trace(e) }
}

pub fn laws() -> Vec<Box<dyn Law>> {
    let limited = Friction { eps_v_max: 0.02, ..friction(30.0, 0.1, 20.0) };
    let frictions = [
        friction(30.0, 0.1, 0.0),
        friction(30.0, 0.1, 12.0),
        friction(0.0, 0.3, 0.0),
        friction(45.0, 0.0, 45.0),
        limited,
    ];
    let mut laws: Vec<Box<dyn Law>> = vec![
        Box::new(VonMises::new(elastic(), 0.5, 0.0).unwrap()),
        Box::new(VonMises::new(elastic(), 0.5, 0.7).unwrap()),
    ];
    laws.extend(frictions.into_iter().flat_map(|f| frictional(elastic(), f)));
    laws.push(Box::new(super::cam_clay::clay()));
    laws
}

fn difference(a: &Moduli, b: &Moduli) -> f64 {
    let all = |m: &Moduli| {
        let mut all = m.dev_dev.concat();
        all.extend(m.dev_vol.iter().chain(&m.mean_dev).chain([&m.mean_vol]));
        all
    };
    all(a).iter().zip(all(b)).fold(0.0, |most, (x, y)| most.max((x - y).abs()))
}

/// Derivatives of deviator and mean stress along `de`: from the tangent, and as differences.
/// `None` across a kink: elastic on one side, another plane, or the apex.
pub fn derivatives(law: &dyn Law, old: &Stress, e: &Sym, de: &Sym) -> Option<[[f64; 2]; 5]> {
    let history = history_of(law);
    let h = 1e-7;
    let at = |s: f64| {
        let moved = strain(&std::array::from_fn(|k| e[k] + s * de[k]));
        law.respond(&moved, old, &history, &mut history.clone())
    };
    let ((plus, c), (minus, d), (_, moduli)) = (at(h), at(-h), at(0.0));
    if difference(&c, &d) > 1e-4 * law.bulk_modulus() {
        return None;
    }
    let direction = strain(de);
    let dot = |a: &Sym| (0..4).map(|j| a[j] * direction.deviator[j]).sum::<f64>();
    let slope = |i: usize| match i {
        4 => dot(&moduli.mean_dev) + moduli.mean_vol * direction.volume,
        i => dot(&moduli.dev_dev[i]) + moduli.dev_vol[i] * direction.volume,
    };
    let part = |s: &Stress, i: usize| if i == 4 { s.mean } else { s.deviator[i] };
    let difference = |i: usize| (part(&plus, i) - part(&minus, i)) / (2.0 * h);
    Some(std::array::from_fn(|i| [slope(i), difference(i)]))
}

/// Shear stress in the plane after shear at a mean in-plane stress of -1 until nothing changes;
/// sigma_zz finds its place.
fn limit_shear(law: &dyn Law) -> f64 {
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
            if (fb - fa).abs() < 1e-15 {
                break;
            }
            (a, b) = (b, b - fb * (b - a) / (fb - fa));
        }
        (stress, history) = step(b);
    }
    0.5 * (stress.deviator[0] - stress.deviator[1])
}

/// Some history; for Cam-Clay p_c is between the stresses of the tests.
pub fn history_of(law: &dyn Law) -> Vec<f64> {
    let value = |name: &&str| if *name == "preconsolidation" { 0.5 } else { 0.01 };
    law.history().iter().map(value).collect()
}

prop_compose! {
    pub fn strains()(e in [-0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64, -0.3..0.3_f64]) -> Sym { e }
}

proptest! {
    #[test]
    fn tangents_are_differences(e in strains(), de in strains(), which in 0..laws().len()) {
        let old = Stress { deviator: [0.1, -0.05, -0.05, 0.02], mean: -0.3 };
        let compared = derivatives(&*laws()[which], &old, &e, &de);
        prop_assume!(compared.is_some());
        for [slope, difference] in compared.unwrap() {
            prop_assert!((slope - difference).abs() < 1e-5, "{which}: {slope} {difference}");
        }
    }

    #[test]
    fn stress_is_admissible_and_no_strain_changes_nothing(e in strains(), which in 0..laws().len()) {
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
    fn plane_strain_limits_are_those_of_mohr_coulomb(
        phi in 5.0..50.0_f64, part in 0.0..1.0_f64, c in 0.0..0.2_f64,
    ) {
        let angle = phi.to_radians();
        let expected = angle.sin() + c * angle.cos();
        let laws = frictional(elastic(), friction(phi, c, part * phi));
        for (law, tolerance) in laws.iter().zip([2e-3, 1e-10]) {
            let shear = limit_shear(&**law);
            prop_assert!((shear - expected).abs() < tolerance * expected, "{shear} {expected}");
        }
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
        for (which, law) in frictional(elastic(), friction(30.0, c, psi)).iter().enumerate() {
            let (stress, moduli) = law.respond(
                &strain(&[0.3, 0.29, 0.3, 0.0]),
                &Stress::default(),
                &[0.0; 2],
                &mut [0.0; 2],
            );
            assert!(stress.deviator.iter().all(|&s| s == 0.0));
            assert_eq!(moduli, Moduli::default());
            // sin phi p = c cos phi: the pyramid's apex, and the cone's for psi = 0
            if psi == 0.0 || which == 1 {
                assert!((stress.mean - c / 30.0_f64.to_radians().tan()).abs() < 1e-14);
            }
        }
    }
}

#[test]
fn dilatancy_ends_at_its_limit() {
    let limited = Friction { eps_v_max: 0.005, ..friction(30.0, 0.0, 20.0) };
    for law in frictional(elastic(), limited) {
        let old = Stress { deviator: [0.0; 4], mean: -1.0 };
        let shear = strain(&[0.5, -0.5, 0.0, 0.0]);
        let mut new = [0.0; 2];
        let (stress, _) = law.respond(&shear, &old, &[0.0, 0.004], &mut new);
        assert!((new[1] - 0.005).abs() < 1e-15);
        assert!((stress.mean - (old.mean - 5.0 * 0.001)).abs() < 1e-14);
        law.respond(&strain(&[0.13, -0.13, 0.0, 0.0]), &old, &[0.0, 0.0], &mut new);
        assert!(new[1] > 0.0 && new[1] < 0.005);
        law.respond(&shear, &old, &[0.0, 0.005], &mut new);
        assert_eq!(new[1], 0.005);
    }
}

#[test]
fn parameters_out_of_range_are_named() {
    let name =
        |f: Friction| match (DruckerPrager::new(elastic(), f), MohrCoulomb::new(elastic(), f)) {
            (Err(Error::Parameter { name, .. }), Err(Error::Parameter { name: other, .. })) => {
                assert_eq!(name, other);
                name
            }
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

/// Every name leads to the law of that name.
#[test]
fn makers_have_the_names_of_their_laws() {
    let elastic = tawami::law::LinearElastic::from_k_mu(2.0, 1.0).unwrap();
    for maker in tawami::law::LAWS {
        let given = if maker.name == "cam_clay" {
            [1.0, 0.2, 0.05, 1.0, 1e-3]
        } else {
            [30.0, 1.0, 0.0, 1.0, 0.0]
        };
        let law = (maker.make)(elastic, &given).unwrap();
        assert_eq!(law.name(), maker.name);
        assert_eq!(tawami::law::LAWS.iter().filter(|other| other.name == law.name()).count(), 1);
    }
}
