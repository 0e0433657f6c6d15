//! Which networks are searched: hidden layers as lists of widths.
//!
//! Source: Hewitt et al. 2017, "Results": all networks of one to three hidden layers of up to 32 neurons. A grid over a few widths
//! stands for them unless all are asked for.

use crate::random::{Purpose, Stage, Streams};

/// Neurons of each hidden layer.
pub(crate) type Hidden = Vec<usize>;

/// Most neurons of a layer, and most hidden layers, of the paper's sweep.
pub(crate) const WIDEST: usize = 32;
pub(crate) const DEEPEST: usize = 3;

/// All combinations of the widths in one to `deepest` layers; those of fewer layers first.
pub(crate) fn grid(widths: &[usize], deepest: usize) -> Vec<Hidden> {
    let mut all: Vec<Hidden> = Vec::new();
    let mut layer: Vec<Hidden> = vec![Vec::new()];
    for _ in 0..deepest {
        let wider = |hidden: &Hidden| widths.iter().map(|&width| [&hidden[..], &[width]].concat()).collect::<Vec<_>>();
        layer = layer.iter().flat_map(wider).collect();
        all.extend_from_slice(&layer);
    }
    all
}

/// The paper's 33,824.
pub(crate) fn full() -> Vec<Hidden> {
    grid(&(1..=WIDEST).collect::<Vec<_>>(), DEEPEST)
}

/// A random share of networks: each is taken or not by a number drawn for its place in the list.
pub(crate) fn sample(networks: Vec<Hidden>, share: f64, seed: u64) -> Vec<Hidden> {
    let streams = Streams { seed, scene: 0, attempt: 0, stage: Stage::Train, step: 0 };
    let mut draws = vec![0.0; networks.len()];
    streams.open(Purpose::SearchNetworks).fill_uniform(0, &mut draws);
    networks.into_iter().zip(draws).filter(|(_, draw)| *draw < share).map(|(network, _)| network).collect()
}

/// `16-16`.
pub(crate) fn shown(hidden: &[usize]) -> String {
    hidden.iter().map(usize::to_string).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_the_papers_sweep_has_33824_networks_each_once() {
        let mut all = full();
        assert_eq!(all.len(), 33_824);
        assert_eq!((&all[0][..], &all[33_823][..]), (&[1][..], &[32, 32, 32][..]));
        all.sort();
        all.dedup();
        assert_eq!(all.len(), 33_824);
    }

    #[test]
    fn exact_a_grid_of_six_widths_has_258_networks() {
        let grid = grid(&[2, 4, 8, 16, 24, 32], 3);
        assert_eq!(grid.len(), 6 + 36 + 216);
        assert!(grid.contains(&vec![16, 16]) && grid.contains(&vec![2, 32, 4]));
    }

    #[test]
    fn dist_a_sample_takes_its_share_by_seed() {
        let one = sample(full(), 0.1, 1);
        // 3382 +- 55.
        assert!((3382 - 220..3382 + 220).contains(&one.len()), "{}", one.len());
        assert_eq!(one, sample(full(), 0.1, 1));
        assert_ne!(one, sample(full(), 0.1, 2));
        assert_eq!(sample(full(), 1.0, 1), full());
    }
}
