//! This module computes a network's outputs for many rows at a time, in f64, with a row in each lane.
//!
//! Rows of scaled features go in, row-major. One output a row comes out, the mean of the members, with the same bits as a row has alone.

use super::{Network, Neuron};
use crate::train::filter::lanes::{Kernel, Real, Simd};

pub(super) struct NetworkBatch<'a> {
    pub network: &'a Network,
    pub rows: &'a [f64],
    pub outputs: &'a mut [f64],
}

impl Kernel<f64> for NetworkBatch<'_> {
    type Out = ();

    /// Rows stand in the lanes.
    #[inline(always)]
    fn run<V: Simd<f64>>(self) {
        type Lane = <f64 as Real>::Chunk;
        let NetworkBatch { network: Network { layout, weights }, rows, outputs } = self;
        let widest = layout.hidden.iter().copied().max().unwrap_or(0).max(layout.inputs).max(1);
        let [mut inputs, mut values, mut next] = [(); 3].map(|()| vec![Lane::default(); widest]);
        for (rows, outputs) in rows.chunks(f64::LANES * layout.inputs.max(1)).zip(outputs.chunks_mut(f64::LANES)) {
            for (lane, row) in rows.chunks_exact(layout.inputs.max(1)).enumerate() {
                for (value, x) in inputs.iter_mut().zip(row) {
                    value.as_mut()[lane] = *x;
                }
            }
            let mut sums = Lane::default();
            let mut rest = &weights[..];
            for member in 0..layout.members {
                for (layer, ((count, neurons), neuron)) in layout.layers().zip(layout.neurons(member)).enumerate() {
                    let before = if layer == 0 { &inputs[..count] } else { &values[..count] };
                    let stride = count + usize::from(layout.bias);
                    let (own, others) = rest.split_at(stride * neurons);
                    let several = ABREAST * (neurons / ABREAST);
                    let (together, alone) = next[..neurons].split_at_mut(several);
                    for (k, out) in together.as_chunks_mut::<ABREAST>().0.iter_mut().enumerate() {
                        abreast::<V, ABREAST>(&own[k * ABREAST * stride..], before, (layout.bias, neuron), out);
                    }
                    for (k, out) in alone.as_chunks_mut::<1>().0.iter_mut().enumerate() {
                        abreast::<V, 1>(&own[(several + k) * stride..], before, (layout.bias, neuron), out);
                    }
                    rest = others;
                    std::mem::swap(&mut values, &mut next);
                }
                sums.as_mut().iter_mut().zip(values[0].as_ref()).for_each(|(sum, output)| *sum += output);
            }
            outputs.iter_mut().zip(sums.as_ref()).for_each(|(mean, sum)| *mean = sum / layout.members as f64);
        }
    }
}

/// Neurons whose sums run side by side where rows stand in the lanes: each is a chain, and waits for itself.
const ABREAST: usize = 8;

/// `N` neurons, whose weights follow one another in `weights`, on the values of the layer before, a row in each lane.
#[inline(always)]
fn abreast<V: Simd<f64>, const N: usize>(
    weights: &[f64],
    before: &[<f64 as Real>::Chunk],
    (bias, neuron): (bool, Neuron),
    out: &mut [<f64 as Real>::Chunk; N],
) {
    let (count, stride) = (before.len(), before.len() + usize::from(bias));
    let own: [&[f64]; N] = std::array::from_fn(|n| &weights[n * stride..][..stride]);
    let mut sums: [V; N] = std::array::from_fn(|n| V::splat(if bias { own[n][count] } else { 0.0 }));
    for (i, x) in before.iter().enumerate() {
        let x = V::load(x);
        for n in 0..N {
            sums[n] = V::splat(own[n][i]).mul_add(x, sums[n]); // Eq. (2)
        }
    }
    for n in 0..N {
        sums[n].store(&mut out[n]);
        let lanes: &mut [f64; f64::LANES] = out[n].as_mut().try_into().expect("a chunk has its lanes");
        *lanes = neuron.values(lanes);
    }
}
