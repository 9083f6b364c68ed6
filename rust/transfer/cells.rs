//! Particles -> cells: sums and means over the particles of a cell, in the order of the particles.

use ndarray::{Array2, ArrayView2};

use crate::grid::Location;

/// `sum_p w_p D_p` over the particles of the a-th active cell, one value per column.
///
/// # Panics
/// If a column or a particle is outside its array; callers check at the border.
pub fn sum_of_cell(
    location: &Location,
    a: usize,
    weight: &[f64],
    data: ArrayView2<f64>,
    columns: impl IntoIterator<Item = usize>,
    out: &mut [f64],
) {
    let particles = location.particles_of(a);
    for (sum, c) in out.iter_mut().zip(columns) {
        *sum = particles.iter().map(|&p| weight[p as usize] * data[[p as usize, c]]).sum();
    }
}

/// Mean over the particles of the a-th active cell weighted by volume, one value per column.
///
/// # Panics
/// As [`sum_of_cell`].
pub fn mean_of_cell(
    location: &Location,
    a: usize,
    volume: &[f64],
    data: ArrayView2<f64>,
    columns: &[usize],
    out: &mut [f64],
) {
    sum_of_cell(location, a, volume, data, columns.iter().copied(), out);
    let total: f64 = location.particles_of(a).iter().map(|&p| volume[p as usize]).sum();
    for sum in out {
        *sum /= total;
    }
}

/// `sum_p w_p D_p` over the particles of every cell of the grid: cells x columns, zero where a cell has
/// no particles.
///
/// # Panics
/// As [`sum_of_cell`].
#[must_use]
pub fn cell_sums(location: &Location, weight: &[f64], data: ArrayView2<f64>) -> Array2<f64> {
    let columns = data.ncols();
    let mut sums = Array2::zeros((location.grid.num_cells(), columns));
    for (a, &cell) in location.active.iter().enumerate() {
        let mut row = sums.row_mut(cell as usize);
        if let Some(row) = row.as_slice_mut() {
            sum_of_cell(location, a, weight, data, 0..columns, row);
        }
    }
    sums
}
