//! The extended Kalman filter as a textbook prints it: P <- P - K (b'P) in f32, nothing symmetric, nothing guarded.

use marsyard::train::Network;

pub struct Textbook {
    /// Row-major.
    pub covariance: Vec<f32>,
    q: f32,
    gradient: Vec<f64>,
}

impl Textbook {
    pub fn new(weights: usize, p0: f64, q: f64) -> Textbook {
        let mut covariance = vec![0.0; weights * weights];
        covariance.iter_mut().step_by(weights + 1).for_each(|p| *p = p0 as f32);
        Textbook { covariance, q: q as f32, gradient: vec![0.0; weights] }
    }

    /// One row; false where S fell below R or a weight is no number.
    pub fn learn(&mut self, network: &mut Network, inputs: &[f64], target: f64, r: f64) -> bool {
        let size = self.gradient.len();
        let output = network.gradient(inputs, &mut Default::default(), &mut self.gradient);
        let b: Vec<f32> = self.gradient.iter().map(|g| *g as f32).collect();
        let (mut pb, mut bp) = (Vec::with_capacity(size), vec![0.0_f32; size]);
        for (row, &bi) in self.covariance.chunks_exact(size).zip(&b) {
            pb.push(dot(row, &b));
            bp.iter_mut().zip(row).for_each(|(sum, p)| *sum += bi * p);
        }
        let s = dot(&b, &pb) + r as f32;
        let gain: Vec<f32> = pb.iter().map(|v| v / s).collect();
        for (i, (row, k)) in self.covariance.chunks_exact_mut(size).zip(&gain).enumerate() {
            row.iter_mut().zip(&bp).for_each(|(p, v)| *p -= k * v);
            row[i] += self.q;
        }
        let innovation = (target - output) as f32;
        network.weights.iter_mut().zip(&gain).for_each(|(w, k)| *w += f64::from(k * innovation));
        s >= r as f32 && network.weights.iter().all(|w| w.is_finite())
    }
}

/// In eight lanes, so that it runs at the machine's speed.
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut lanes = [0.0_f32; 8];
    for (a, b) in a.chunks(8).zip(b.chunks(8)) {
        lanes.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
    }
    lanes.iter().sum()
}
