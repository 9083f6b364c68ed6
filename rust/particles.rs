//! Particle storage: structure of arrays, and only the arrays that the scene needs.

use ndarray::{s, Array1, Array2, ArrayView2, Axis};

use crate::error::{check_finite, Error, Result};
use crate::tensor::COMPONENTS;

/// The particles of a scene. Volumes are per metre depth.
#[derive(Debug, Clone)]
pub struct Particles {
    /// Positions [m], n x 2.
    pub x: Array2<f64>,
    /// Volumes V_p [m2], n.
    pub volume: Array1<f64>,
    /// Number of the material, n.
    pub material: Array1<u32>,
    /// Number of the particle in the body, n: what messages call it.
    pub number: Array1<u32>,
    /// Stress [Pa], n x 4, order of [`crate::tensor`].
    pub stress: Array2<f64>,
    /// Displacement since the start [m], n x 2.
    pub displacement: Array2<f64>,
    /// Volumetric strain eps_v, n; only with forms that have this field.
    pub eps_v: Option<Array1<f64>>,
    /// History variables of the laws by name, n each; only those that the laws have.
    pub history: Vec<(&'static str, Array1<f64>)>,
    /// What a time integration carries by name (velocity, ...), n x width each.
    pub carried: Vec<(String, Array2<f64>)>,
}

impl Particles {
    /// Particles at rest, free of stress.
    ///
    /// # Errors
    /// [`Error::NoParticles`], [`Error::Shape`], [`Error::NotFinite`] or [`Error::Volume`].
    pub fn new(x: Array2<f64>, volume: Array1<f64>, material: Array1<u32>) -> Result<Self> {
        let n = x.nrows();
        if n == 0 {
            return Err(Error::NoParticles);
        }
        if x.ncols() != 2 {
            let expected = "(particles, 2)".to_owned();
            return Err(Error::Shape { name: "x", got: x.shape().to_vec(), expected });
        }
        for (name, got) in [("volume", volume.len()), ("material", material.len())] {
            if got != n {
                let expected = format!("({n},), one entry per particle of x");
                return Err(Error::Shape { name, got: vec![got], expected });
            }
        }
        let particles = Self {
            stress: Array2::zeros((n, COMPONENTS)),
            displacement: Array2::zeros((n, 2)),
            eps_v: None,
            history: Vec::new(),
            carried: Vec::new(),
            number: (0..n as u32).collect(),
            x,
            volume,
            material,
        };
        particles.check()?;
        Ok(particles)
    }

    /// Some of the particles, in the order given; there may be none.
    ///
    /// # Panics
    /// If there is no such particle; callers check at the border.
    #[must_use]
    pub fn select(&self, particles: &[u32]) -> Self {
        let rows: Vec<usize> = particles.iter().map(|&p| p as usize).collect();
        let (all, per_particle) = (Axis(0), |a: &Array1<f64>| a.select(Axis(0), &rows));
        Self {
            x: self.x.select(all, &rows),
            volume: per_particle(&self.volume),
            material: self.material.select(all, &rows),
            number: self.number.select(all, &rows),
            stress: self.stress.select(all, &rows),
            displacement: self.displacement.select(all, &rows),
            eps_v: self.eps_v.as_ref().map(per_particle),
            history: self.history.iter().map(|(name, a)| (*name, per_particle(a))).collect(),
            carried: self.carried.iter().map(|(n, a)| (n.clone(), a.select(all, &rows))).collect(),
        }
    }

    /// All arrays of the particles side by side, a row each: as they travel between ranks.
    #[must_use]
    pub fn rows(&self) -> Array2<f64> {
        let numbers = |a: &Array1<u32>| a.mapv(f64::from).insert_axis(Axis(1));
        let column = |a: &Array1<f64>| a.to_owned().insert_axis(Axis(1));
        let mut parts = vec![self.x.clone(), column(&self.volume), numbers(&self.material)];
        parts.extend([numbers(&self.number), self.stress.clone(), self.displacement.clone()]);
        parts.extend(self.eps_v.as_ref().map(column));
        parts.extend(self.history.iter().map(|(_, a)| column(a)));
        parts.extend(self.carried.iter().map(|(_, a)| a.clone()));
        let views: Vec<_> = parts.iter().map(|a| a.view()).collect();
        ndarray::concatenate(Axis(1), &views).unwrap_or_default()
    }

    /// Particles with the same arrays as these, from rows as [`Particles::rows`] makes them; `None`
    /// if these have another width.
    #[must_use]
    pub fn of_rows(&self, rows: &ArrayView2<f64>) -> Option<Self> {
        let mut first = 0;
        let mut next = |width: usize| {
            let part = rows.slice(s![.., first..first + width]).to_owned();
            first += width;
            part
        };
        if rows.ncols() != self.rows().ncols() {
            return None;
        }
        let column = |a: Array2<f64>| a.column(0).to_owned();
        Some(Self {
            x: next(2),
            volume: column(next(1)),
            material: column(next(1)).mapv(|m| m as u32),
            number: column(next(1)).mapv(|m| m as u32),
            stress: next(COMPONENTS),
            displacement: next(2),
            eps_v: self.eps_v.as_ref().map(|_| column(next(1))),
            history: self.history.iter().map(|(name, _)| (*name, column(next(1)))).collect(),
            carried: self.carried.iter().map(|(n, a)| (n.clone(), next(a.ncols()))).collect(),
        })
    }

    /// Take over the values of the same particles with the same arrays, in place; false if they are others.
    pub fn assign(&mut self, other: &Self) -> bool {
        if self.number != other.number || self.arrays() != other.arrays() {
            return false;
        }
        self.x.assign(&other.x);
        self.volume.assign(&other.volume);
        self.material.assign(&other.material);
        self.stress.assign(&other.stress);
        self.displacement.assign(&other.displacement);
        if let (Some(mine), Some(others)) = (&mut self.eps_v, &other.eps_v) {
            mine.assign(others);
        }
        for ((_, mine), (_, others)) in self.history.iter_mut().zip(&other.history) {
            mine.assign(others);
        }
        for ((_, mine), (_, others)) in self.carried.iter_mut().zip(&other.carried) {
            mine.assign(others);
        }
        true
    }

    /// Check what a user may have written into the arrays: finite values, positive volumes.
    ///
    /// # Errors
    /// [`Error::NotFinite`] or [`Error::Volume`], naming array and particle.
    pub fn check(&self) -> Result<()> {
        fn flat<D: ndarray::Dimension>(a: &ndarray::Array<f64, D>) -> &[f64] {
            a.as_slice().unwrap_or_default()
        }
        let finite = |name: &str, values, per_particle| {
            check_finite(name, values, per_particle).map_err(|e| e.of_body(&self.number))
        };
        finite("x", flat(&self.x), 2)?;
        finite("volume", flat(&self.volume), 1)?;
        finite("stress", flat(&self.stress), COMPONENTS)?;
        finite("displacement", flat(&self.displacement), 2)?;
        if let Some(eps_v) = &self.eps_v {
            finite("eps_v", flat(eps_v), 1)?;
        }
        for (name, values) in &self.history {
            finite(name, flat(values), 1)?;
        }
        for (name, values) in &self.carried {
            finite(name, flat(values), values.ncols())?;
        }
        match self.volume.iter().position(|&v| v <= 0.0) {
            Some(p) => Err(Error::Volume { index: self.number[p] as usize, value: self.volume[p] }),
            None => Ok(()),
        }
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.volume.len()
    }

    /// Whether there are no particles (after [`Particles::select`] on a rank without any).
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.volume.is_empty()
    }

    /// Make room for the volumetric strain, zero at first.
    pub fn add_eps_v(&mut self) {
        if self.eps_v.is_none() {
            self.eps_v = Some(Array1::zeros(self.len()));
        }
    }

    /// Make room for the history variables of a law, zero at first.
    pub fn add_history(&mut self, names: &[&'static str]) {
        for &name in names {
            if !self.history.iter().any(|(known, _)| *known == name) {
                self.history.push((name, Array1::zeros(self.len())));
            }
        }
    }

    /// Make room for an array of a time integration, zero at first; one of that name stays as it is.
    pub fn carry(&mut self, name: &str, width: usize) {
        if !self.carried.iter().any(|(known, _)| known == name) {
            self.carried.push((name.to_owned(), Array2::zeros((self.len(), width))));
        }
    }

    /// Where the history variables of a law stand; `None` if one is not there.
    #[must_use]
    pub fn history_of(&self, names: &[&str]) -> Option<Vec<usize>> {
        let place = |name: &&str| self.history.iter().position(|(known, _)| known == name);
        names.iter().map(place).collect()
    }

    /// The arrays that there are: name, and bytes that one particle takes in it.
    #[must_use]
    pub fn arrays(&self) -> Vec<(&str, usize)> {
        const DOUBLE: usize = size_of::<f64>();
        const NUMBER: usize = size_of::<u32>();
        // a new array does not compile before it is named here
        let Self {
            x,
            volume: _,
            material: _,
            number: _,
            stress,
            displacement,
            eps_v,
            history,
            carried,
        } = self;
        let mut arrays = vec![
            ("x", DOUBLE * x.ncols()),
            ("volume", DOUBLE),
            ("material", NUMBER),
            ("number", NUMBER),
            ("stress", DOUBLE * stress.ncols()),
            ("displacement", DOUBLE * displacement.ncols()),
        ];
        arrays.extend(eps_v.as_ref().map(|_| ("eps_v", DOUBLE)));
        arrays.extend(history.iter().map(|(name, _)| (*name, DOUBLE)));
        arrays.extend(carried.iter().map(|(name, a)| (name.as_str(), DOUBLE * a.ncols())));
        arrays
    }

    /// Bytes that one particle takes in all of them.
    #[must_use]
    pub fn bytes_per_particle(&self) -> usize {
        self.arrays().iter().map(|(_, bytes)| bytes).sum()
    }
}
