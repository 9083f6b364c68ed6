//! Memory of a step besides the arrays of the particles, counted where it is allocated.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::Arc;

use ndarray::{Array1, Array2};
use tawami::grid::{Basis, Grid};
use tawami::law::{Law, LinearElastic};
use tawami::particles::kinematics::{Increments, Kinematics};
use tawami::particles::stage::Stage;
use tawami::particles::Particles;
use tawami::transfer::to_particles::Field;

/// Bytes in use, and the most of them so far.
static IN_USE: AtomicUsize = AtomicUsize::new(0);
static MOST: AtomicUsize = AtomicUsize::new(0);

struct Counting;

// SAFETY: the system's allocator, which does not depend on the counting.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        let now = IN_USE.fetch_add(layout.size(), SeqCst) + layout.size();
        MOST.fetch_max(now, SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), SeqCst);
        // SAFETY: as the caller promises.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// An accepted step has the new state of all particles in memory at once: stress (5 numbers), volume,
/// displacement (2), dissipation, and 8 history variables. Tangents (25) and trial states (22) would make
/// it 930 bytes per particle.
#[test]
fn accepting_a_step_holds_no_tangents() {
    let n = 100;
    let grid = Grid::new([0.0; 2], 1.0, [n, n]).unwrap();
    let count = 4 * n * n;
    let at = |k: usize| 0.25 + 0.5 * k as f64;
    let x: Vec<[f64; 2]> = (0..count).map(|p| [at(p % (2 * n)), at(p / (2 * n))]).collect();
    let location = grid.locate(&x).unwrap();
    let x = Array2::from(x);
    let (volume, material) = (Array1::from_elem(count, 0.25), Array1::zeros(count));
    let mut particles = Particles::new(x, volume, material).unwrap();
    let law: Arc<dyn Law> = Arc::new(LinearElastic::from_e_nu(1e6, 0.3).unwrap());
    let u = vec![0.0; 2 * Basis::QuadraticSpline.len(n).pow(2)];
    for finite in [false, true] {
        let stage = Stage {
            location: &location,
            laws: &[Arc::clone(&law)],
            given: None,
            kinematics: Kinematics::Displacement,
            finite,
            increments: Increments {
                u: Field { grid, basis: Basis::QuadraticSpline, coefficients: &u },
                volumetric: None,
            },
        };
        let before = IN_USE.load(SeqCst);
        MOST.store(before, SeqCst);
        stage.commit(&mut particles, None).unwrap();
        let each = (MOST.load(SeqCst) - before) as f64 / count as f64;
        assert!((100.0..200.0).contains(&each), "{each} bytes a particle");
    }
}
