//! Responses of external laws, which the caller computes.

use crate::space::COMPONENTS;
use crate::tensor::{Moduli, Stress, Sym};

/// Stress, tangent and history of external laws; entries of other particles are ignored.
///
/// The tangent is that of the total strain which [`Stage::strains`](super::stage::Stage::strains) gives.
/// Where the form has a field for the mean stress, the responses belong to the volumetric strain with which
/// the law has that mean stress.
#[derive(Clone, Copy)]
pub struct Given<'a> {
    /// 4 numbers per particle, in the order of [`crate::tensor`].
    pub stress: &'a [f64],
    /// d stress / d strain, 16 numbers per particle, strain fastest.
    pub tangent: &'a [f64],
    /// Volumetric strain increment of each particle that is not elastic; 0 in other forms.
    pub plastic_volume: &'a [f64],
    /// History variables per particle in the two arrays below: those of the law that has most.
    pub variables: usize,
    /// History variables at the end of the step.
    pub history: &'a [f64],
    /// d variable / d strain, 4 numbers per variable; empty if no form asks for it.
    pub slopes: &'a [f64],
}

impl Given<'_> {
    pub(super) fn stress_of(&self, p: usize) -> (Stress, Moduli) {
        let stress: Sym = std::array::from_fn(|i| self.stress[COMPONENTS * p + i]);
        let at = COMPONENTS * COMPONENTS * p;
        let row = |i: usize| std::array::from_fn(|j| self.tangent[at + COMPONENTS * i + j]);
        (Stress::from(&stress), Moduli::from(&std::array::from_fn(row)))
    }

    /// Write the history variables of particle `p`.
    pub(super) fn history_of(&self, p: usize, new: &mut [f64]) {
        let first = self.variables * p;
        new.copy_from_slice(&self.history[first..first + new.len()]);
    }

    /// d variable / d strain of the k-th variable of particle `p`.
    pub(super) fn slope_of(&self, p: usize, k: usize) -> Sym {
        let first = COMPONENTS * (self.variables * p + k);
        std::array::from_fn(|i| self.slopes[first + i])
    }
}
