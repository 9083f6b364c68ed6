//! Storage of the particles.

use ndarray::{Array1, Array2};
use tawami::error::Error;
use tawami::particles::{Particles, Role};

#[test]
fn particle_arrays_are_checked() {
    let make = |x: f64, v: f64| {
        let x = Array2::from_elem((2, 2), x);
        Particles::new(x, Array1::from_vec(vec![1.0, v]), Array1::zeros(2))
    };
    assert!(make(0.0, 1.0).is_ok());
    assert!(matches!(make(f64::NAN, 1.0), Err(Error::NotFinite { count: 4, .. })));
    assert!(matches!(make(0.0, -1.0), Err(Error::Volume { index: 1, .. })));
    let empty = Particles::new(Array2::zeros((0, 2)), Array1::zeros(0), Array1::zeros(0));
    assert_eq!(empty.unwrap_err(), Error::NoParticles);
    let short = Particles::new(Array2::zeros((2, 2)), Array1::ones(3), Array1::zeros(2));
    assert!(matches!(short, Err(Error::Shape { name: "volume", .. })));
}

fn with_all_roles() -> Particles {
    let x = Array2::from(vec![[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]);
    let (volume, material) = (Array1::from(vec![0.5, 0.25, 1.0]), Array1::from(vec![0, 1, 0]));
    let mut particles = Particles::new(x, volume, material).unwrap();
    particles.add(Role::Carried, "velocity", Some(2));
    particles.add(Role::History, "dilatancy", None);
    particles.add(Role::State, "eps_v", None);
    let place = particles.place(Role::History, "dilatancy").unwrap();
    particles.reals_mut(place).copy_from_slice(&[0.1, 0.2, 0.3]);
    particles
}

#[test]
fn columns_are_in_the_order_of_their_roles() {
    let particles = with_all_roles();
    let names: Vec<&str> = particles.arrays().iter().map(|(name, _)| *name).skip(4).collect();
    assert_eq!(names, ["stress", "displacement", "eps_v", "dilatancy", "velocity"]);
    assert_eq!(particles.bytes_per_particle(), 8 * (2 + 1 + 4 + 2 + 1 + 1 + 2) + 2 * 4);
}

#[test]
fn particles_travel_as_rows_and_come_back() {
    let particles = with_all_roles();
    let chosen = particles.select(&[2, 0]);
    assert_eq!((chosen.number(), chosen.volume()), (&[2, 0][..], &[1.0, 0.5][..]));
    let back = chosen.of_rows(&chosen.rows().view()).unwrap();
    assert_eq!(back.rows(), chosen.rows());
    assert_eq!(back.number(), chosen.number());
    let place = back.place(Role::History, "dilatancy").unwrap();
    assert_eq!(back.reals(place), [0.3, 0.1]);
    assert!(chosen.of_rows(&chosen.rows().slice(ndarray::s![.., 1..])).is_none());
    assert!(particles.select(&[]).is_empty());
}

#[test]
fn values_are_assigned_to_the_same_particles_only() {
    let (mut mine, mut others) = (with_all_roles(), with_all_roles());
    others.reals_mut(Particles::STRESS).fill(7.0);
    assert!(mine.assign(&others));
    assert_eq!(mine.stress(), [7.0; 12]);
    assert!(!mine.assign(&others.select(&[1, 0, 2])));
    others.add(Role::Carried, "acceleration", Some(2));
    assert!(!mine.assign(&others));
}
