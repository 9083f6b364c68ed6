//! The particle stage of a Newton iteration: strain, material law, and the values and derivatives
//! that the weak form asks for; and the commit of a converged step.

use std::sync::Arc;

use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::grid::Location;
use crate::kinematics::{Increments, Kinematics};
use crate::material::{Material, Moduli, Strain, Stress};
use crate::particles::Particles;
use crate::tensor::{Sym, COMPONENTS, IN_PLANE, UNIT};

/// A quantity of the law that a form may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Operator {
    /// In-plane stress (xx, yy, xy) [Pa].
    Sigma,
    /// In-plane part (xx, yy, xy) of the three-dimensional deviator [Pa].
    Deviator,
    /// Mean stress [Pa].
    Mean,
}

impl Operator {
    /// Number of components.
    #[must_use]
    pub fn components(self) -> usize {
        match self {
            Self::Sigma | Self::Deviator => 3,
            Self::Mean => 1,
        }
    }

    /// The operator's components of a stress (or of its derivative in some direction).
    fn of(self, s: &Sym, m: f64, out: &mut [f64]) {
        match self {
            Self::Sigma => IN_PLANE.iter().zip(out).for_each(|(&i, o)| *o = s[i] + m * UNIT[i]),
            Self::Deviator => IN_PLANE.iter().zip(out).for_each(|(&i, o)| *o = s[i]),
            Self::Mean => out[0] = m,
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
    /// Its derivative with respect to the volumetric strain: 1 number per component.
    Volume,
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

fn dot(a: &Sym, b: &Sym) -> f64 {
    (0..COMPONENTS).map(|i| a[i] * b[i]).sum()
}

fn write(request: &Request, kinematics: Kinematics, stress: &Stress, c: &Moduli, row: &mut [f64]) {
    let n = request.operator.components();
    let out = &mut row[request.column..];
    match request.part {
        Part::Value => request.operator.of(&stress.deviator, stress.mean, out),
        Part::Volume => request.operator.of(&c.dev_vol, c.mean_vol, out),
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

/// Whether mean stress and deviator depend on each other beyond round-off.
fn couples(c: &Moduli) -> bool {
    let cross = c.dev_vol.iter().chain(&c.mean_dev).fold(0.0_f64, |a, b| a.max(b.abs()));
    let own = c.dev_dev.iter().flatten().fold(c.mean_vol.abs(), |a, b| a.max(b.abs()));
    cross > 1e-12 * own
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

/// What the particle stage works on.
#[derive(Clone, Copy)]
pub struct Stage<'a> {
    /// Where the particles are.
    pub location: &'a Location,
    /// The laws, or what was computed in their place.
    pub response: Response<'a>,
    /// How the strain follows from the increments.
    pub kinematics: Kinematics,
    /// The increments of the current Newton iterate.
    pub increments: Increments<'a>,
}

impl Stage<'_> {
    /// Strain, stress and tangent of particle `p`.
    fn respond(&self, particles: &Particles, p: usize) -> (Strain, Stress, Moduli) {
        let strain = self.increments.strain(self.kinematics, self.location, p);
        let (stress, moduli) = match self.response {
            Response::Laws(laws) => {
                let old: Sym = std::array::from_fn(|i| particles.stress[[p, i]]);
                laws[particles.material[p] as usize].respond(&strain, &Stress::from(&old))
            }
            Response::Given(stress, tangent) => {
                let stress: Sym = std::array::from_fn(|i| stress[COMPONENTS * p + i]);
                let at = COMPONENTS * COMPONENTS * p;
                let row = |i: usize| std::array::from_fn(|j| tangent[at + COMPONENTS * i + j]);
                (Stress::from(&stress), Moduli::from(&std::array::from_fn(row)))
            }
        };
        (strain, stress, moduli)
    }

    /// Strain increment of particle `p` as one tensor.
    #[must_use]
    pub fn strain(&self, p: usize) -> Sym {
        let strain = self.increments.strain(self.kinematics, self.location, p);
        std::array::from_fn(|i| strain.deviator[i] + strain.volume / 3.0 * UNIT[i])
    }

    /// Write what is requested into the particle data (particles x `columns`, at least one).
    ///
    /// # Errors
    /// [`Error::CoupledLaw`] where B-bar meets a law it has no tangent for.
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
        let of = |(p, row): (usize, &mut [f64])| {
            let (_, stress, moduli) = self.respond(particles, p);
            for request in requests {
                write(request, self.kinematics, &stress, &moduli, row);
            }
            (self.kinematics == Kinematics::Cell && couples(&moduli)).then_some(p)
        };
        let coupled = data.par_chunks_exact_mut(columns).enumerate().filter_map(of).min();
        coupled.map_or(Ok(()), |p| Err(Error::CoupledLaw { index: particles.number[p] as usize }))
    }

    /// Accept the increments: stress, displacement and (where stored) eps_v of the particles.
    pub fn commit(&self, particles: &mut Particles) {
        let of = |p: usize| {
            let (strain, mut stress, _) = self.respond(particles, p);
            if self.kinematics == Kinematics::Deviatoric {
                stress.mean += self.increments.volumetric_at(self.location, p);
            }
            let u = self.increments.u.value(self.location.cell[p] as usize, self.location.xi[p]);
            (stress, u, strain.volume)
        };
        let new: Vec<_> = (0..particles.len()).into_par_iter().map(of).collect();
        for (p, (stress, u, volume)) in new.into_iter().enumerate() {
            for (i, unit) in UNIT.iter().enumerate() {
                particles.stress[[p, i]] = stress.deviator[i] + stress.mean * unit;
            }
            particles.displacement[[p, 0]] += u[0];
            particles.displacement[[p, 1]] += u[1];
            if let Some(eps_v) = &mut particles.eps_v {
                eps_v[p] += volume;
            }
        }
    }
}

/// Check that every particle names a material, and that incompressible ones meet kinematics that
/// can take them.
///
/// # Errors
/// [`Error::UnknownMaterial`] or [`Error::Incompressible`], naming the first such particle.
pub fn check_materials(
    particles: &Particles,
    materials: &[Arc<dyn Material>],
    kinematics: Kinematics,
) -> Result<()> {
    for (index, &m) in particles.material.iter().enumerate() {
        let Some(law) = materials.get(m as usize) else {
            let (material, count) = (m as usize, materials.len());
            return Err(Error::UnknownMaterial { index, material, count });
        };
        if law.bulk_modulus().is_infinite() && kinematics != Kinematics::Deviatoric {
            return Err(Error::Incompressible { index });
        }
    }
    Ok(())
}
