//! The strain increment that a material law receives, from the fields of the form.
//!
//! | name           | deviator                  | volume                     |
//! |----------------|---------------------------|----------------------------|
//! | `displacement` | dev(sym grad u)           | div u                      |
//! | `mixed`        | dev(sym grad u)           | eps_v                      |
//! | `cell`         | dev(sym grad u)           | div u at the cell's centre |
//! | `deviatoric`   | dev(sym grad u)           | 0 (the form carries p)     |
//!
//! Deviator and volume stay apart all the way to the stress: summed
//! into one tensor, the round-off of the deviator would reach the mean stress multiplied by K.

use std::str::FromStr;

use crate::error::Error;
use crate::grid::Location;
use crate::interpolation::Field;
use crate::material::Strain;

/// How the strain follows from the fields; see the table above.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kinematics {
    /// Everything from the displacement.
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
    pub u: Field<'a, 2>,
    /// The bilinear field of the form, if it has one: eps_v, or p [Pa].
    pub volumetric: Option<Field<'a, 1>>,
}

impl Increments<'_> {
    /// Displacement gradient at particle `p`.
    #[must_use]
    pub fn grad_u(&self, location: &Location, p: usize) -> [[f64; 2]; 2] {
        self.u.gradient(location.cell[p] as usize, location.xi[p])
    }

    /// Displacement gradient at the centre of the cell of particle `p`.
    #[must_use]
    pub fn grad_u_of_cell(&self, location: &Location, p: usize) -> [[f64; 2]; 2] {
        self.u.gradient(location.cell[p] as usize, [0.5, 0.5])
    }

    /// The bilinear field at particle `p`; 0 where the form has none.
    #[must_use]
    pub fn volumetric_at(&self, location: &Location, p: usize) -> f64 {
        let at = |f: Field<1>| f.value(location.cell[p] as usize, location.xi[p])[0];
        self.volumetric.map_or(0.0, at)
    }

    /// Strain increment at particle `p`.
    #[must_use]
    pub fn strain(&self, kinematics: Kinematics, location: &Location, p: usize) -> Strain {
        let g = self.grad_u(location, p);
        let div = g[0][0] + g[1][1];
        let third = div / 3.0;
        let deviator = [g[0][0] - third, g[1][1] - third, -third, g[0][1] + g[1][0]];
        let volume = match kinematics {
            Kinematics::Displacement => div,
            Kinematics::Mixed => self.volumetric_at(location, p),
            Kinematics::Cell => {
                let c = self.grad_u_of_cell(location, p);
                c[0][0] + c[1][1]
            }
            Kinematics::Deviatoric => 0.0,
        };
        Strain { deviator, volume }
    }
}
