//! Requested quantities at small strain.

use super::kinematics::Kinematics;
use super::request::{Operator, Part, Request};
use super::stage::Scalar;
use crate::space::Geometry;
use crate::tensor::{dot, Moduli, Stress, Sym, MAX_STRAINS, STRAINS, UNIT, UNIT_DEVIATORS};

/// Components of an operator from a deviator `s` and a mean `m` of the stress, or of their derivatives.
fn components(operator: Operator, s: &Sym, m: f64, out: &mut [f64]) {
    match operator {
        Operator::Sigma => {
            STRAINS.iter().zip(out).for_each(|(&i, o)| *o = s[i] + m * UNIT[i]);
        }
        Operator::Deviator => STRAINS.iter().zip(out).for_each(|(&i, o)| *o = s[i]),
        Operator::Mean => out[0] = m,
        _ => {}
    }
}

/// Write the requested quantity from its first column on; `scalar` is the plastic volume or the history
/// variable.
pub(super) fn write(
    request: &Request,
    geometry: Geometry,
    kinematics: Kinematics,
    stress: &Stress,
    c: &Moduli,
    scalar: &Scalar,
    out: &mut [f64],
) {
    if matches!(request.operator, Operator::PlasticVolume | Operator::History(_)) {
        match request.part {
            Part::Value => out[0] = scalar.value,
            Part::Volume => out[0] = scalar.field,
            Part::Strain => {
                for (j, (o, e)) in out.iter_mut().zip(&UNIT_DEVIATORS).enumerate() {
                    let normal = UNIT[STRAINS[j]] > 0.0;
                    let with_volume = kinematics == Kinematics::Displacement && normal;
                    *o = dot(&scalar.deviator, e) + if with_volume { scalar.field } else { 0.0 };
                }
            }
            Part::Gradient => {}
        }
        return;
    }
    let (n, strains) = (request.operator.components(geometry), geometry.strains());
    match request.part {
        Part::Value => components(request.operator, &stress.deviator, stress.mean, out),
        Part::Volume => components(request.operator, &c.dev_vol, c.mean_vol, out),
        Part::Gradient => {}
        Part::Strain => {
            for (j, e) in UNIT_DEVIATORS[..strains].iter().enumerate() {
                let mut ds: Sym = std::array::from_fn(|i| dot(&c.dev_dev[i], e));
                let mut dm = dot(&c.mean_dev, e);
                if kinematics == Kinematics::Displacement && UNIT[STRAINS[j]] > 0.0 {
                    ds.iter_mut().zip(&c.dev_vol).for_each(|(d, v)| *d += v);
                    dm += c.mean_vol;
                }
                let mut column = [0.0; MAX_STRAINS];
                components(request.operator, &ds, dm, &mut column[..n]);
                (0..n).for_each(|i| out[strains * i + j] = column[i]);
            }
        }
    }
}
