//! Point kernels of reference operators, with the signature of those that FFCx compiles. Linear solvers
//! build preconditioners from them.

use std::ffi::c_void;

use super::kernel::TabulateTensor;
use super::point::{Entries, Entry};
use crate::space::{Geometry, DIM, GRADIENT};

/// An operator that needs no form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Reference {
    /// `2 mu eps(u) : eps(w) + lambda tr eps(u) tr eps(w)`, data mu and lambda.
    Elasticity(Geometry),
    /// `c q p` of the first component of the fields, data c.
    Mass,
}

impl Reference {
    /// Its kernel.
    #[must_use]
    pub fn kernel(self) -> TabulateTensor {
        match self {
            Self::Elasticity(Geometry::PlaneStrain) => elasticity::<GRADIENT>,
            Self::Elasticity(Geometry::Axisymmetric) => elasticity::<{ GRADIENT + 1 }>,
            Self::Mass => mass,
        }
    }

    /// Number of columns of its data.
    #[must_use]
    pub fn columns(self) -> usize {
        match self {
            Self::Elasticity(_) => 2,
            Self::Mass => 1,
        }
    }

    /// The functions that its rows and columns multiply; `None` if the space has no such entries.
    #[must_use]
    pub fn entries(self) -> Option<Entries> {
        let entries: Option<Vec<Entry>> = match self {
            Self::Elasticity(geometry) => {
                let gradient = (0..GRADIENT).map(|k| Entry::new(k / DIM, &[k % DIM]));
                let hoop = (GRADIENT..geometry.gradients()).map(|_| Entry::new(0, &[]));
                gradient.chain(hoop).collect()
            }
            Self::Mass => Entry::new(0, &[]).map(|entry| vec![entry]),
        };
        entries.map(|entries| Entries::new(&[], &entries, &entries))
    }

    /// Whether the kernel reads the position after its data.
    #[must_use]
    pub fn reads_position(self) -> bool {
        self == Self::Elasticity(Geometry::Axisymmetric)
    }
}

/// The elasticity tensor for the entries of the gradient, with `N > GRADIENT` also for the hoop strain u/r.
///
/// # Safety
/// `out` has `N x N` numbers, `data` has mu and lambda, and the radius if there is a hoop strain.
unsafe extern "C" fn elasticity<const N: usize>(
    out: *mut f64,
    data: *const f64,
    _: *const f64,
    _: *const f64,
    _: *const i32,
    _: *const u8,
    _: *mut c_void,
) {
    // SAFETY: the caller's.
    let (out, mu, lambda) =
        unsafe { (std::slice::from_raw_parts_mut(out, N * N), *data, *data.add(1)) };
    let trace = |k: usize| k >= GRADIENT || k / DIM == k % DIM;
    // SAFETY: the caller's.
    let over_r = if N > GRADIENT { unsafe { 1.0 / *data.add(2) } } else { 1.0 };
    for k in 0..N {
        for l in 0..N {
            let mut value = if trace(k) && trace(l) { lambda } else { 0.0 };
            if k == l {
                value += mu;
            }
            if k < GRADIENT && l < GRADIENT {
                // the entry of the transposed gradient
                if l == (k % DIM) * DIM + k / DIM {
                    value += mu;
                }
            } else if k == l {
                value += mu;
            }
            let factor = |k: usize| if k < GRADIENT { 1.0 } else { over_r };
            out[k * N + l] = factor(k) * factor(l) * value;
        }
    }
}

/// The number of the data.
///
/// # Safety
/// `out` and `data` have one number.
unsafe extern "C" fn mass(
    out: *mut f64,
    data: *const f64,
    _: *const f64,
    _: *const f64,
    _: *const i32,
    _: *const u8,
    _: *mut c_void,
) {
    // SAFETY: the caller's.
    unsafe { *out = *data };
}
