//! Array arguments. The types of rust-numpy panic where an array cannot be written, or is written and read
//! at the same time, and they read wrong memory where its numbers are not aligned. These types raise an
//! error instead.

use std::ops::{Deref, DerefMut};

use ndarray::{Dimension, Ix1, Ix2};
use numpy::npyffi::NPY_ARRAY_ALIGNED;
use numpy::{
    Element, PyArray, PyArrayMethods, PyReadonlyArray, PyReadwriteArray, PyUntypedArrayMethods,
};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

/// An array that is read.
pub(super) struct Read<'py, T: Element, D: Dimension>(PyReadonlyArray<'py, T, D>);

/// An array that is written.
pub(super) struct Write<'py, T: Element, D: Dimension>(PyReadwriteArray<'py, T, D>);

pub(super) type Read1<'py, T> = Read<'py, T, Ix1>;
pub(super) type Read2<'py, T> = Read<'py, T, Ix2>;
pub(super) type Write1<'py, T> = Write<'py, T, Ix1>;
pub(super) type Write2<'py, T> = Write<'py, T, Ix2>;

fn aligned<'py, T: Element, D: Dimension>(
    object: Borrowed<'_, 'py, PyAny>,
) -> PyResult<Bound<'py, PyArray<T, D>>> {
    let array = object.cast::<PyArray<T, D>>()?.to_owned();
    // SAFETY: the pointer is that of a NumPy array, which the caller keeps.
    if unsafe { (*array.as_array_ptr()).flags } & NPY_ARRAY_ALIGNED == 0 {
        return Err(PyTypeError::new_err("internal: an array that is not aligned"));
    }
    Ok(array)
}

impl<'a, 'py, T: Element, D: Dimension> FromPyObject<'a, 'py> for Read<'py, T, D> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self(aligned(object)?.try_readonly()?))
    }
}

impl<'a, 'py, T: Element, D: Dimension> FromPyObject<'a, 'py> for Write<'py, T, D> {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let array = aligned(object)?;
        if !array.is_c_contiguous() {
            return Err(PyTypeError::new_err("internal: an array to write that is not row by row"));
        }
        Ok(Self(array.try_readwrite()?))
    }
}

impl<'py, T: Element, D: Dimension> Deref for Read<'py, T, D> {
    type Target = PyReadonlyArray<'py, T, D>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<'py, T: Element, D: Dimension> Deref for Write<'py, T, D> {
    type Target = PyReadwriteArray<'py, T, D>;

    fn deref(&self) -> &Self::Target {
        &self.0
    }
}

impl<T: Element, D: Dimension> DerefMut for Write<'_, T, D> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.0
    }
}
