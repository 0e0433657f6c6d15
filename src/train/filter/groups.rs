//! Layer sizes -> groups of weights that share a covariance.

use crate::train::Layout;
use crate::train::params::Groups;

/// The weights of each group, ascending; each weight is in one group. Biases leave a node of their own, one a layer.
pub(super) fn groups(layout: &Layout, by: Groups) -> Vec<Vec<u32>> {
    let mut groups = Vec::new();
    let mut first = 0;
    let all = layout.weights() as u32;
    match by {
        Groups::One => groups.push((0..all).collect()),
        Groups::Weight => groups.extend((0..all).map(|w| vec![w])),
        Groups::Layer | Groups::Node | Groups::InputNode => {
            for (inputs, neurons) in layout.layers() {
                let stride = inputs + usize::from(layout.bias);
                let weight = |neuron: usize, input: usize| (first + neuron * stride + input) as u32;
                match by {
                    Groups::InputNode => groups
                        .extend((0..stride).map(|input| (0..neurons).map(|neuron| weight(neuron, input)).collect())),
                    Groups::Node => groups
                        .extend((0..neurons).map(|neuron| (0..stride).map(|input| weight(neuron, input)).collect())),
                    _ => groups.push((0..neurons * stride).map(|w| (first + w) as u32).collect()),
                }
                first += neurons * stride;
            }
        }
    }
    groups
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Activation;

    #[test]
    fn exact_groups_of_a_small_network() {
        let layout = Layout { inputs: 2, hidden: vec![2], bias: true, members: 1, activation: Activation::Logistic };
        assert_eq!(groups(&layout, Groups::Node), [vec![0, 1, 2], vec![3, 4, 5], vec![6, 7, 8]]);
        let by_input = groups(&layout, Groups::InputNode);
        assert_eq!(by_input, [vec![0, 3], vec![1, 4], vec![2, 5], vec![6], vec![7], vec![8]]);
        assert_eq!(groups(&layout, Groups::Layer), [vec![0, 1, 2, 3, 4, 5], vec![6, 7, 8]]);
    }

    #[test]
    fn law_each_weight_is_in_one_group() {
        for bias in [false, true] {
            let layout = Layout { inputs: 5, hidden: vec![4, 3], bias, members: 1, activation: Activation::Logistic };
            for by in [Groups::One, Groups::Layer, Groups::Node, Groups::InputNode, Groups::Weight] {
                let mut weights = groups(&layout, by).concat();
                weights.sort_unstable();
                assert!(weights.into_iter().eq(0..layout.weights() as u32), "{by:?}");
            }
        }
    }
}
