//! Requested quantities at finite strain.

use super::request::{Operator, Part, Request};
use super::stage::Scalar;
use crate::space::{COMPONENTS, DIM, GRADIENT};
use crate::tensor::hencky::Trial;
use crate::tensor::{Matrix, Moduli, Stress};

/// Unit change of the k-th component of grad u.
fn unit(k: usize) -> Matrix {
    let mut unit = [[0.0; DIM]; DIM];
    unit[k / DIM][k % DIM] = 1.0;
    unit
}

/// Write the requested quantity from its first column on. The volume follows ln J_f, or has a field of its
/// `own`. `scalar` is the plastic volume or the history variable.
pub(super) fn write(
    request: &Request,
    trial: &Trial,
    own: bool,
    tau: &Stress,
    c: &Moduli,
    scalar: &Scalar,
    out: &mut [f64],
) {
    let (mut tau, mut c) = (*tau, *c);
    if request.operator == Operator::NominalDeviator {
        (tau.mean, c.mean_dev, c.mean_vol) = (0.0, [0.0; COMPONENTS], 0.0);
    }
    match (request.operator, request.part) {
        (Operator::Nominal | Operator::NominalDeviator, Part::Value) => {
            out.copy_from_slice(&trial.nominal(&tau));
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Volume) => {
            let change = Stress { deviator: c.dev_vol, mean: c.mean_vol };
            out.copy_from_slice(&trial.nominal(&change));
        }
        (Operator::Nominal | Operator::NominalDeviator, Part::Gradient) => {
            for k in 0..GRADIENT {
                let dg = unit(k);
                let dv = if own { 0.0 } else { trial.volume_change(&dg) };
                let change = trial.nominal_change(&tau, &c, &dg, dv);
                (0..GRADIENT).for_each(|i| out[GRADIENT * i + k] = change[i]);
            }
        }
        (Operator::MeanKirchhoff, Part::Value) => out[0] = tau.mean,
        (Operator::MeanKirchhoff, Part::Volume) => out[0] = c.mean_vol,
        (Operator::MeanKirchhoff, Part::Gradient) => {
            (0..GRADIENT).for_each(|k| out[k] = trial.change(&c.mean_dev, &unit(k)));
        }
        (Operator::PlasticVolume | Operator::History(_), Part::Value) => out[0] = scalar.value,
        (Operator::PlasticVolume | Operator::History(_), Part::Volume) => out[0] = scalar.field,
        (Operator::PlasticVolume | Operator::History(_), Part::Gradient) => {
            for (k, o) in out.iter_mut().enumerate() {
                let dv = if own { 0.0 } else { trial.volume_change(&unit(k)) };
                *o = trial.change(&scalar.deviator, &unit(k)) + scalar.field * dv;
            }
        }
        (Operator::LnJ, Part::Value) => out[0] = trial.ln_j,
        (Operator::LnJ, Part::Volume) => out[0] = 0.0,
        (Operator::LnJ, Part::Gradient) => out.copy_from_slice(&trial.ln_j_gradient()),
        _ => {}
    }
}
