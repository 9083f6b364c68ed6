//! Particles: their storage, their strains, and the responses of their laws.
//!
//! The storage is one list of named columns, and it has only the columns that a scene needs.

pub mod column;
mod finite;
pub mod given;
mod history;
pub mod kinematics;
pub mod request;
mod small;
pub mod stage;

pub use column::{Column, Role, Values};

use ndarray::{s, Array1, Array2, ArrayView2, Axis};

use crate::error::{Error, Result};
use crate::space::{Geometry, COMPONENTS, DIM};

/// Name of the column with the displacement gradient F - I since the start, row by row: 2 x 2, or in
/// axisymmetry 3 x 3 with the hoop direction last.
pub const GRADIENT: &str = "displacement_gradient";

/// The particles of a scene. Volumes are per metre depth, or in axisymmetry of the whole ring.
///
/// | column         | content                                               | shape   |
/// |----------------|-------------------------------------------------------|---------|
/// | `x`            | position [m]                                          | n x 2   |
/// | `volume`       | volume V_p [m2, m3]                                   | n       |
/// | `material`     | number of the material                                | n       |
/// | `number`       | number of the particle in the body, used in messages  | n       |
/// | `stress`       | stress [Pa], order of [`crate::tensor`]               | n x 4   |
/// | `displacement` | displacement since the start [m]                      | n x 2   |
/// | `strain`       | strain since the start, at small strain               | n x 4   |
/// | [`GRADIENT`]   | F - I since the start, at finite strain               | n x 4 (9) |
/// | `eps_v`        | volumetric strain, with forms that have this field    | n       |
/// | history        | one column per history variable of the laws           | n       |
/// | carried        | arrays of a time integration (velocity, ...)          | n x any |
#[derive(Debug, Clone)]
pub struct Particles {
    columns: Vec<Column>,
}

impl Particles {
    /// Place of the positions in the list of columns.
    pub const X: usize = 0;
    /// Place of the volumes.
    pub const VOLUME: usize = 1;
    /// Place of the material numbers.
    pub const MATERIAL: usize = 2;
    /// Place of the numbers in the body.
    pub const NUMBER: usize = 3;
    /// Place of the stresses.
    pub const STRESS: usize = 4;
    /// Place of the displacements.
    pub const DISPLACEMENT: usize = 5;

    /// Particles at rest, free of stress.
    ///
    /// # Errors
    /// [`Error::NoParticles`], [`Error::Shape`], [`Error::NotFinite`] or [`Error::Volume`].
    pub fn new(x: Array2<f64>, volume: Array1<f64>, material: Array1<u32>) -> Result<Self> {
        let n = x.nrows();
        if n == 0 {
            return Err(Error::NoParticles);
        }
        if x.ncols() != DIM {
            let expected = format!("(particles, {DIM})");
            return Err(Error::Shape { name: "x", got: x.shape().to_vec(), expected });
        }
        for (name, got) in [("volume", volume.len()), ("material", material.len())] {
            if got != n {
                let expected = format!("({n},), one entry per particle of x");
                return Err(Error::Shape { name, got: vec![got], expected });
            }
        }
        let number: Array1<u32> = (0..n as u32).collect();
        let state = |name, values| Column::new(name, Role::State, values);
        let particles = Self {
            columns: vec![
                state("x", Values::Reals(x.into_dyn())),
                state("volume", Values::Reals(volume.into_dyn())),
                state("material", Values::Numbers(material.into_dyn())),
                state("number", Values::Numbers(number.into_dyn())),
                state("stress", Values::zeros(n, Some(COMPONENTS))),
                state("displacement", Values::zeros(n, Some(DIM))),
            ],
        };
        particles.check()?;
        Ok(particles)
    }

    /// All columns.
    #[must_use]
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Present place of a column of some role.
    #[must_use]
    pub fn place(&self, role: Role, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column.is(role, name))
    }

    /// Names of all columns of a role.
    #[must_use]
    pub fn names(&self, role: Role) -> Vec<&str> {
        self.columns.iter().filter(|column| column.role == role).map(Column::name).collect()
    }

    /// Entries of a column of real numbers, row by row; empty for a column of whole numbers.
    #[must_use]
    pub fn reals(&self, place: usize) -> &[f64] {
        self.columns[place].reals()
    }

    /// The same, to be written.
    pub fn reals_mut(&mut self, place: usize) -> &mut [f64] {
        self.columns[place].reals_mut()
    }

    /// Volumes V_p [m2], in axisymmetry [m3].
    #[must_use]
    pub fn volume(&self) -> &[f64] {
        self.reals(Self::VOLUME)
    }

    /// Number of the material of each particle.
    #[must_use]
    pub fn material(&self) -> &[u32] {
        self.columns[Self::MATERIAL].numbers()
    }

    /// Number of each particle in the body.
    #[must_use]
    pub fn number(&self) -> &[u32] {
        self.columns[Self::NUMBER].numbers()
    }

    /// Stresses [Pa], one after the other.
    #[must_use]
    pub fn stress(&self) -> &[f64] {
        self.reals(Self::STRESS)
    }

    /// Displacements [m], one after the other.
    #[must_use]
    pub fn displacement(&self) -> &[f64] {
        self.reals(Self::DISPLACEMENT)
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.volume().len()
    }

    /// Whether there are no particles (after [`Particles::select`] on a rank without any).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Some of the particles, in the order given; there may be none.
    ///
    /// # Panics
    /// If there is no such particle; callers check at the border.
    #[must_use]
    pub fn select(&self, particles: &[u32]) -> Self {
        let rows: Vec<usize> = particles.iter().map(|&p| p as usize).collect();
        Self { columns: self.columns.iter().map(|column| column.select(&rows)).collect() }
    }

    /// All columns side by side, one row per particle: the form in which particles travel between ranks.
    #[must_use]
    pub fn rows(&self) -> Array2<f64> {
        let parts: Vec<_> = self.columns.iter().map(Column::rows).collect();
        let views: Vec<_> = parts.iter().map(|part| part.view()).collect();
        ndarray::concatenate(Axis(1), &views).unwrap_or_default()
    }

    /// Particles with the same columns as these, from rows as [`Particles::rows`] makes them; `None`
    /// if these have another width.
    #[must_use]
    pub fn of_rows(&self, rows: &ArrayView2<f64>) -> Option<Self> {
        if rows.ncols() != self.columns.iter().map(Column::width).sum::<usize>() {
            return None;
        }
        let mut first = 0;
        let columns = self.columns.iter().map(|column| {
            let part = rows.slice(s![.., first..first + column.width()]);
            first += column.width();
            column.of_rows(part)
        });
        Some(Self { columns: columns.collect() })
    }

    /// Copy the values of the same particles with the same columns, in place; false if they differ.
    pub fn assign(&mut self, other: &Self) -> bool {
        if self.number() != other.number() || self.arrays() != other.arrays() {
            return false;
        }
        for (mine, others) in self.columns.iter_mut().zip(&other.columns) {
            mine.assign(others);
        }
        true
    }

    /// Check what a user may have written into the columns: finite values, positive volumes.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::Volume`] with column and particle.
    pub fn check(&self) -> Result<()> {
        for column in &self.columns {
            column.check_finite().map_err(|e| e.of_body(self.number()))?;
        }
        let volume = self.volume();
        match volume.iter().position(|&v| v <= 0.0) {
            Some(p) => Err(Error::Volume { index: self.number()[p] as usize, value: volume[p] }),
            None => Ok(()),
        }
    }

    /// Add a column of zeros behind those of its role; one with that role and name stays as it is.
    pub fn add(&mut self, role: Role, name: &str, width: Option<usize>) {
        if self.place(role, name).is_none() {
            let behind = self.columns.iter().position(|column| column.role > role);
            let column = Column::new(name, role, Values::zeros(self.len(), width));
            self.columns.insert(behind.unwrap_or(self.columns.len()), column);
        }
    }

    /// Add the column from which the strain since the start follows, zero at first.
    pub fn add_strain(&mut self, finite: bool, geometry: Geometry) {
        if finite {
            self.add(Role::State, GRADIENT, Some(geometry.tensor()));
        } else {
            self.add(Role::State, "strain", Some(COMPONENTS));
        }
    }

    /// Present places of the history variables of a law; `None` if one is missing.
    #[must_use]
    pub fn history_of(&self, names: &[&str]) -> Option<Vec<usize>> {
        names.iter().map(|name| self.place(Role::History, name)).collect()
    }

    /// Name of each column, and bytes that one particle takes in it.
    #[must_use]
    pub fn arrays(&self) -> Vec<(&str, usize)> {
        self.columns.iter().map(|column| (column.name(), column.bytes())).collect()
    }

    /// Bytes that one particle takes in all of them.
    #[must_use]
    pub fn bytes_per_particle(&self) -> usize {
        self.columns.iter().map(Column::bytes).sum()
    }
}
