//! The threads of a computation.
//!
//! The first thread that computes joins rayon's pool. It starts at once, without waiting for another thread
//! to wake up; for a scene of few particles, waking up takes longer than the computation. Other threads of
//! Python hand their computations to a second pool, so that no thread waits for the first one.

use std::sync::OnceLock;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// Compute with the interpreter lock released.
pub(super) fn detached<R: Send>(py: Python, compute: impl FnOnce() -> R + Send) -> R {
    py.detach(|| match pool() {
        Some(pool) => pool.install(compute),
        None => compute(),
    })
}

/// The pool to which this thread hands its computation; `None` if it belongs to the first one.
fn pool() -> Option<&'static ThreadPool> {
    static FIRST: OnceLock<bool> = OnceLock::new();
    static SECOND: OnceLock<Option<ThreadPool>> = OnceLock::new();
    FIRST.get_or_init(|| ThreadPoolBuilder::new().use_current_thread().build_global().is_ok());
    if rayon::current_thread_index().is_some() {
        return None;
    }
    SECOND.get_or_init(|| ThreadPoolBuilder::new().build().ok()).as_ref()
}
