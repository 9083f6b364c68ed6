//! Requested quantities at finite strain.

use super::request::{Operator, Part, Request};
use super::stage::Scalar;
use crate::space::{Geometry, COMPONENTS};
use crate::tensor::hencky::Trial;
use crate::tensor::{Gradient, Moduli, Stress};

/// Write the requested quantity from its first column on. The volume follows ln J_f, or has a field of its
/// `own`. `scalar` is the plastic volume or the history variable.
#[allow(clippy::too_many_arguments)]
pub(super) fn write(
    request: &Request,
    geometry: Geometry,
    trial: &Trial,
    own: bool,
    tau: &Stress,
    c: &Moduli,
    scalar: &Scalar,
    out: &mut [f64],
) {
    let (mut tau, mut c, n) = (*tau, *c, geometry.gradients());
    if request.operator == Operator::NominalDeviator {
        (tau.mean, c.mean_dev, c.mean_vol) = (0.0, [0.0; COMPONENTS], 0.0);
    }
    match (request.operator, request.part) {
        (Operator::Nominal | Operator::NominalDeviator, Part::Value) => {
            out.copy_from_slice(&trial.nominal(&tau)[..n]);
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Volume) => {
            let change = Stress { deviator: c.dev_vol, mean: c.mean_vol };
            out.copy_from_slice(&trial.nominal(&change)[..n]);
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Gradient) => {
            for k in 0..n {
                let dg = Gradient::unit(k);
                let dv = if own { 0.0 } else { trial.volume_change(&dg) };
                let change = trial.nominal_change(&tau, &c, &dg, dv);
                (0..n).for_each(|i| out[n * i + k] = change[i]);
            }
        }
        (Operator::MeanKirchhoff, Part::Value) => out[0] = tau.mean,
        (Operator::MeanKirchhoff, Part::Volume) => out[0] = c.mean_vol,
        (Operator::MeanKirchhoff, Part::Gradient) => {
            for (k, o) in out.iter_mut().enumerate() {
                let dg = Gradient::unit(k);
                let dv = if own { 0.0 } else { trial.volume_change(&dg) };
                *o = trial.change(&c.mean_dev, &dg) + c.mean_vol * dv;
            }
        }
        (Operator::PlasticVolume | Operator::History(_), Part::Value) => out[0] = scalar.value,
        (Operator::PlasticVolume | Operator::History(_), Part::Volume) => out[0] = scalar.field,
        (Operator::PlasticVolume | Operator::History(_), Part::Gradient) => {
            for (k, o) in out.iter_mut().enumerate() {
                let dg = Gradient::unit(k);
                let dv = if own { 0.0 } else { trial.volume_change(&dg) };
                *o = trial.change(&scalar.deviator, &dg) + scalar.field * dv;
            }
        }
        (Operator::LnJ, Part::Value) => out[0] = trial.ln_j,
        (Operator::LnJ, Part::Volume) => out[0] = 0.0,
        (Operator::LnJ, Part::Gradient) => out.copy_from_slice(&trial.ln_j_gradient()[..n]),
        _ => {}
    }
}
