//! Mohr-Coulomb plasticity: `F = s1 - s3 + (s1 + s3) sin phi - 2 c cos phi <= 0` for the largest
//! and the smallest principal stress s1, s3, tension positive; the flow potential has psi for phi.
//!
//! Return in principal stresses (de Souza Neto, Peric and Owen 2008, section 8.2), with deviators
//! f, g of dF/dsigma, dG/dsigma and the trial stress s, m:
//!
//! ```text
//! d_gamma = (f . s + 2 m sin phi - 2 c cos phi) / (2 mu f . g + 4 K sin phi sin psi)
//! s -= 2 mu d_gamma g        m -= 2 K sin psi d_gamma
//! ```
//!
//! Where that would reverse the order of two principal stresses, the two planes that meet there flow until
//! these stresses are equal. This return to the edge has s, f and g averaged over the two. Where it passes
//! the apex, s = 0 and m = c cot phi, which also limits tension at psi = 0. With phi = 0 the law is that of
//! Tresca, c is the undrained strength, and there is no apex. At a given mean stress the return has K = 0
//! here, and the plastic volumetric strain is `2 sin psi d_gamma`.
//! Dilatancy ends at a plastic volumetric strain of `eps_v_max`.

use std::sync::Arc;

use super::{Elastic, Friction, Law, LinearElastic, Maker, ROUND_OFF, SOFT};
use crate::error::Result;
use crate::space::COMPONENTS;
use crate::tensor::{
    deviatoric_stiffness, AtMean, Moduli, Principal, Strain, Stress, Sym, Tangent,
};

pub(super) const MAKER: Maker = Maker {
    name: "mohr_coulomb",
    parameters: Friction::PARAMETERS,
    make: |elastic, given| Ok(Arc::new(MohrCoulomb::new(elastic, Friction::of(given))?)),
};

/// Mohr-Coulomb plasticity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MohrCoulomb {
    elastic: LinearElastic,
    sin_phi: f64,
    sin_psi: f64,
    /// c cos phi.
    strength: f64,
    eps_v_max: f64,
}

/// Principal values, the largest first.
type Sorted = [f64; 3];

/// Two principal stresses that stay equal: an edge of the pyramid.
type Edge = Option<[usize; 2]>;

/// Return of a trial stress to a plane or an edge.
struct Return {
    edge: Edge,
    /// Deviators of dF/dsigma and dG/dsigma, averaged over the planes that flow.
    f: Sorted,
    g: Sorted,
    sin_psi: f64,
    /// - dF / d d_gamma.
    stiffness: f64,
    /// F of the trial stress, averaged over these planes.
    excess: f64,
    /// d_gamma.
    gamma: f64,
}

/// A return with its result.
struct Flow {
    path: Return,
    /// Principal values of the deviator.
    deviator: Sorted,
    /// Difference of the largest and smallest principal plastic strain.
    shear: f64,
    /// Plastic volumetric strain.
    dilation: f64,
}

/// A trial deviator by its principal values in order.
struct InOrder {
    principal: Principal,
    s: Sorted,
    /// Places of the two values in the plane and of zz among them.
    place: [usize; 3],
}

impl InOrder {
    fn of(deviator: &Sym) -> Self {
        let principal = Principal::of_stress(deviator);
        let [first, second, zz] = principal.values;
        let place = [usize::from(zz > first), 1 + usize::from(zz > second)];
        let place = [place[0], place[1], 3 - place[0] - place[1]];
        let mut s = [0.0; 3];
        place.iter().zip(principal.values).for_each(|(&i, value)| s[i] = value);
        Self { principal, s, place }
    }

    /// Values in order as a stress.
    fn stress(&self, values: &Sorted) -> Sym {
        self.principal.stress(&self.place.map(|i| values[i]))
    }

    /// The tangent of a deviator from its derivatives with respect to the principal strains in order.
    fn tangent(&self, deviator: &Sorted, moduli: &[Sorted; 3], double_mu: f64) -> Tangent {
        let [first, second, _] = self.principal.values;
        let difference = first - second;
        let ratio = (deviator[self.place[0]] - deviator[self.place[1]]) / difference;
        // equal trial values that yield lie on an edge and stay equal
        let ratio = if difference > 0.0 { ratio.clamp(0.0, 1.0) } else { 0.0 };
        let of_pair = self.place.map(|i| self.place.map(|j| moduli[i][j]));
        self.principal.tangent(&of_pair, double_mu * ratio)
    }
}

fn averaged(values: &Sorted, edge: Edge) -> Sorted {
    let mut result = *values;
    if let Some([i, j]) = edge {
        (result[i], result[j]) = (0.5 * (values[i] + values[j]), 0.5 * (values[i] + values[j]));
    }
    result
}

fn dot(a: &Sorted, b: &Sorted) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum()
}

/// Deviator of the derivative of `s1 - s3 + (s1 + s3) sin`.
fn gradient(sin: f64, edge: Edge) -> Sorted {
    averaged(&[1.0 + sin / 3.0, -2.0 * sin / 3.0, sin / 3.0 - 1.0], edge)
}

impl MohrCoulomb {
    /// From the elastic law and the angles.
    ///
    /// # Errors
    /// [`crate::error::Error::Parameter`] naming the parameter that is out of range.
    pub fn new(elastic: LinearElastic, friction: Friction) -> Result<Self> {
        friction.check()?;
        let (phi, psi) = (friction.phi.to_radians(), friction.psi.to_radians());
        Ok(Self {
            elastic,
            sin_phi: phi.sin(),
            sin_psi: psi.sin(),
            strength: friction.c * phi.cos(),
            eps_v_max: friction.eps_v_max,
        })
    }

    /// Return along the flow of one plane, or of the two that meet in an edge. `bulk` is K where the strain
    /// is given, and 0 where the mean stress is.
    fn along(&self, s: &Sorted, mean: f64, bulk: f64, sin_psi: f64, edge: Edge) -> Return {
        let (f, g) = (gradient(self.sin_phi, edge), gradient(sin_psi, edge));
        let stiffness =
            2.0 * self.shear_modulus() * dot(&f, &g) + 4.0 * bulk * self.sin_phi * sin_psi;
        let excess = dot(&f, s) + 2.0 * (self.sin_phi * mean - self.strength);
        Return { edge, f, g, sin_psi, stiffness, excess, gamma: excess / stiffness }
    }

    /// Return to the plane, or to the edge that is crossed before the plane is reached.
    fn return_of(&self, s: &Sorted, mean: f64, bulk: f64, sin_psi: f64) -> Return {
        let plane = self.along(s, mean, bulk, sin_psi, None);
        let fall = 2.0 * self.shear_modulus() * plane.gamma;
        let (upper, lower) = (s[0] - s[1], s[1] - s[2]);
        if upper >= fall * (1.0 + sin_psi) && lower >= fall * (1.0 - sin_psi) {
            return plane;
        }
        let upper_first = upper * (1.0 - sin_psi) < lower * (1.0 + sin_psi);
        let edge = if upper_first { [0, 1] } else { [1, 2] };
        self.along(s, mean, bulk, sin_psi, Some(edge))
    }

    /// Return of a trial stress beyond the surface, with at most `left` of dilatancy.
    fn flow(&self, sorted: &InOrder, mean: f64, bulk: f64, left: f64) -> Option<Flow> {
        let s = &sorted.s;
        let beyond = self.along(s, mean, bulk, self.sin_psi, None).excess;
        if beyond <= ROUND_OFF * (s[0] - s[2] + mean.abs()) {
            return None;
        }
        let mut path = self.return_of(s, mean, bulk, self.sin_psi);
        let mut dilation = 2.0 * self.sin_psi * path.gamma;
        if dilation > left {
            // the rest of the dilatancy, then flow at constant volume
            dilation = left;
            path = self.return_of(s, mean - bulk * left, bulk, 0.0);
        }
        let (deviator, shear) = self.returned(s, &path);
        Some(Flow { path, deviator, shear, dilation })
    }

    /// Deviator after the return; difference of the largest and smallest principal plastic strain.
    fn returned(&self, s: &Sorted, path: &Return) -> (Sorted, f64) {
        let double = 2.0 * self.shear_modulus();
        let start = averaged(s, path.edge);
        let shear =
            (s[0] - start[0] + start[2] - s[2]) / double + path.gamma * (path.g[0] - path.g[2]);
        (std::array::from_fn(|i| start[i] - double * path.gamma * path.g[i]), shear)
    }

    /// d s_i / d e_j of the principal values.
    fn moduli(&self, path: &Return) -> [Sorted; 3] {
        let double = 2.0 * self.shear_modulus();
        std::array::from_fn(|i| {
            let mut unit = [0.0; 3];
            unit[i] = double;
            let start = averaged(&unit, path.edge);
            let along = double * double * path.g[i] / path.stiffness;
            std::array::from_fn(|j| start[j] - along * path.f[j])
        })
    }
}

impl Elastic for MohrCoulomb {
    fn linear(&self) -> &LinearElastic {
        &self.elastic
    }
}

impl Law for MohrCoulomb {
    fn name(&self) -> &'static str {
        MAKER.name
    }

    fn pressure_dependent(&self) -> bool {
        self.sin_phi > 0.0
    }

    fn history(&self) -> &'static [&'static str] {
        &["plastic_strain", "dilatancy"]
    }

    fn respond(
        &self,
        increment: &Strain,
        old: &Stress,
        history: &[f64],
        new: &mut [f64],
    ) -> (Stress, Moduli) {
        let (trial, moduli) = self.elastic.respond(increment, old, &[], &mut []);
        new.copy_from_slice(history);
        let (double, bulk) = (2.0 * self.shear_modulus(), self.bulk_modulus());
        let sorted = InOrder::of(&trial.deviator);
        let left = (self.eps_v_max - history[1]).max(0.0);
        let Some(flow) = self.flow(&sorted, trial.mean, bulk, left) else {
            return (trial, moduli);
        };
        let Flow { path, deviator, shear, dilation } = flow;
        let mean = trial.mean - bulk * dilation;
        if self.sin_phi * mean >= self.strength {
            // the apex; here sin phi > 0, since phi = 0 has a positive strength
            new[0] += (sorted.s[0] - sorted.s[2]) / double;
            let apex = Stress { mean: self.strength / self.sin_phi, ..Stress::default() };
            return (apex, Moduli::default());
        }
        new[0] += shear;
        new[1] += dilation;
        let cross = double * bulk / path.stiffness;
        let moduli = Moduli {
            dev_dev: sorted.tangent(&deviator, &self.moduli(&path), double),
            dev_vol: sorted.stress(&path.g).map(|g| -2.0 * self.sin_phi * cross * g),
            mean_dev: sorted.stress(&path.f).map(|f| -2.0 * path.sin_psi * cross * f),
            mean_vol: cross * dot(&path.f, &path.g),
        };
        (Stress { deviator: sorted.stress(&deviator), mean }, moduli)
    }

    fn respond_at_mean(
        &self,
        increment: &Sym,
        old: &Sym,
        mean: f64,
        history: &[f64],
        new: &mut [f64],
    ) -> AtMean {
        let mu = self.shear_modulus();
        let elastic = deviatoric_stiffness(mu);
        let trial: Sym = std::array::from_fn(|i| old[i] + elastic[i] * increment[i]);
        new.copy_from_slice(history);
        // infinite where phi = 0
        let apex = self.strength / self.sin_phi;
        let sorted = InOrder::of(&trial);
        let left = (self.eps_v_max - history[1]).max(0.0);
        let flow = self.flow(&sorted, mean.min(apex), 0.0, left);
        let mut answer = AtMean::default();
        if let Some(Flow { path, shear, dilation, .. }) = &flow {
            new[0] += shear;
            new[1] += dilation;
            let along = 4.0 * mu * path.sin_psi / path.stiffness;
            answer.plastic_volume = *dilation;
            answer.volume_dev = sorted.stress(&path.f).map(|f| along * f);
        }
        if mean >= apex {
            answer.plastic_volume += (mean - apex) / (SOFT * mu);
            answer.volume_mean = 1.0 / (SOFT * mu);
            return answer;
        }
        let Some(Flow { path, deviator, .. }) = flow else {
            answer.deviator = trial;
            (0..COMPONENTS).for_each(|i| answer.dev_dev[i][i] = elastic[i]);
            return answer;
        };
        let cross = 4.0 * self.sin_phi / path.stiffness;
        AtMean {
            deviator: sorted.stress(&deviator),
            dev_dev: sorted.tangent(&deviator, &self.moduli(&path), 2.0 * mu),
            dev_mean: sorted.stress(&path.g).map(|g| -mu * cross * g),
            volume_mean: cross * path.sin_psi,
            ..answer
        }
    }
}
