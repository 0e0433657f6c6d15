//! A model -> plain JSON: its metadata, its weights as rows, and rows to check any other program against.
//!
//! `members`: one network each, layer by layer from the input on: `weights` has one row a neuron with one number an input, `biases` one
//! number a neuron. To apply it to a row of features:
//!
//! 1. Of each feature the one that `minus` names is subtracted, where it names one: x.
//! 2. The inputs are (x - mean) / scale of each feature, clipped to +-clip.
//! 3. Where the scaler has `scores`, as many inputs follow: of each feature its x, unscaled, in proportion between two values of `at` gives a number
//!    between their `score`; beyond the outermost it is theirs, and where there is `unseen`, an x of exactly 0 has that.
//! 4. For each layer of a member 1 / (1 + exp(-(weights x + biases))); where `about.activation` is `relu`, or `both` and the member the second,
//!    the fourth and so on, max(0, weights x + biases) for each layer but the last. The output is the mean of the members'.
//! 5. Where the model has a calibration, q = (output - t0) / (t1 - t0) by its targets, kept within [e, 1 - e], e its `edge` or 0.01, gives the probability
//!    1 / (1 + exp(-(slope ln(q / (1 - q)) + offset))).

use serde::Serialize;

use super::Model;
use super::Network;
use super::model::About;
use super::network::LayerOf;

/// The JSON file.
#[derive(Debug, Serialize)]
struct Export<'a> {
    about: &'a About,
    members: Vec<Vec<Layer<'a>>>,
    check: Check,
}

#[derive(Debug, Serialize)]
struct Layer<'a> {
    weights: Vec<&'a [f64]>,
    biases: Vec<f64>,
}

/// Rows over the whole range that was trained on, and beyond it, with the outputs that marsyard computes.
#[derive(Debug, Serialize)]
struct Check {
    /// Each the exact value of a float, as a column would hold it.
    features: Vec<Vec<f64>>,
    outputs: Vec<f64>,
    /// That the row is untraversable; null where the model has no calibration.
    probabilities: Vec<Option<f64>>,
}

/// Rows of the check besides the seven that hold one quantile in all features.
const MIXED_ROWS: u32 = 249;

/// Whether a file is one that [`json`] wrote: an object of its three parts, about such a model.
pub(crate) fn is_ours(bytes: &[u8]) -> bool {
    let value: serde_json::Value = serde_json::from_slice(bytes).unwrap_or_default();
    // Up to format 3 of a model there was one network, and `layers` were its.
    let has_network = value["members"].is_array() || value["layers"].is_array();
    value["about"]["marsyard_model"].is_number() && has_network && value["check"]["outputs"].is_array()
}

/// The model as JSON text.
pub(crate) fn json<'a>(model: &'a Model) -> String {
    let Network { layout, weights } = &model.network;
    let layer = |layer: LayerOf<'a>| {
        let (weights, biases) = layer.rows().unzip();
        Layer { weights, biases }
    };
    let members = layout.split(weights).into_iter().map(|layers| layers.into_iter().map(layer).collect()).collect();
    let rows = check_rows(model);
    let outputs: Vec<f64> = rows.iter().map(|row| model.output(row)).collect();
    let probabilities = outputs.iter().map(|output| model.probability(*output)).collect();
    let features = rows.iter().map(|row| row.iter().map(|&x| f64::from(x)).collect()).collect();
    let export = Export { about: &model.about, members, check: Check { features, outputs, probabilities } };
    serde_json::to_string(&export).expect("a model is plain data") + "\n"
}

/// One quantile in all features; then each feature at a place of its own between its quantiles, every eighth row ten times as far
/// out, where inputs are clipped, every fifth with neighbours without points.
fn check_rows(model: &Model) -> Vec<Vec<f32>> {
    let (quantiles, minus) = (&model.about.quantiles, &model.about.scaler.minus);
    let equal = (0..7).map(|k| quantiles.iter().map(|q| q[k] as f32).collect());
    let mixed = (1..=MIXED_ROWS).map(|row| {
        let feature = |(k, q): (usize, &[f64; 7])| {
            // Weyl's sequence with another irrational step a feature.
            let place = 6.0 * (f64::from(row) * (2.0 + k as f64).sqrt() * 0.618_033_988_749_894_9).fract();
            let below = (place as usize).min(5);
            let value = q[below] + (q[below + 1] - q[below]) * (place - below as f64);
            (if row % 8 == 0 { 10.0 * value } else { value }) as f32
        };
        let mut features: Vec<f32> = quantiles.iter().enumerate().map(feature).collect();
        if row % 5 == 0 {
            // They stand at the cell's own height.
            let standing = minus.iter().enumerate().filter_map(|(k, other)| other.map(|other| (k, other)));
            standing.for_each(|(k, other)| features[k] = features[other]);
        }
        features
    });
    equal.chain(mixed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math;
    use crate::train::Activation;
    use crate::train::model::tests::{ensemble, model, scored, with_neurons};

    /// Between knots in proportion, beyond them the outermost.
    fn between(knots: &[(f64, f64)], x: f64) -> f64 {
        let pair = knots.windows(2).find(|pair| x <= pair[1].0);
        let (first, last) = (knots[0], knots[knots.len() - 1]);
        match pair {
            _ if x <= first.0 => first.1,
            Some([(a, low), (b, high)]) => low + (high - low) * (x - a) / (b - a),
            _ => last.1,
        }
    }

    #[test]
    fn equal_the_json_applied_as_its_documentation_says_and_the_model() {
        let features = ["a", "b", "c"];
        let plain = [(1, true), (1, false), (3, true)].map(|(n, bias)| ensemble(n, &features, &[4, 2], bias));
        let scored = scored(2, &features, &[4, 2], true);
        let rectified = [Activation::Relu, Activation::Both].map(|activation| with_neurons(activation, scored.clone()));
        for (number, mut model) in plain.into_iter().chain([scored]).chain(rectified).enumerate() {
            model.about.calibration.as_mut().unwrap().edge = [0.01, 1e-4][number % 2];
            let value: serde_json::Value = serde_json::from_str(&json(&model)).unwrap();
            let numbers = |v: &serde_json::Value| -> Vec<f64> {
                v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
            };
            let scaler = &value["about"]["scaler"];
            let (mean, scale) = (numbers(&scaler["mean"]), numbers(&scaler["scale"]));
            let clip = scaler["clip"].as_f64().unwrap();
            let rows = value["check"]["features"].as_array().unwrap();
            let outputs = numbers(&value["check"]["outputs"]);
            let probabilities = numbers(&value["check"]["probabilities"]);
            assert_eq!(rows.len(), 7 + MIXED_ROWS as usize);
            for ((row, output), probability) in rows.iter().zip(outputs).zip(probabilities) {
                let row = numbers(row);
                let mut x = row.clone();
                for k in 0..3 {
                    let minus = scaler["minus"][k].as_u64().map_or(0.0, |other| row[other as usize]);
                    let value = x[k] - minus;
                    x[k] = ((value - mean[k]) / scale[k]).clamp(-clip, clip);
                    if let Some(scores) = scaler["scores"].get(k) {
                        let knots: Vec<_> = numbers(&scores["at"]).into_iter().zip(numbers(&scores["score"])).collect();
                        let unseen = scores["unseen"].as_f64().filter(|_| value == 0.0);
                        x.push(unseen.unwrap_or_else(|| between(&knots, value)));
                    }
                }
                let activation = value["about"]["activation"].as_str();
                let of_member = |(member, layers): (usize, &serde_json::Value)| {
                    let is_rectified = activation == Some("relu") || activation == Some("both") && member % 2 == 1;
                    let mut x = x.clone();
                    let layers = layers.as_array().unwrap();
                    for (number, layer) in layers.iter().enumerate() {
                        let sums = layer["weights"].as_array().unwrap().iter().zip(numbers(&layer["biases"]));
                        let neuron = |(w, bias): (&serde_json::Value, f64)| {
                            let sum: f64 = numbers(w).iter().zip(&x).map(|(w, x)| w * x).sum::<f64>() + bias;
                            let logistic = 1.0 / (1.0 + math::exp(-sum));
                            if is_rectified && number + 1 < layers.len() { sum.max(0.0) } else { logistic }
                        };
                        x = sums.map(neuron).collect();
                    }
                    x[0]
                };
                let of_members: Vec<f64> =
                    value["members"].as_array().unwrap().iter().enumerate().map(of_member).collect();
                assert_eq!(of_members.len(), model.about.members);
                let mean = of_members.iter().sum::<f64>() / of_members.len() as f64;
                assert!((mean - output).abs() < 1e-14, "{mean} {output}");
                let (about, [low, high]) = (&value["about"]["calibration"], model.about.targets);
                assert_eq!(about["edge"].is_null(), number % 2 == 0);
                let edge = about["edge"].as_f64().unwrap_or(0.01);
                let share = ((output - low) / (high - low)).clamp(edge, 1.0 - edge);
                let [slope, offset] = ["slope", "offset"].map(|name| about[name].as_f64().unwrap());
                let logit = slope * math::ln(share / (1.0 - share)) + offset;
                assert!((1.0 / (1.0 + math::exp(-logit)) - probability).abs() < 1e-14, "{probability}");
            }
        }
    }

    #[test]
    fn exact_mixed_rows_stand_at_weyls_places_every_eighth_ten_times_as_far_and_every_fifth_without_neighbours() {
        let mut model = model(&["a", "b", "c"], &[4], true);
        // Between these quantiles a value is its place.
        model.about.quantiles = vec![[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]; 3];
        let rows = check_rows(&model);
        for (row, values) in rows[7..].iter().enumerate() {
            for (k, value) in values.iter().enumerate() {
                // The third feature is a neighbour of the first.
                let k = if k == 2 && (row + 1) % 5 == 0 { 0 } else { k };
                let turns = (row as f64 + 1.0) * (k as f64 + 2.0).sqrt() * (5f64.sqrt() - 1.0) / 2.0;
                let place = 6.0 * (turns - turns.floor()) * if (row + 1) % 8 == 0 { 10.0 } else { 1.0 };
                assert!((f64::from(*value) - place).abs() < 1e-4, "row {row}, feature {k}: {value} {place}");
            }
        }
        // Far rows lie beyond the quantiles, else no input would be clipped.
        assert!(rows.iter().flatten().any(|&value| value > 30.0));
    }
}
