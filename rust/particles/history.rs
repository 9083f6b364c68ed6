//! History variables at the end of the step, as quantities of a weak form.
//!
//! Laws give no derivatives of their history, so these are central differences of the law. A law is
//! evaluated for them only where a form asks for a derivative: 8 times for the deviator, twice for the volume.

use super::kinematics::Kinematics;
use super::request::Part;
use super::stage::{Answer, Old, Scalar, Stage};
use crate::law::{Law, MAX_HISTORY};
use crate::space::COMPONENTS;
use crate::tensor::{deviator, mean, Strain, Stress, Sym};

/// Step of a difference relative to the size of the strain. It balances the error of the difference, step^2,
/// and the round-off, epsilon / step.
const STEP: f64 = 6e-6;
/// Least size of a strain: a particle may have none.
const LEAST: f64 = 1e-4;

/// Largest component.
fn size(strain: &Strain) -> f64 {
    strain.deviator.iter().fold(strain.volume.abs(), |most, e| most.max(e.abs()))
}

/// The deviator of a unit change of component `j`.
fn unit(j: usize) -> Sym {
    let mut unit = [0.0; COMPONENTS];
    unit[j] = 1.0;
    deviator(&unit)
}

/// A history variable of a law as a function of the strain.
struct Variable<'a> {
    law: &'a dyn Law,
    start: Stress,
    before: [f64; MAX_HISTORY],
    number: usize,
    has_mean: bool,
}

impl Variable<'_> {
    /// Its value at a deviatoric strain and a volume, or a mean stress [Pa] where the form has a field for it.
    fn at(&self, deviator: Sym, volume: f64) -> f64 {
        let mut after = [0.0; MAX_HISTORY];
        let variables = self.law.history().len();
        let (before, new) = (&self.before[..variables], &mut after[..variables]);
        if self.has_mean {
            self.law.respond_at_mean(&deviator, &self.start.deviator, volume, before, new);
        } else {
            self.law.respond(&Strain { deviator, volume }, &self.start, before, new);
        }
        after[self.number]
    }

    /// Its derivative with respect to the volume, or to the mean stress.
    fn volume_slope(&self, deviator: Sym, volume: f64, step: f64) -> f64 {
        (self.at(deviator, volume + step) - self.at(deviator, volume - step)) / (2.0 * step)
    }

    /// Its derivative with respect to the deviatoric strain.
    fn deviator_slope(&self, deviator: Sym, volume: f64, step: f64) -> Sym {
        std::array::from_fn(|j| {
            let unit = unit(j);
            let moved = |by: f64| {
                let mut moved = deviator;
                moved.iter_mut().zip(unit).for_each(|(e, one)| *e += by * one);
                self.at(moved, volume)
            };
            (moved(step) - moved(-step)) / (2.0 * step)
        })
    }
}

impl Stage<'_> {
    /// A history variable of particle `p` at the end of the step, with the derivatives that `part` needs; 0
    /// where its law has no such variable.
    #[cold]
    pub(super) fn variable(
        &self,
        name: &str,
        part: Part,
        old: &Old,
        answer: &Answer,
        p: usize,
    ) -> Scalar {
        let law = &*self.laws[old.material[p] as usize];
        let Some(number) = law.history().iter().position(|&one| one == name) else {
            return Scalar::default();
        };
        let value = answer.history[number];
        if part == Part::Value {
            return Scalar { value, ..Scalar::default() };
        }
        let Answer { strain, start, .. } = answer;
        let at_mean = self.mean_stress(law, start, strain, p);
        if let Some(given) = self.given.filter(|_| law.external()) {
            let (slope, (_, c)) = (given.slope_of(p, number), given.stress_of(p));
            let (of_deviator, of_volume) = (deviator(&slope), mean(&slope));
            let Some((_, of_field)) = at_mean else {
                return Scalar { value, deviator: of_deviator, field: of_volume };
            };
            // the total volume follows from the mean stress, sigma_m(deviator, v) = given
            let of_mean = of_volume / c.mean_vol;
            let at_mean = std::array::from_fn(|i| of_deviator[i] - of_mean * c.mean_dev[i]);
            return Scalar { value, deviator: at_mean, field: of_field * of_mean };
        }
        let (before, has_mean) = (old.history_of(p), at_mean.is_some());
        let variable = Variable { law, start: *start, before, number, has_mean };
        let large = size(strain).max(size(&law.elastic_strain(start))).max(LEAST);
        let step = STEP * large;
        let (volume, of_field, volume_step) = match at_mean {
            None => (strain.volume, 1.0, step),
            Some((mean, of_field)) => {
                (mean, of_field, STEP * mean.abs().max(law.shear_modulus() * large))
            }
        };
        let mut scalar = Scalar { value, ..Scalar::default() };
        if part == Part::Volume || self.kinematics == Kinematics::Displacement {
            let slope = variable.volume_slope(strain.deviator, volume, volume_step);
            scalar.field = of_field * slope;
        }
        if part != Part::Volume {
            scalar.deviator = variable.deviator_slope(strain.deviator, volume, step);
        }
        scalar
    }
}
