//! What a step takes besides the arrays of the particles: counted where it is allocated.

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::Arc;

use ndarray::{Array1, Array2};
use tawami::basis::Basis;
use tawami::constitutive::{Response, Stage};
use tawami::grid::Grid;
use tawami::interpolation::Field;
use tawami::kinematics::{Increments, Kinematics};
use tawami::material::{LinearElastic, Material};
use tawami::particles::Particles;

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

/// Accepting a step holds the new state of all particles at once (stress 5 numbers, volume, displacement
/// 2, dissipation, room for 8 history variables), but no tangents (25) and no trial states (22): with
/// these it was 930 bytes.
#[test]
fn accepting_a_step_holds_no_tangents() {
    let n = 100;
    let grid = Grid::new([0.0; 2], 1.0, [n, n]).unwrap();
    let count = 4 * n * n;
    let at = |k: usize| 0.25 + 0.5 * k as f64;
    let x: Vec<f64> = (0..count).flat_map(|p| [at(p % (2 * n)), at(p / (2 * n))]).collect();
    let location = grid.locate(&x).unwrap();
    let x = Array2::from_shape_vec((count, 2), x).unwrap();
    let (volume, material) = (Array1::from_elem(count, 0.25), Array1::zeros(count));
    let mut particles = Particles::new(x, volume, material).unwrap();
    let law: Arc<dyn Material> = Arc::new(LinearElastic::from_e_nu(1e6, 0.3).unwrap());
    let u = vec![0.0; 2 * Basis::QuadraticSpline.len(n).pow(2)];
    for finite in [false, true] {
        let stage = Stage {
            location: &location,
            response: Response::Laws(&[Arc::clone(&law)]),
            history: &[vec![]],
            kinematics: Kinematics::Displacement,
            finite,
            increments: Increments {
                u: Field { grid, basis: Basis::QuadraticSpline, coefficients: &u },
                volumetric: None,
            },
        };
        let before = IN_USE.load(SeqCst);
        MOST.store(before, SeqCst);
        stage.commit(&mut particles).unwrap();
        let each = (MOST.load(SeqCst) - before) as f64 / count as f64;
        assert!((100.0..200.0).contains(&each), "{each} bytes a particle");
    }
}
