//! Points on a border that a displacement carries along.

use crate::grid::Location;
use crate::space::{Point, DIM};
use crate::tensor::matrix::{cofactor, unit_plus};
use crate::transfer::to_particles::Field;

/// Move points, and transform their outward normals times areas by Nanson's formula, n dA = cof(f) n0 dA0
/// f = I + grad u. Lost points stay as they are.
pub fn carry(u: &Field<DIM>, at: &Location, lost: &[bool], x: &mut [Point], area: &mut [Point]) {
    for p in (0..at.len()).filter(|&p| !lost[p]) {
        let (cell, xi) = (at.cell_of(p), at.xi[p]);
        let (value, gradient) = (u.value(cell, xi), u.gradient(cell, xi));
        let (cofactor, before) = (cofactor(&unit_plus(&gradient)), area[p]);
        for axis in 0..DIM {
            x[p][axis] += value[axis];
            area[p][axis] = (0..DIM).map(|k| cofactor[axis][k] * before[k]).sum();
        }
    }
}
