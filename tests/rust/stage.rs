//! Interpolation to particles reproduces polynomials; the particle stage accepts what it computes.

use std::sync::Arc;

use ndarray::{Array1, Array2};
use proptest::prelude::*;
use tawami::error::Error;
use tawami::grid::{Basis, Grid};
use tawami::law::{Law, LinearElastic, NeoHookean};
use tawami::particles::kinematics::{gradient, Increments, Kinematics};
use tawami::particles::request::{Operator, Part, Request};
use tawami::particles::stage::{check_materials, Output, Stage};
use tawami::particles::{Particles, Role};
use tawami::space::Geometry;
use tawami::tensor::Gradient;
use tawami::transfer::to_particles::Field;

const CELLS: [usize; 2] = [4, 3];

fn grid() -> Grid {
    Grid::new([-1.0, 0.5], 0.5, CELLS).unwrap()
}

/// Coordinates, in cells, of the coefficients that reproduce a linear function.
fn greville(basis: Basis, n: usize) -> Vec<f64> {
    match basis {
        Basis::QuadraticSpline => {
            let inner = (0..n).map(|i| i as f64 + 0.5);
            std::iter::once(0.0).chain(inner).chain(std::iter::once(n as f64)).collect()
        }
        Basis::Bilinear => (0..=n).map(|i| i as f64).collect(),
        Basis::Biquadratic => (0..=2 * n).map(|i| 0.5 * i as f64).collect(),
    }
}

/// Coefficients of u = a + G (x - origin).
fn linear(grid: &Grid, basis: Basis, a: [f64; 2], g: [[f64; 2]; 2]) -> Vec<f64> {
    let [xs, ys] = [0, 1].map(|axis| greville(basis, grid.cells[axis]));
    let mut u = Vec::new();
    for y in &ys {
        for x in &xs {
            u.extend((0..2).map(|k| a[k] + grid.h * (g[k][0] * x + g[k][1] * y)));
        }
    }
    u
}

proptest! {
    #[test]
    fn linear_fields_and_their_gradients_are_reproduced(
        a in [-1.0..1.0_f64, -1.0..1.0_f64],
        g in [[-1.0..1.0_f64, -1.0..1.0_f64], [-1.0..1.0_f64, -1.0..1.0_f64]],
        cell in 0usize..12, xi in [0.0..=1.0_f64, 0.0..=1.0_f64],
    ) {
        let grid = grid();
        let ij = grid.cell_index(cell);
        for basis in [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic] {
            let coefficients = linear(&grid, basis, a, g);
            let field: Field<2> = Field { grid, basis, coefficients: &coefficients };
            let (value, gradient) = (field.value(ij, xi), field.gradient(ij, xi));
            for k in 0..2 {
                let offset: f64 = (0..2).map(|b| g[k][b] * grid.h * (ij[b] as f64 + xi[b])).sum();
                prop_assert!((value[k] - a[k] - offset).abs() < 1e-13);
                for b in 0..2 {
                    prop_assert!((gradient[k][b] - g[k][b]).abs() < 1e-12);
                }
            }
        }
    }
}

fn one_particle(kinematics: Kinematics, p: f64) -> Particles {
    let grid = grid();
    let basis = Basis::QuadraticSpline;
    let g = [[1e-3, 4e-4], [-2e-4, 5e-4]];
    let u = linear(&grid, basis, [0.25, -0.5], g);
    let v = vec![p; 5 * 4];
    let mut particles = Particles::new(
        Array2::from_shape_vec((1, 2), vec![0.3, 0.9]).unwrap(),
        Array1::from_elem(1, 0.1),
        Array1::zeros(1),
    )
    .unwrap();
    let materials: Vec<Arc<dyn Law>> = vec![Arc::new(LinearElastic::from_k_mu(5e3, 1e3).unwrap())];
    if kinematics == Kinematics::Mixed {
        particles.add(Role::State, "eps_v", None);
    }
    let location = grid.locate(&[[0.3, 0.9]]).unwrap();
    let stage = Stage {
        location: &location,
        laws: &materials,
        given: None,
        kinematics,
        finite: false,
        increments: Increments {
            u: Field { grid, basis, coefficients: &u },
            volumetric: Some(Field { grid, basis: Basis::Bilinear, coefficients: &v }),
        },
    };
    let (mut data, mut other) = ([0.0; 3], [0.0; 2]);
    let requests = [Request::new(Operator::Sigma, Part::Value, 0)];
    let scaled =
        [Request { factor: Some(vec![2.0]), ..Request::new(Operator::Mean, Part::Value, 1) }];
    let outputs = vec![
        Output { requests: &requests, columns: 3, data: &mut data },
        Output { requests: &scaled, columns: 2, data: &mut other },
    ];
    stage.evaluate(&particles, outputs).unwrap();
    stage.commit(&mut particles, None).unwrap();
    if kinematics != Kinematics::Deviatoric {
        for (k, i) in [(0, 0), (1, 1), (2, 3)] {
            assert_eq!(data[k], particles.stress()[i]);
        }
        let mean = particles.stress()[..3].iter().sum::<f64>() / 3.0;
        assert!((other[1] - 2.0 * mean).abs() < 1e-12 && other[0] == 0.0);
    }
    particles
}

#[test]
fn each_kinematics_gives_its_stress() {
    // eps = (1e-3, 5e-4, 0), gamma = 2e-4: div u = 1.5e-3, third of it 5e-4
    let deviator = [1.0, 0.0, -1.0, 0.2]; // 2 mu dev [Pa], mu gamma
    for (kinematics, field, mean) in [
        (Kinematics::Displacement, 0.0, 7.5),
        (Kinematics::Cell, 0.0, 7.5),
        (Kinematics::Mixed, 2e-3, 10.0),
        (Kinematics::Deviatoric, -3.0, -3.0),
    ] {
        let particles = one_particle(kinematics, field);
        for (i, s) in deviator.iter().enumerate() {
            let expected = s + if i < 3 { mean } else { 0.0 };
            let got = particles.stress()[i];
            assert!((got - expected).abs() < 1e-12, "{kinematics:?} {i}: {got} {expected}");
        }
        assert!((particles.displacement()[0] - 0.25 - 1e-3 * 1.3 - 4e-4 * 0.4).abs() < 1e-15);
        assert_eq!(
            particles.place(Role::State, "eps_v").is_some(),
            kinematics == Kinematics::Mixed
        );
    }
}

#[test]
fn materials_are_checked_before_anything_runs() {
    let n = |k: u32| {
        let x = Array2::from_elem((2, 2), 1.0);
        Particles::new(x, Array1::ones(2), Array1::from_vec(vec![0, k])).unwrap()
    };
    let laws: Vec<Arc<dyn Law>> = vec![
        Arc::new(LinearElastic::from_k_mu(1.0, 1.0).unwrap()),
        Arc::new(LinearElastic::from_e_nu(1.0, 0.5).unwrap()),
        Arc::new(NeoHookean::new(LinearElastic::from_k_mu(1.0, 1.0).unwrap())),
    ];
    let check = |k, kinematics| check_materials(&n(k), &laws, kinematics, false);
    assert_eq!(check(0, Kinematics::Mixed), Ok(()));
    assert_eq!(check(1, Kinematics::Deviatoric), Ok(()));
    assert_eq!(check(1, Kinematics::Mixed), Err(Error::Incompressible { index: 1 }));
    assert_eq!(check(2, Kinematics::Mixed), Err(Error::FiniteOnly { index: 1 }));
    assert_eq!(check_materials(&n(2), &laws, Kinematics::Mixed, true), Ok(()));
    let unknown = Error::UnknownMaterial { index: 1, material: 3, count: 3 };
    assert_eq!(check(3, Kinematics::Mixed), Err(unknown));
}

#[test]
fn the_hoop_strain_is_the_radial_displacement_over_the_radius() {
    let geometry = Geometry::Axisymmetric;
    let grid = Grid::new([1.0, 0.5], 0.5, CELLS).unwrap().with(geometry).unwrap();
    let g = [[0.2, 0.1], [-0.3, 0.4]];
    for basis in [Basis::QuadraticSpline, Basis::Bilinear, Basis::Biquadratic] {
        let coefficients = linear(&grid, basis, [0.25, -0.5], g);
        let u: Field<2> = Field { grid, basis, coefficients: &coefficients };
        let (cell, xi) = ([2, 1], [0.3, 0.8]);
        let [x, y] = grid.position(cell, xi);
        assert!((x - 2.15).abs() < 1e-15 && (y - 1.4).abs() < 1e-15);
        let found = gradient(&u, cell, xi);
        let radial = 0.25 + 0.2 * (x - 1.0) + 0.1 * (y - 0.5);
        assert!((found.hoop - radial / x).abs() < 1e-14);
        assert!((found.trace() - 0.6 - radial / x).abs() < 1e-14);
        let mut rows = [0.0; 9];
        found.write(geometry, &mut rows);
        assert_eq!(Gradient::of_rows(&rows), found);
    }
    let left = Grid::new([-1.0, 0.5], 0.5, CELLS).unwrap().with(geometry);
    assert!(matches!(left, Err(Error::Parameter { name: "origin[0]", .. })));
}
