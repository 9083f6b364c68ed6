//! The particle stage of a Newton iteration: strain, law, and the quantities that the weak form asks for.
//! The same stage accepts a converged step.

use std::sync::Arc;

use rayon::prelude::*;

use super::given::Given;
use super::kinematics::{Increments, Kinematics};
use super::request::{Operator, Request};
use super::{finite, small, Particles, Role, GRADIENT};
use crate::error::{Error, Result};
use crate::grid::Location;
use crate::law::{Law, MAX_HISTORY};
use crate::space::{COMPONENTS, DIM};
use crate::tensor::hencky::Trial;
use crate::tensor::{dot, AtMean, Gradient, Moduli, Strain, Stress, Sym, UNIT};

/// One array of particle data: the requests that are written into its columns.
pub struct Output<'a> {
    /// Requests that are written.
    pub requests: &'a [Request],
    /// Number of columns, at least one.
    pub columns: usize,
    /// Particles x columns.
    pub data: &'a mut [f64],
}

/// Data of the particle stage.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// Where the particles are.
    pub location: &'a Location,
    /// The laws; the material numbers of the particles count them from 0.
    pub laws: &'a [Arc<dyn Law>],
    /// Responses of the external ones, if there are any.
    pub given: Option<Given<'a>>,
    /// How the strain follows from the increments.
    pub kinematics: Kinematics,
    /// Whether strains are finite.
    pub finite: bool,
    /// The increments of the current Newton iterate.
    pub increments: Increments<'a>,
}

/// Particles that one task treats.
const BLOCK: usize = 64;

/// State of the particles at the start of the step.
pub(super) struct Old<'a> {
    pub material: &'a [u32],
    pub stress: &'a [f64],
    /// History variables of each law.
    pub history: Vec<Vec<&'a [f64]>>,
}

impl Old<'_> {
    fn stress_of(&self, p: usize) -> Sym {
        std::array::from_fn(|i| self.stress[COMPONENTS * p + i])
    }

    /// History variables of the law of particle `p`.
    pub(super) fn history_of(&self, p: usize) -> [f64; MAX_HISTORY] {
        let mut values = [0.0; MAX_HISTORY];
        for (value, column) in values.iter_mut().zip(&self.history[self.material[p] as usize]) {
            *value = column[p];
        }
        values
    }
}

/// Strain that a law receives.
struct Received {
    strain: Strain,
    /// Stress that it starts from.
    start: Stress,
    /// Volumetric strain increment, without the plastic part where the form has a field for the mean stress.
    volume: f64,
    trial: Option<Trial>,
}

/// Stress, tangent and plastic volume of a particle.
struct OfMean {
    stress: Stress,
    moduli: Moduli,
    plastic: Scalar,
}

/// Response of a particle to the increments.
pub(super) struct Answer {
    /// Volumetric strain increment, elastic and plastic.
    pub volume: f64,
    /// Its plastic part; 0 where the law received the total strain.
    pub plastic: Scalar,
    /// In u-p without the increment p.
    pub stress: Stress,
    pub moduli: Moduli,
    pub trial: Option<Trial>,
    pub history: [f64; MAX_HISTORY],
    /// Strain that the law got, and the stress that it starts from.
    pub strain: Strain,
    pub start: Stress,
}

/// A number that a law gives, with its derivatives: the plastic volumetric strain, or a history variable.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Scalar {
    pub value: f64,
    /// With respect to the deviatoric strain.
    pub deviator: Sym,
    /// With respect to the volumetric field of the form, or to the volume where it has none.
    pub field: f64,
}

/// New state of a particle after an accepted step. It is much smaller than an answer, and those of all
/// particles are in memory at once.
struct Accepted {
    stress: Stress,
    volume: f64,
    u: [f64; DIM],
    history: [f64; MAX_HISTORY],
    dissipated: f64,
}

impl Stage<'_> {
    fn old<'a>(&self, particles: &'a Particles) -> Old<'a> {
        let of_law = |places: Vec<usize>| places.into_iter().map(|c| particles.reals(c)).collect();
        Old {
            material: particles.material(),
            stress: particles.stress(),
            history: self.history(particles).into_iter().map(of_law).collect(),
        }
    }

    /// Places of the history variables of each law.
    fn history(&self, particles: &Particles) -> Vec<Vec<usize>> {
        let of_law = |law: &Arc<dyn Law>| particles.history_of(law.history()).unwrap_or_default();
        self.laws.iter().map(of_law).collect()
    }

    /// Whether the volumetric field of the form determines the mean stress.
    fn has_mean_stress(&self) -> bool {
        matches!(self.kinematics, Kinematics::Mixed | Kinematics::Deviatoric)
    }

    /// Stress, tangent and plastic volume from the response of a law at a mean stress. `start` is the stress
    /// at the start of the step, `slope` the derivative of the mean stress with respect to the field.
    fn at_mean(&self, answer: &AtMean, start: f64, mean: f64, slope: f64) -> OfMean {
        let with_field = self.kinematics == Kinematics::Mixed;
        let stress =
            Stress { deviator: answer.deviator, mean: if with_field { mean } else { start } };
        let moduli = Moduli {
            dev_dev: answer.dev_dev,
            dev_vol: answer.dev_mean.map(|d| slope * d),
            mean_dev: [0.0; COMPONENTS],
            mean_vol: if with_field { slope } else { 0.0 },
        };
        let plastic = Scalar {
            value: answer.plastic_volume,
            deviator: answer.volume_dev,
            field: slope * answer.volume_mean,
        };
        OfMean { stress, moduli, plastic }
    }

    /// The new mean stress and its derivative with respect to the field, where the form has one for it. The
    /// volume of the strain that the law of particle `p` receives is then elastic.
    pub(super) fn mean_stress(
        &self,
        law: &dyn Law,
        start: &Stress,
        strain: &Strain,
        p: usize,
    ) -> Option<(f64, f64)> {
        match self.kinematics {
            Kinematics::Displacement | Kinematics::Cell => None,
            Kinematics::Deviatoric => {
                Some((start.mean + self.increments.volumetric_at(self.location, p), 1.0))
            }
            Kinematics::Mixed => {
                let bulk = law.bulk_modulus();
                let change = if strain.volume == 0.0 { 0.0 } else { bulk * strain.volume };
                Some((start.mean + change, bulk))
            }
        }
    }

    /// The strain that the law of particle `p` receives; `None` if the particle is turned inside out.
    #[allow(clippy::inline_always)] // of the innermost loop
    #[inline(always)]
    fn received(&self, law: &dyn Law, old: &Old, p: usize) -> Option<Received> {
        let stress = Stress::from(&old.stress_of(p));
        if !self.finite {
            let strain = self.increments.strain(self.kinematics, self.location, p);
            return Some(Received { strain, start: stress, volume: strain.volume, trial: None });
        }
        let own = match self.kinematics {
            Kinematics::Displacement => None,
            Kinematics::Mixed => Some(self.increments.volumetric_at(self.location, p)),
            Kinematics::Cell => {
                let g = self.increments.grad_u_of_cell(self.location, p);
                let change = g.det_minus_one();
                Some((change > -1.0).then(|| change.ln_1p())?)
            }
            Kinematics::Deviatoric => Some(0.0),
        };
        let g = self.increments.grad_u(self.location, p);
        let trial = Trial::new(&g, own, &law.elastic_strain(&stress))?;
        // the law gets the total elastic strain and starts from zero stress
        Some(Received {
            strain: trial.strain,
            start: Stress::default(),
            volume: own.unwrap_or(trial.ln_j),
            trial: Some(trial),
        })
    }

    /// Strain, stress and tangent of particle `p`; `None` if it is turned inside out.
    fn respond(&self, old: &Old, p: usize) -> Option<Answer> {
        let number = old.material[p] as usize;
        let law = &*self.laws[number];
        let Received { strain, start, volume, trial } = self.received(law, old, p)?;
        let mean = self.mean_stress(law, &start, &strain, p);
        let mut history = [0.0; MAX_HISTORY];
        let new = &mut history[..old.history[number].len()];
        let of = match &self.given {
            Some(given) if law.external() => {
                given.history_of(p, new);
                let (stress, moduli) = given.stress_of(p);
                match mean {
                    None => OfMean { stress, moduli, plastic: Scalar::default() },
                    Some((mean, slope)) => {
                        let (s, plastic) = (stress.deviator, given.plastic_volume[p]);
                        let at = AtMean::of_total(s, plastic, &moduli, law.bulk_modulus());
                        self.at_mean(&at, start.mean, mean, slope)
                    }
                }
            }
            _ => {
                let before = &old.history_of(p)[..new.len()];
                match mean {
                    None => {
                        let (stress, moduli) = law.respond(&strain, &start, before, new);
                        OfMean { stress, moduli, plastic: Scalar::default() }
                    }
                    Some((mean, slope)) => {
                        let (e, s) = (&strain.deviator, &start.deviator);
                        let at = law.respond_at_mean(e, s, mean, before, new);
                        self.at_mean(&at, start.mean, mean, slope)
                    }
                }
            }
        };
        let OfMean { stress, moduli, plastic } = of;
        let volume = volume + plastic.value;
        Some(Answer { volume, plastic, stress, moduli, trial, history, strain, start })
    }

    /// Work of the stress on the plastic strain of the step [J/m3]; zero for laws of this crate without history.
    fn dissipated(&self, particles: &Particles, p: usize, answer: &Answer) -> f64 {
        let law = &self.laws[particles.material()[p] as usize];
        if law.history().is_empty() && !law.external() {
            return 0.0;
        }
        let Answer { strain, stress, .. } = answer;
        let (start, end) = (law.elastic_strain(&answer.start), law.elastic_strain(stress));
        let plastic = |i| start.deviator[i] + strain.deviator[i] - end.deviator[i];
        let volume = if self.has_mean_stress() {
            answer.plastic.value
        } else {
            start.volume + strain.volume - end.volume
        };
        dot(&stress.deviator, &std::array::from_fn(plastic)) + stress.mean * volume
    }

    /// Strain that the law of each particle receives.
    ///
    /// # Errors
    /// [`Error::Inverted`] with the first such particle.
    pub fn strains(&self, particles: &Particles) -> Result<Vec<Strain>> {
        let old = self.old(particles);
        let of = |p: usize| {
            let received = self.received(&*self.laws[old.material[p] as usize], &old, p);
            let index = particles.number()[p] as usize;
            received.map(|of| of.strain).ok_or(Error::Inverted { index })
        };
        // the first error, as in a loop
        let all: Vec<Result<Strain>> = (0..particles.len()).into_par_iter().map(of).collect();
        all.into_iter().collect()
    }

    /// div u (ln J_f at finite strain) at particle `p`.
    #[must_use]
    pub fn volume_change(&self, p: usize) -> f64 {
        let g = self.increments.grad_u(self.location, p);
        if self.finite {
            // NaN where f turns the particle inside out: such an iterate is not accepted
            return g.det_minus_one().ln_1p();
        }
        g.trace()
    }

    /// Write the requested quantities into all arrays of particle data. Each law is evaluated once.
    ///
    /// # Errors
    /// [`Error::Inverted`] with the first such particle.
    ///
    /// # Panics
    /// If a request reaches outside the columns, or the particles lack the history of a law; callers check
    /// at the border.
    pub fn evaluate(&self, particles: &Particles, outputs: Vec<Output>) -> Result<()> {
        let old = self.old(particles);
        let blocks = self.location.len().div_ceil(BLOCK);
        let mut tasks: Vec<Vec<Output>> = (0..blocks).map(|_| Vec::new()).collect();
        for Output { requests, columns, data } in outputs {
            let parts = data.chunks_mut(BLOCK * columns);
            for (task, data) in tasks.iter_mut().zip(parts) {
                task.push(Output { requests, columns, data });
            }
        }
        let of = |(block, mut outputs): (usize, Vec<Output>)| {
            let particles = BLOCK * block..(BLOCK * (block + 1)).min(self.location.len());
            let mut inverted = None;
            for (row, p) in particles.enumerate() {
                match self.respond(&old, p) {
                    Some(answer) => {
                        for output in &mut outputs {
                            self.write(&old, &answer, p, row, output);
                        }
                    }
                    None => inverted = inverted.or(Some(p)),
                }
            }
            inverted
        };
        let first = tasks.into_par_iter().enumerate().filter_map(of).min();
        first.map_or(Ok(()), |p| Err(Error::Inverted { index: particles.number()[p] as usize }))
    }

    /// Write the requests of particle `p` into its row of an array.
    fn write(&self, old: &Old, answer: &Answer, p: usize, row: usize, output: &mut Output) {
        let own = self.kinematics != Kinematics::Displacement;
        let row = &mut output.data[output.columns * row..][..output.columns];
        let Answer { stress, moduli, plastic, trial, .. } = answer;
        let geometry = self.location.grid.geometry;
        for request in output.requests {
            let out = &mut row[request.column..][..request.width(geometry)];
            let scalar = match request.operator {
                Operator::History(name) => &self.variable(name, request.part, old, answer, p),
                _ => plastic,
            };
            match trial {
                Some(trial) => {
                    finite::write(request, geometry, trial, own, stress, moduli, scalar, out);
                }
                None => {
                    small::write(request, geometry, self.kinematics, stress, moduli, scalar, out);
                }
            }
            if let Some(factor) = &request.factor {
                for value in out {
                    *value *= factor[p];
                }
            }
        }
    }

    /// Accept the increments: stress (tau at finite strain), history, displacement and (where stored)
    /// eps_v of the particles. Returns the energy that the laws dissipate in the step [J per metre depth],
    /// with these volumes, those of the particles by default.
    ///
    /// # Errors
    /// [`Error::Inverted`]; then nothing has changed.
    pub fn commit(&self, particles: &mut Particles, volume: Option<&[f64]>) -> Result<f64> {
        let old = self.old(particles);
        let of = |p: usize| {
            let mut answer = self.respond(&old, p)?;
            if self.kinematics == Kinematics::Deviatoric {
                answer.stress.mean += self.increments.volumetric_at(self.location, p);
            }
            let dissipated = self.dissipated(particles, p, &answer);
            let Answer { stress, volume, history, .. } = answer;
            let u = self.increments.displacement(self.location, p);
            Some(Accepted { stress, volume, u, history, dissipated })
        };
        let tasks = (0..particles.len()).into_par_iter().with_min_len(BLOCK);
        let new: Vec<Option<Accepted>> = tasks.map(of).collect();
        if let Some(p) = new.iter().position(Option::is_none) {
            return Err(Error::Inverted { index: particles.number()[p] as usize });
        }
        let each = new.iter().flatten().zip(volume.unwrap_or(particles.volume()));
        let dissipated = each.fold(0.0, |sum, (new, volume)| sum + volume * new.dissipated);
        self.store(particles, &new);
        Ok(dissipated)
    }

    fn store(&self, particles: &mut Particles, new: &[Option<Accepted>]) {
        let stress = particles.reals_mut(Particles::STRESS).chunks_exact_mut(COMPONENTS);
        for (stress, new) in stress.zip(new.iter().flatten()) {
            for (i, s) in stress.iter_mut().enumerate() {
                *s = new.stress.deviator[i] + new.stress.mean * UNIT[i];
            }
        }
        let displacement = particles.reals_mut(Particles::DISPLACEMENT).chunks_exact_mut(DIM);
        for (displacement, new) in displacement.zip(new.iter().flatten()) {
            displacement.iter_mut().zip(new.u).for_each(|(d, u)| *d += u);
        }
        self.store_strain(particles);
        if let Some(eps_v) = particles.place(Role::State, "eps_v") {
            let eps_v = particles.reals_mut(eps_v).iter_mut();
            eps_v.zip(new.iter().flatten()).for_each(|(e, new)| *e += new.volume);
        }
        let material = particles.material().to_vec();
        for (law, places) in self.history(particles).into_iter().enumerate() {
            for (k, place) in places.into_iter().enumerate() {
                let values = particles.reals_mut(place).iter_mut().zip(&material);
                for ((value, &m), new) in values.zip(new.iter().flatten()) {
                    if m as usize == law {
                        *value = new.history[k];
                    }
                }
            }
        }
    }

    /// Add the increment to the strain since the start, where particles store it.
    fn store_strain(&self, particles: &mut Particles) {
        let grad_u = |p| self.increments.grad_u(self.location, p);
        if let Some(strain) = particles.place(Role::State, "strain") {
            let strain = particles.reals_mut(strain).par_chunks_exact_mut(COMPONENTS);
            strain.enumerate().for_each(|(p, strain)| {
                strain.iter_mut().zip(grad_u(p).symmetric_part()).for_each(|(e, new)| *e += new);
            });
        }
        if let Some(gradient) = particles.place(Role::State, GRADIENT) {
            let geometry = self.location.grid.geometry;
            let gradient = particles.reals_mut(gradient).par_chunks_exact_mut(geometry.tensor());
            gradient.enumerate().for_each(|(p, h)| {
                grad_u(p).after(&Gradient::of_rows(h)).write(geometry, h); // f F - I
            });
        }
    }
}

/// Check that the material of every particle exists, and that its law fits the kinematics and the strains.
///
/// # Errors
/// [`Error::UnknownMaterial`], [`Error::Incompressible`] or [`Error::FiniteOnly`] with the first such
/// particle.
pub fn check_materials(
    particles: &Particles,
    materials: &[Arc<dyn Law>],
    kinematics: Kinematics,
    finite: bool,
) -> Result<()> {
    for (index, &m) in particles.material().iter().enumerate() {
        let Some(law) = materials.get(m as usize) else {
            let (material, count) = (m as usize, materials.len());
            return Err(Error::UnknownMaterial { index, material, count });
        };
        if law.bulk_modulus().is_infinite() && kinematics != Kinematics::Deviatoric {
            return Err(Error::Incompressible { index });
        }
        if law.finite_only() && !finite {
            return Err(Error::FiniteOnly { index });
        }
    }
    Ok(())
}
