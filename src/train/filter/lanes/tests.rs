//! Chunks of every form beside plain loops.

use super::*;

struct CountUpTo<T: Real> {
    chunk: T::Chunk,
    x: T,
}

impl<T: Real> Kernel<T> for CountUpTo<T> {
    type Out = usize;

    #[inline(always)]
    fn run<V: Simd<T>>(self) -> usize {
        V::load(&self.chunk).count_up_to(self.x)
    }
}

fn counts_as_told<T: Real>() {
    // 0, 0, 1, 1, 2, 2 and so on in the first lanes, infinity in the others.
    for full in 0..=T::LANES {
        let mut chunk = T::Chunk::default();
        for (lane, own) in chunk.as_mut().iter_mut().enumerate() {
            *own = T::of(if lane < full { (lane / 2) as f64 } else { f64::INFINITY });
        }
        for x in [-1.0, -0.0, 0.0, 0.5, 1.0, 2.0, 3.0, 7.0, 1e30, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
            let expected = chunk.as_ref().iter().filter(|own| own.f64() <= x).count();
            for isa in Isa::available() {
                assert_eq!(isa.run(CountUpTo { chunk, x: T::of(x) }), expected, "{isa:?} {full} {x}");
            }
        }
    }
}

#[test]
fn exact_lanes_that_rise_are_counted_alike_in_all_forms() {
    counts_as_told::<f32>();
    counts_as_told::<f64>();
}
