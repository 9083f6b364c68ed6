//! One column of the storage of particles: a name, a role, and one row of numbers per particle.

use std::borrow::Cow;

use ndarray::{Array2, ArrayD, ArrayView2, Axis};

use crate::error::{check_finite, Result};

/// Part of the program that a column belongs to; columns are ordered by it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// The method.
    State,
    /// The laws.
    History,
    /// A time integration.
    Carried,
}

/// Entries of a column: particles, or particles x width.
#[derive(Debug, Clone)]
pub enum Values {
    /// Real numbers.
    Reals(ArrayD<f64>),
    /// Whole numbers.
    Numbers(ArrayD<u32>),
}

/// A column.
#[derive(Debug, Clone)]
pub struct Column {
    name: Cow<'static, str>,
    /// Which part of the program it belongs to.
    pub role: Role,
    values: Values,
}

impl Values {
    /// Zeros: one per particle, or a row of `width` per particle.
    #[must_use]
    pub fn zeros(particles: usize, width: Option<usize>) -> Self {
        let shape: Vec<usize> = std::iter::once(particles).chain(width).collect();
        Self::Reals(ArrayD::zeros(shape))
    }

    fn shape(&self) -> &[usize] {
        match self {
            Self::Reals(values) => values.shape(),
            Self::Numbers(values) => values.shape(),
        }
    }
}

impl Column {
    pub(super) fn new(name: &str, role: Role, values: Values) -> Self {
        Self { name: Cow::Owned(name.to_owned()), role, values }
    }

    fn with(&self, values: Values) -> Self {
        Self { name: self.name.clone(), role: self.role, values }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its entries.
    #[must_use]
    pub fn values(&self) -> &Values {
        &self.values
    }

    pub(super) fn is(&self, role: Role, name: &str) -> bool {
        self.role == role && self.name == name
    }

    /// Entries per particle.
    pub(super) fn width(&self) -> usize {
        self.values.shape()[1..].iter().product()
    }

    /// Bytes per particle.
    pub(super) fn bytes(&self) -> usize {
        self.width()
            * match self.values {
                Values::Reals(_) => size_of::<f64>(),
                Values::Numbers(_) => size_of::<u32>(),
            }
    }

    pub(super) fn reals(&self) -> &[f64] {
        match &self.values {
            Values::Reals(values) => values.as_slice().unwrap_or_default(),
            Values::Numbers(_) => &[],
        }
    }

    pub(super) fn reals_mut(&mut self) -> &mut [f64] {
        match &mut self.values {
            Values::Reals(values) => values.as_slice_mut().unwrap_or_default(),
            Values::Numbers(_) => &mut [],
        }
    }

    pub(super) fn numbers(&self) -> &[u32] {
        match &self.values {
            Values::Reals(_) => &[],
            Values::Numbers(values) => values.as_slice().unwrap_or_default(),
        }
    }

    pub(super) fn select(&self, rows: &[usize]) -> Self {
        self.with(match &self.values {
            Values::Reals(values) => Values::Reals(values.select(Axis(0), rows)),
            Values::Numbers(values) => Values::Numbers(values.select(Axis(0), rows)),
        })
    }

    /// The entries as real numbers, one row per particle.
    pub(super) fn rows(&self) -> Array2<f64> {
        let flat: Vec<f64> = match &self.values {
            Values::Reals(values) => values.iter().copied().collect(),
            Values::Numbers(values) => values.iter().map(|&number| f64::from(number)).collect(),
        };
        let shape = (self.values.shape()[0], self.width());
        Array2::from_shape_vec(shape, flat).unwrap_or_default()
    }

    /// The column with the entries that [`Column::rows`] gave.
    pub(super) fn of_rows(&self, rows: ArrayView2<f64>) -> Self {
        let mut shape = self.values.shape().to_vec();
        shape[0] = rows.nrows();
        let flat = rows.iter().copied();
        self.with(match self.values {
            Values::Reals(_) => Values::Reals(made(shape, flat.collect())),
            Values::Numbers(_) => Values::Numbers(made(shape, flat.map(|m| m as u32).collect())),
        })
    }

    /// Copy the entries of a column of the same kind.
    pub(super) fn assign(&mut self, other: &Self) {
        match (&mut self.values, &other.values) {
            (Values::Reals(mine), Values::Reals(others)) => mine.assign(others),
            (Values::Numbers(mine), Values::Numbers(others)) => mine.assign(others),
            _ => {}
        }
    }

    pub(super) fn check_finite(&self) -> Result<()> {
        check_finite(&self.name, self.reals(), self.width())
    }
}

fn made<T: Default + Clone>(shape: Vec<usize>, flat: Vec<T>) -> ArrayD<T> {
    ArrayD::from_shape_vec(shape, flat).unwrap_or_default()
}
