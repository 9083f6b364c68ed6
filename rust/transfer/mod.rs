//! Transfers between particles and grid.
//!
//! | module           | from      | to                                         |
//! |------------------|-----------|--------------------------------------------|
//! | [`to_particles`] | grid      | particles: values and gradients of fields  |
//! | [`border`]       | grid      | points of a border that it carries along   |
//! | [`to_grid`]      | particles | functions: sums weighted by their values   |
//! | [`densities`]    | particles | points of a quadrature rule                |
//! | [`cells`]        | particles | cells: sums and means                      |

pub mod border;
pub mod cells;
pub mod densities;
pub mod to_grid;
pub mod to_particles;
