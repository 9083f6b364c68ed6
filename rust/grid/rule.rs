//! Quadrature rules on the interval and the Lagrange polynomials of their points.

/// Largest number of points per axis of a rule whose points carry particle data.
pub const MAX_POINTS: usize = 8;

/// One-dimensional quadrature rule on [0, 1] with the data of its Lagrange polynomials.
#[derive(Debug, Clone)]
pub struct Rule {
    /// Points, ascending.
    pub points: Vec<f64>,
    /// Weights; they sum to 1.
    pub weights: Vec<f64>,
    /// `1 / prod_{j != i} (x_i - x_j)`.
    barycentric: Vec<f64>,
}

impl Rule {
    /// The Gauss-Legendre rule with `n` points, exact for polynomials of degree 2n - 1.
    ///
    /// Points are the roots of the Legendre polynomial P_n, found by Newton's method from
    /// Tricomi's estimate; weights are 2 / ((1 - x^2) P_n'(x)^2) on [-1, 1].
    #[must_use]
    pub fn gauss(n: usize) -> Self {
        let mut points = Vec::with_capacity(n);
        let mut weights = Vec::with_capacity(n);
        for i in (0..n).rev() {
            let mut x = (std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            for _ in 0..20 {
                let (p, dp) = legendre(n, x);
                x -= p / dp;
            }
            let (_, dp) = legendre(n, x);
            points.push(0.5 * (1.0 + x));
            weights.push(1.0 / ((1.0 - x * x) * dp * dp));
        }
        let barycentric = (0..n)
            .map(|i| {
                let others = (0..n).filter(|&j| j != i);
                1.0 / others.map(|j| points[i] - points[j]).product::<f64>()
            })
            .collect();
        Self { points, weights, barycentric }
    }

    /// The trapezoidal rule: both ends, with half the length each. Products of its polynomials are the
    /// bilinear functions.
    #[must_use]
    pub fn ends() -> Self {
        Self { points: vec![0.0, 1.0], weights: vec![0.5, 0.5], barycentric: vec![-1.0, 1.0] }
    }

    /// Values at `t` of the Lagrange polynomials of the points, into `l`.
    pub fn lagrange(&self, t: f64, l: &mut [f64]) {
        for (i, li) in l.iter_mut().enumerate() {
            *li = self.barycentric[i];
            for (j, xj) in self.points.iter().enumerate() {
                if j != i {
                    *li *= t - xj;
                }
            }
        }
    }
}

/// Legendre polynomial P_n and its derivative at `x`.
fn legendre(n: usize, x: f64) -> (f64, f64) {
    let (mut p, mut q) = (1.0, 0.0);
    for k in 0..n {
        let k = k as f64;
        (p, q) = (((2.0 * k + 1.0) * x * p - k * q) / (k + 1.0), p);
    }
    (p, n as f64 * (x * p - q) / (x * x - 1.0))
}
