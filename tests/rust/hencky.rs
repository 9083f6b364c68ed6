//! Elasticity of finite strain: closed forms, objectivity, derivatives against differences.

use proptest::prelude::*;
use tawami::law::{Law, LinearElastic, NeoHookean};
use tawami::tensor::hencky::Trial;
use tawami::tensor::{Gradient, Matrix, Moduli, Strain, Stress};

const NONE: Strain = Strain { deviator: [0.0; 4], volume: 0.0 };
const FREE: Stress = Stress { deviator: [0.0; 4], mean: 0.0 };

fn hencky() -> LinearElastic {
    LinearElastic::from_k_mu(5.0, 2.0).unwrap()
}

fn law(neo_hookean: bool) -> Box<dyn Law> {
    if neo_hookean {
        return Box::new(NeoHookean::new(hencky()));
    }
    Box::new(hencky())
}

fn respond(law: &dyn Law, trial: &Trial) -> (Stress, Moduli) {
    law.respond(&trial.strain, &FREE, &[], &mut [])
}

fn rotation(angle: f64) -> Matrix {
    let (s, c) = angle.sin_cos();
    [[c, -s], [s, c]]
}

fn minus_unit(f: &Matrix) -> Gradient {
    [[f[0][0] - 1.0, f[0][1]], [f[1][0], f[1][1] - 1.0]].into()
}

fn times(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| a[i][0] * b[0][j] + a[i][1] * b[1][j]))
}

#[test]
fn plane_stretches_give_the_logarithms() {
    let (a, b) = (1.7_f64, 0.6_f64);
    let trial = Trial::new(&[[a - 1.0, 0.0], [0.0, b - 1.0]].into(), None, &NONE).unwrap();
    let third = (a * b).ln() / 3.0;
    let expected = [a.ln() - third, b.ln() - third, -third, 0.0];
    for (x, y) in trial.strain.deviator.iter().zip(expected) {
        assert!((x - y).abs() < 1e-14);
    }
    assert!((trial.strain.volume - (a * b).ln()).abs() < 1e-15);
    // P = tau f^-T: the axial one over its own stretch
    let (tau, _) = respond(&hencky(), &trial);
    let p = trial.nominal(&tau);
    assert!((p[0] - (4.0 * expected[0] + 15.0 * third) / a).abs() < 1e-13);
    assert!((p[3] - (4.0 * expected[1] + 15.0 * third) / b).abs() < 1e-13);
}

#[test]
fn the_hoop_stretch_is_a_third_principal_one() {
    let (a, b, c) = (1.7_f64, 0.6_f64, 1.3_f64);
    let g = Gradient { in_space: [[a - 1.0, 0.0], [0.0, b - 1.0]], hoop: c - 1.0 };
    let trial = Trial::new(&g, None, &NONE).unwrap();
    let third = (a * b * c).ln() / 3.0;
    let expected = [a.ln() - third, b.ln() - third, c.ln() - third, 0.0];
    for (x, y) in trial.strain.deviator.iter().zip(expected) {
        assert!((x - y).abs() < 1e-14);
    }
    assert!((trial.strain.volume - (a * b * c).ln()).abs() < 1e-15);
    for (x, y) in g.logarithmic().iter().zip([a.ln(), b.ln(), c.ln(), 0.0]) {
        assert!((x - y).abs() < 1e-14);
    }
    // P = tau f^-T in the hoop direction
    let (tau, _) = respond(&hencky(), &trial);
    assert!((trial.nominal(&tau)[4] - (4.0 * expected[2] + 15.0 * third) / c).abs() < 1e-13);
    // what is stretched twice is stretched by the product
    let twice = g.after(&g);
    assert!((twice.hoop - (c * c - 1.0)).abs() < 1e-15);
    assert!((twice.in_space[0][0] - (a * a - 1.0)).abs() < 1e-15);
    assert!(Trial::new(&Gradient { hoop: -1.0, ..g }, None, &NONE).is_none());
}

#[test]
fn what_turns_a_particle_inside_out_is_refused() {
    for g in [[[-1.0, 0.0], [0.0, 0.0]], [[-1.5, 0.0], [0.0, 0.0]], [[f64::NAN, 0.0], [0.0, 0.0]]] {
        assert!(Trial::new(&g.into(), Some(0.0), &NONE).is_none());
    }
}

prop_compose! {
    fn gradients()(g in [[-0.3..0.3_f64, -0.3..0.3_f64], [-0.3..0.3_f64, -0.3..0.3_f64]]) -> Matrix { g }
}

prop_compose! {
    fn strains()(e in [-0.5..0.5_f64, -0.5..0.5_f64, -0.5..0.5_f64], volume in -0.3..0.3_f64) -> Strain {
        Strain { deviator: [e[0], e[1], -e[0] - e[1], e[2]], volume }
    }
}

proptest! {
    #[test]
    fn a_rotation_turns_the_stress_and_makes_none(
        angle in -7.0..7.0_f64, old in strains(), neo: bool,
    ) {
        let law = law(neo);
        let q = rotation(angle);
        let still = Trial::new(&[[0.0; 2]; 2].into(), None, &old).unwrap();
        let turned = Trial::new(&minus_unit(&q), None, &old).unwrap();
        prop_assert!((turned.strain.volume - old.volume).abs() < 1e-14);
        let ((s, _), (t, _)) = (respond(&*law, &still), respond(&*law, &turned));
        // P f^T = tau turns with the body
        let p = turned.nominal(&t);
        let tau = times(&[[p[0], p[1]], [p[2], p[3]]], &[[q[0][0], q[1][0]], [q[0][1], q[1][1]]]);
        let m = s.mean;
        let before = [[s.deviator[0] + m, s.deviator[3]], [s.deviator[3], s.deviator[1] + m]];
        let after = times(&times(&q, &before), &[[q[0][0], q[1][0]], [q[0][1], q[1][1]]]);
        for i in 0..2 {
            for j in 0..2 {
                prop_assert!((tau[i][j] - after[i][j]).abs() < 1e-12);
            }
        }
        prop_assert!((s.deviator[2] - t.deviator[2]).abs() < 1e-13);
        let free = Trial::new(&minus_unit(&q), None, &NONE).unwrap();
        prop_assert!(free.strain.deviator.iter().all(|e| e.abs() < 1e-14));
    }

    #[test]
    fn steps_along_one_axis_add_up(a in 0.5..2.0_f64, b in 0.5..2.0_f64) {
        let stretch = |a: f64| Gradient::from([[a - 1.0, 0.0], [0.0, 0.0]]);
        let first = Trial::new(&stretch(a), None, &NONE).unwrap();
        let second = Trial::new(&stretch(b), None, &first.strain).unwrap();
        let once = Trial::new(&stretch(a * b), None, &NONE).unwrap();
        for k in 0..4 {
            prop_assert!((second.strain.deviator[k] - once.strain.deviator[k]).abs() < 1e-13);
        }
        prop_assert!((second.strain.volume - once.strain.volume).abs() < 1e-14);
    }

    #[test]
    fn derivatives_are_differences(
        g in gradients(), old in strains(), dg in gradients(), mixed: bool, dv in -0.3..0.3_f64,
        neo: bool, hoop in [-0.3..0.3_f64, -0.3..0.3_f64],
    ) {
        let law = law(neo);
        let (h, volume) = (1e-6, 0.07);
        let at = |s: f64| {
            let moved = std::array::from_fn(|i| std::array::from_fn(|j| g[i][j] + s * dg[i][j]));
            let moved = Gradient { in_space: moved, hoop: hoop[0] + s * hoop[1] };
            let trial = Trial::new(&moved, mixed.then_some(volume + s * dv), &old).unwrap();
            let (tau, c) = respond(&*law, &trial);
            (trial.nominal(&tau), trial, tau, c)
        };
        let (_, trial, tau, c) = at(0.0);
        let change = Gradient { in_space: dg, hoop: hoop[1] };
        let dv = if mixed { dv } else { trial.volume_change(&change) };
        let (plus, minus) = (at(h), at(-h));
        let exact = trial.nominal_change(&tau, &c, &change, dv);
        for ((a, b), exact) in plus.0.iter().zip(minus.0).zip(exact) {
            let difference = (a - b) / (2.0 * h);
            prop_assert!((difference - exact).abs() < 1e-7, "{} {}", difference, exact);
        }
        let slope: f64 = {
            let changes = dg.as_flattened().iter().chain(&hoop[1..]);
            trial.ln_j_gradient().iter().zip(changes).map(|(a, b)| a * b).sum()
        };
        prop_assert!(((plus.1.ln_j - minus.1.ln_j) / (2.0 * h) - slope).abs() < 1e-8);
    }

    #[test]
    fn small_gradients_give_the_small_strain(g in gradients()) {
        let scale = 1e-7;
        let small = g.map(|row| row.map(|x| scale * x));
        let trial = Trial::new(&small.into(), None, &NONE).unwrap();
        let third = (g[0][0] + g[1][1]) / 3.0;
        let expected = [g[0][0] - third, g[1][1] - third, -third, g[0][1] + g[1][0]];
        for (e, expected) in trial.strain.deviator.iter().zip(expected) {
            prop_assert!((e / scale - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn equal_eigenvalues_are_no_special_case(t in 0.0..1e-3_f64, neo: bool) {
        let law = law(neo);
        // nearly equal principal stretches: the divided difference stays that of the logarithm
        let g = [[0.1 + t, 0.0], [0.0, 0.1]];
        let trial = Trial::new(&g.into(), None, &NONE).unwrap();
        let (tau, c) = respond(&*law, &trial);
        let shear = Gradient::from([[0.0, 1.0], [1.0, 0.0]]);
        let change = trial.nominal_change(&tau, &c, &shear, 0.0);
        let (h, at) = (1e-6, |s: f64| {
            let trial = Trial::new(&[[0.1 + t, s], [s, 0.1]].into(), None, &NONE).unwrap();
            trial.nominal(&respond(&*law, &trial).0)
        });
        for ((a, b), change) in at(h).iter().zip(at(-h)).zip(change) {
            prop_assert!(((a - b) / (2.0 * h) - change).abs() < 1e-7);
        }
    }

    #[test]
    fn the_stress_is_the_derivative_of_the_energy(
        e in strains(), de in strains(), neo: bool, digits in 0..6_i32,
    ) {
        let (law, scale) = (law(neo), 10.0_f64.powi(-digits));
        let moved = |s: f64| Strain {
            deviator: std::array::from_fn(|k| scale * (e.deviator[k] + s * de.deviator[k])),
            volume: scale * (e.volume + s * de.volume),
        };
        let (stress, _) = law.respond(&moved(0.0), &FREE, &[], &mut []);
        let work = (0..4).map(|k| stress.deviator[k] * de.deviator[k]).sum::<f64>()
            + stress.mean * de.volume;
        let h = 1e-4;
        let energy = |s| law.elastic_energy(&moved(s));
        let difference = (energy(h) - energy(-h)) / (2.0 * h * scale);
        prop_assert!((work - difference).abs() < 1e-6 * scale, "{work} {difference}");
    }
}
