//! The strain increment that a law receives, from the fields of the form.
//!
//! | name           | deviator                  | volume                     |
//! |----------------|---------------------------|----------------------------|
//! | `displacement` | dev(sym grad u)           | div u                      |
//! | `mixed`        | dev(sym grad u)           | eps_v, the elastic part    |
//! | `cell`         | dev(sym grad u)           | div u at the cell's centre |
//! | `deviatoric`   | dev(sym grad u)           | 0 (the form has p)         |
//!
//! In axisymmetry grad u has the hoop strain u_r / r. At finite strain, ln J_f takes the place of div u. With `mixed` and `deviatoric` the law receives the
//! mean stress, old + K eps_v or old + p, and answers with the plastic volumetric strain.

use std::str::FromStr;

use crate::error::Error;
use crate::grid::Location;
use crate::space::{Geometry, Index, Point, DIM};
use crate::tensor::{Gradient, Strain};
use crate::transfer::to_particles::Field;

/// How the strain follows from the fields; see the table above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinematics {
    /// Deviator and volume follow from the displacement.
    Displacement,
    /// The volumetric strain is a field of its own.
    Mixed,
    /// B-bar: the volumetric strain is that of the cell's centre.
    Cell,
    /// Only the deviator reaches the law; the pressure is a field of the form.
    Deviatoric,
}

impl FromStr for Kinematics {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self, Error> {
        match name {
            "displacement" => Ok(Self::Displacement),
            "mixed" => Ok(Self::Mixed),
            "cell" => Ok(Self::Cell),
            "deviatoric" => Ok(Self::Deviatoric),
            _ => Err(Error::UnknownName {
                what: "kinematics",
                name: name.to_owned(),
                expected: "'displacement', 'mixed', 'cell', 'deviatoric'",
            }),
        }
    }
}

/// The increments of one Newton iterate on the grid.
#[derive(Debug, Clone, Copy)]
pub struct Increments<'a> {
    /// Displacement increment [m].
    pub u: Field<'a, DIM>,
    /// The linear field of the form, if it has one: eps_v, or p [Pa].
    pub volumetric: Option<Field<'a, 1>>,
}

/// Gradient of a displacement at a position in a cell, in axisymmetry with the hoop strain u_r / r.
#[must_use]
pub fn gradient(u: &Field<DIM>, cell: Index, xi: Point) -> Gradient {
    let in_space = u.gradient(cell, xi);
    let hoop = match u.grid.geometry {
        Geometry::PlaneStrain => 0.0,
        Geometry::Axisymmetric => u.value(cell, xi)[0] / u.grid.position(cell, xi)[0],
    };
    Gradient { in_space, hoop }
}

impl Increments<'_> {
    /// Displacement gradient at particle `p`.
    #[must_use]
    pub fn grad_u(&self, location: &Location, p: usize) -> Gradient {
        gradient(&self.u, location.cell_of(p), location.xi[p])
    }

    /// Displacement gradient at the centre of the cell of particle `p`.
    #[must_use]
    pub fn grad_u_of_cell(&self, location: &Location, p: usize) -> Gradient {
        gradient(&self.u, location.cell_of(p), [0.5; DIM])
    }

    /// Displacement of particle `p` [m].
    #[must_use]
    pub fn displacement(&self, location: &Location, p: usize) -> [f64; DIM] {
        self.u.value(location.cell_of(p), location.xi[p])
    }

    /// The linear field at particle `p`; 0 where the form has none.
    #[must_use]
    pub fn volumetric_at(&self, location: &Location, p: usize) -> f64 {
        self.volumetric.map_or(0.0, |field| field.value(location.cell_of(p), location.xi[p])[0])
    }

    /// Small strain increment at particle `p`.
    #[must_use]
    pub fn strain(&self, kinematics: Kinematics, location: &Location, p: usize) -> Strain {
        let strain = self.grad_u(location, p).small_strain();
        let volume = match kinematics {
            Kinematics::Displacement => strain.volume,
            Kinematics::Mixed => self.volumetric_at(location, p),
            Kinematics::Cell => self.grad_u_of_cell(location, p).trace(),
            Kinematics::Deviatoric => 0.0,
        };
        Strain { volume, ..strain }
    }
}
