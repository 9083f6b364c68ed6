//! The particle stage of a Newton iteration: strain, material law, and the values and derivatives
//! that the weak form asks for; and the commit of a converged step.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::finite_strain::{det_minus_one, Trial};
use crate::grid::Location;
use crate::kinematics::{Increments, Kinematics};
use crate::material::{Material, Moduli, Stress};
use crate::particles::Particles;
use crate::plane::Plane;
use crate::tensor::{dot, Sym, COMPONENTS, IN_PLANE, UNIT};

/// A quantity of the law that a form may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// In-plane stress (xx, yy, xy) [Pa].
    Sigma,
    /// In-plane part (xx, yy, xy) of the three-dimensional deviator [Pa].
    Deviator,
    /// Mean stress [Pa].
    Mean,
    /// P = tau f^-T (xx, xy, yx, yy) [Pa]; finite strain only.
    Nominal,
    /// P_s = s f^-T (xx, xy, yx, yy) [Pa], the deviator's part of P; finite strain only.
    NominalDeviator,
    /// Mean Kirchhoff stress [Pa]; finite strain only.
    MeanKirchhoff,
    /// ln J_f; finite strain only.
    LnJ,
}

impl Operator {
    /// Number of components.
    #[must_use]
    pub fn components(self) -> usize {
        match self {
            Self::Nominal | Self::NominalDeviator => 4,
            Self::Sigma | Self::Deviator => 3,
            Self::Mean | Self::MeanKirchhoff | Self::LnJ => 1,
        }
    }

    /// Whether it belongs to finite strain.
    #[must_use]
    pub fn finite(self) -> bool {
        !matches!(self, Self::Sigma | Self::Deviator | Self::Mean)
    }

    /// A small-strain operator's components of a stress (or of its derivative in some direction).
    fn of(self, s: &Sym, m: f64, out: &mut [f64]) {
        match self {
            Self::Sigma => IN_PLANE.iter().zip(out).for_each(|(&i, o)| *o = s[i] + m * UNIT[i]),
            Self::Deviator => IN_PLANE.iter().zip(out).for_each(|(&i, o)| *o = s[i]),
            Self::Mean => out[0] = m,
            _ => {}
        }
    }
}

/// What of an operator is wanted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Its value.
    Value,
    /// Its derivative with respect to the in-plane strain (xx, yy, gamma_xy) of `sym grad u`:
    /// 3 numbers per component, strain fastest.
    Strain,
    /// Its derivative with respect to grad u (xx, xy, yx, yy): 4 numbers per component; finite strain.
    Gradient,
    /// Its derivative with respect to the volumetric strain: 1 number per component.
    Volume,
}

impl Part {
    /// Numbers per component.
    #[must_use]
    pub fn width(self) -> usize {
        match self {
            Self::Value | Self::Volume => 1,
            Self::Strain => 3,
            Self::Gradient => 4,
        }
    }
}

/// One entry of the particle data: `part` of `operator`, from `column` on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// The operator.
    pub operator: Operator,
    /// Value or derivative.
    pub part: Part,
    /// First column of the particle data that is written.
    pub column: usize,
}

/// The deviators of unit in-plane strains xx, yy and gamma_xy.
const UNIT_DEVIATORS: [Sym; 3] = [
    [2.0 / 3.0, -1.0 / 3.0, -1.0 / 3.0, 0.0],
    [-1.0 / 3.0, 2.0 / 3.0, -1.0 / 3.0, 0.0],
    [0.0, 0.0, 0.0, 1.0],
];

fn write(request: &Request, kinematics: Kinematics, stress: &Stress, c: &Moduli, row: &mut [f64]) {
    let n = request.operator.components();
    let out = &mut row[request.column..];
    match request.part {
        Part::Value => request.operator.of(&stress.deviator, stress.mean, out),
        Part::Volume => request.operator.of(&c.dev_vol, c.mean_vol, out),
        Part::Gradient => {}
        Part::Strain => {
            for (j, e) in UNIT_DEVIATORS.iter().enumerate() {
                let mut ds: Sym = std::array::from_fn(|i| dot(&c.dev_dev[i], e));
                let mut dm = dot(&c.mean_dev, e);
                if kinematics == Kinematics::Displacement && j < 2 {
                    ds.iter_mut().zip(&c.dev_vol).for_each(|(d, v)| *d += v);
                    dm += c.mean_vol;
                }
                let mut column = [0.0; 3];
                request.operator.of(&ds, dm, &mut column[..n]);
                (0..n).for_each(|i| out[3 * i + j] = column[i]);
            }
        }
    }
}

/// `write` for finite strain: the volume follows ln J_f, or a field of its own.
fn write_finite(
    request: &Request,
    trial: &Trial,
    own: bool,
    tau: &Stress,
    c: &Moduli,
    row: &mut [f64],
) {
    const UNITS: [Plane; 4] = [
        [[1.0, 0.0], [0.0, 0.0]],
        [[0.0, 1.0], [0.0, 0.0]],
        [[0.0, 0.0], [1.0, 0.0]],
        [[0.0, 0.0], [0.0, 1.0]],
    ];
    let out = &mut row[request.column..];
    let (mut tau, mut c) = (*tau, *c);
    if request.operator == Operator::NominalDeviator {
        (tau.mean, c.mean_dev, c.mean_vol) = (0.0, [0.0; COMPONENTS], 0.0);
    }
    match (request.operator, request.part) {
        (Operator::Nominal | Operator::NominalDeviator, Part::Value) => {
            out[..4].copy_from_slice(&trial.nominal(&tau));
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Volume) => {
            out[..4].copy_from_slice(&trial.nominal_change(&tau, &c, &[[0.0; 2]; 2], 1.0));
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Gradient) => {
            for (k, unit) in UNITS.iter().enumerate() {
                let dv = if own { 0.0 } else { trial.volume_change(unit) };
                let change = trial.nominal_change(&tau, &c, unit, dv);
                (0..4).for_each(|i| out[4 * i + k] = change[i]);
            }
        }
        (Operator::MeanKirchhoff, Part::Value) => out[0] = tau.mean,
        (Operator::MeanKirchhoff, Part::Volume) => out[0] = c.mean_vol,
        (Operator::MeanKirchhoff, Part::Gradient) => {
            let changes = UNITS.iter().map(|unit| trial.mean_change(&c, unit));
            out.iter_mut().zip(changes).for_each(|(o, change)| *o = change);
        }
        (Operator::LnJ, Part::Value) => out[0] = trial.ln_j,
        (Operator::LnJ, Part::Volume) => out[0] = 0.0,
        (Operator::LnJ, Part::Gradient) => out[..4].copy_from_slice(&trial.ln_j_gradient()),
        _ => {}
    }
}

/// Where stress and tangent come from.
#[derive(Clone, Copy)]
pub enum Response<'a> {
    /// The laws; `particles.material` counts them from 0.
    Laws(&'a [Arc<dyn Material>]),
    /// Computed outside for the strains of [`Stage::strain`]: stress (4 numbers per particle) and
    /// tangent d stress / d strain (16, strain fastest), in the order of [`crate::tensor`].
    Given(&'a [f64], &'a [f64]),
}

/// Most history variables that a law may have.
pub const MAX_HISTORY: usize = 8;

/// What the particle stage works on.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// Where the particles are.
    pub location: &'a Location,
    /// The laws, or what was computed in their place.
    pub response: Response<'a>,
    /// Where the history variables of each law stand in [`Particles::history`].
    pub history: &'a [Vec<usize>],
    /// How the strain follows from the increments.
    pub kinematics: Kinematics,
    /// Whether strains are finite.
    pub finite: bool,
    /// The increments of the current Newton iterate.
    pub increments: Increments<'a>,
}

/// What a particle keeps of an accepted step: far less than its answer, of which all are held at once.
struct Kept {
    stress: Stress,
    volume: f64,
    u: [f64; 2],
    history: [f64; MAX_HISTORY],
    dissipated: f64,
}

/// What a particle answers to the increments.
struct Answer {
    /// Change of the volume that its law got.
    volume: f64,
    stress: Stress,
    moduli: Moduli,
    trial: Option<Trial>,
    history: [f64; MAX_HISTORY],
    /// Work of the stress on the plastic strain of the step [J/m3].
    dissipated: f64,
}

impl Stage<'_> {
    /// Strain, stress and tangent of particle `p`; `None` if it is turned inside out.
    fn respond(&self, particles: &Particles, p: usize) -> Option<Answer> {
        let (mut before, mut after) = ([0.0; MAX_HISTORY], [0.0; MAX_HISTORY]);
        let mut strain = self.increments.strain(self.kinematics, self.location, p);
        let (mut volume, mut dissipated) = (strain.volume, 0.0);
        let mut trial = None;
        let (stress, moduli) = match self.response {
            Response::Laws(laws) => {
                let number = particles.material[p] as usize;
                let (law, places) = (&laws[number], &self.history[number]);
                for (value, &place) in before.iter_mut().zip(places) {
                    *value = particles.history[place].1[p];
                }
                let old: Sym = std::array::from_fn(|i| particles.stress[[p, i]]);
                let mut old = Stress::from(&old);
                if self.finite {
                    let own = match self.kinematics {
                        Kinematics::Displacement => None,
                        Kinematics::Cell => {
                            let change =
                                det_minus_one(&self.increments.grad_u_of_cell(self.location, p));
                            Some((change > -1.0).then(|| change.ln_1p())?)
                        }
                        _ => Some(volume),
                    };
                    let g = self.increments.grad_u(self.location, p);
                    let elastic = law.elastic_strain(&old);
                    volume = own.unwrap_or(volume);
                    trial = Some(Trial::new(&g, own, &elastic)?);
                    // the law sees the whole elastic strain, from no stress
                    strain = trial.as_ref().map_or(strain, |t| t.strain);
                    old = Stress::default();
                }
                let (before, after) = (&before[..places.len()], &mut after[..places.len()]);
                let (new, moduli) = law.respond(&strain, &old, before, after);
                if !places.is_empty() {
                    let (start, end) = (law.elastic_strain(&old), law.elastic_strain(&new));
                    let plastic = |i| start.deviator[i] + strain.deviator[i] - end.deviator[i];
                    dissipated = dot(&new.deviator, &std::array::from_fn(plastic))
                        + new.mean * (start.volume + strain.volume - end.volume);
                }
                (new, moduli)
            }
            Response::Given(stress, tangent) => {
                let stress: Sym = std::array::from_fn(|i| stress[COMPONENTS * p + i]);
                let at = COMPONENTS * COMPONENTS * p;
                let row = |i: usize| std::array::from_fn(|j| tangent[at + COMPONENTS * i + j]);
                (Stress::from(&stress), Moduli::from(&std::array::from_fn(row)))
            }
        };
        let volume = match (&trial, self.kinematics) {
            (Some(trial), Kinematics::Displacement) => trial.ln_j,
            _ => volume,
        };
        Some(Answer { volume, stress, moduli, trial, history: after, dissipated })
    }

    /// Strain increment of particle `p` as one tensor; small strain.
    #[must_use]
    pub fn strain(&self, p: usize) -> Sym {
        let strain = self.increments.strain(self.kinematics, self.location, p);
        std::array::from_fn(|i| strain.deviator[i] + strain.volume / 3.0 * UNIT[i])
    }

    /// div u (ln J_f at finite strain) at particle `p`.
    #[must_use]
    pub fn volume_change(&self, p: usize) -> f64 {
        let g = self.increments.grad_u(self.location, p);
        if self.finite {
            // NaN where f turns the particle inside out: no iterate to accept
            return det_minus_one(&g).ln_1p();
        }
        g[0][0] + g[1][1]
    }

    /// Write what is requested into the particle data (particles x `columns`, at least one).
    ///
    /// # Errors
    /// [`Error::Inverted`], naming the first such particle.
    ///
    /// # Panics
    /// If a request reaches outside the columns; callers check at the border.
    pub fn evaluate(
        &self,
        particles: &Particles,
        requests: &[Request],
        columns: usize,
        data: &mut [f64],
    ) -> Result<()> {
        let own = self.kinematics != Kinematics::Displacement;
        let of = |(p, row): (usize, &mut [f64])| {
            let Some(Answer { stress, moduli, trial, .. }) = self.respond(particles, p) else {
                return Some(p);
            };
            for request in requests {
                match &trial {
                    Some(trial) => write_finite(request, trial, own, &stress, &moduli, row),
                    None => write(request, self.kinematics, &stress, &moduli, row),
                }
            }
            None
        };
        let first = data.par_chunks_exact_mut(columns).enumerate().filter_map(of).min();
        first.map_or(Ok(()), |p| Err(Error::Inverted { index: particles.number[p] as usize }))
    }

    /// Accept the increments: stress (tau at finite strain), history, displacement and (where stored)
    /// eps_v of the particles. Returns what the laws dissipate in the step [J per metre depth].
    ///
    /// # Errors
    /// [`Error::Inverted`]; then nothing has changed.
    pub fn commit(&self, particles: &mut Particles) -> Result<f64> {
        let of = |p: usize| {
            let answer = self.respond(particles, p)?;
            let Answer { mut stress, volume, history, dissipated, .. } = answer;
            if self.kinematics == Kinematics::Deviatoric {
                stress.mean += self.increments.volumetric_at(self.location, p);
            }
            let u = self.increments.u.value(self.location.cell[p] as usize, self.location.xi[p]);
            Some(Kept { stress, volume, u, history, dissipated })
        };
        let new: Vec<Option<Kept>> = (0..particles.len()).into_par_iter().map(of).collect();
        if let Some(p) = new.iter().position(Option::is_none) {
            return Err(Error::Inverted { index: particles.number[p] as usize });
        }
        let mut dissipated = 0.0;
        for (p, kept) in new.into_iter().flatten().enumerate() {
            let Kept { stress, volume, u, history, .. } = kept;
            dissipated += particles.volume[p] * kept.dissipated;
            for (i, unit) in UNIT.iter().enumerate() {
                particles.stress[[p, i]] = stress.deviator[i] + stress.mean * unit;
            }
            particles.displacement[[p, 0]] += u[0];
            particles.displacement[[p, 1]] += u[1];
            if let Some(eps_v) = &mut particles.eps_v {
                eps_v[p] += volume;
            }
            let places = self.history.get(particles.material[p] as usize);
            for (&place, value) in places.into_iter().flatten().zip(history) {
                particles.history[place].1[p] = value;
            }
        }
        Ok(dissipated)
    }
}

/// Check that every particle names a material, and that its law can be used with these kinematics and
/// with finite or small strains.
///
/// # Errors
/// [`Error::UnknownMaterial`], [`Error::Incompressible`], [`Error::PressureDependent`] or
/// [`Error::FiniteOnly`], naming the first such particle.
pub fn check_materials(
    particles: &Particles,
    materials: &[Arc<dyn Material>],
    kinematics: Kinematics,
    finite: bool,
) -> Result<()> {
    for (index, &m) in particles.material.iter().enumerate() {
        let Some(law) = materials.get(m as usize) else {
            let (material, count) = (m as usize, materials.len());
            return Err(Error::UnknownMaterial { index, material, count });
        };
        if law.bulk_modulus().is_infinite() && kinematics != Kinematics::Deviatoric {
            return Err(Error::Incompressible { index });
        }
        if law.pressure_dependent() && kinematics == Kinematics::Deviatoric {
            return Err(Error::PressureDependent { index });
        }
        if law.finite_only() && !finite {
            return Err(Error::FiniteOnly { index });
        }
    }
    Ok(())
}
