//! A model -> an ONNX file: raw features in, the output in (0, 1) out, scaling, clipping and normal scores inside the graph.
//!
//! Format: protocol buffers as `onnx.proto` (IR version 8, operator set 13) lays them out; the few messages that a network of this
//! kind needs are written here by hand, field numbers beside them, so that no code generator has to run. Input `features`: float
//! [rows, features], as the columns hold them; output `untraversable`: float [rows, 1], and where the model has a calibration `probability`:
//! float [rows, 1]. In between everything is double, so that the
//! output is marsyard's own to the rounding of a float: a feature with a large mean and a small spread would lose it in float.
//! The model's metadata stand in `metadata_props` under `marsyard`.

use super::network::{LayerOf, Neuron};
use super::{Model, NormalScores};

/// Element types of `TensorProto`.
const FLOAT: u64 = 1;
const DOUBLE: u64 = 11;

/// Whether a file is one that [`onnx`] wrote: it begins with the format's version and `producer_name`.
pub(crate) fn is_ours(bytes: &[u8]) -> bool {
    bytes.get(2..12) == Some(b"\x12\x08marsyard")
}

/// The bytes of the ONNX file.
pub(crate) fn onnx(model: &Model) -> Vec<u8> {
    let mut graph = Graph::default();
    let (about, layout) = (&model.about, &model.network.layout);
    graph.message.text(2, "marsyard");
    let features = about.features.len();
    graph.message.message(11, &tensor_type("features", FLOAT, features));
    graph.message.message(12, &tensor_type("untraversable", FLOAT, 1));
    if about.calibration.is_some() {
        graph.message.message(12, &tensor_type("probability", FLOAT, 1));
    }

    graph.node("Cast", &["features"], "exact", &[("to", DOUBLE)]);
    let relative: Vec<f64> = (0..features)
        .flat_map(|from| about.scaler.minus.iter().enumerate().map(move |(to, minus)| (from, to, *minus)))
        .map(|(from, to, minus)| f64::from(u8::from(from == to)) - f64::from(u8::from(minus == Some(from))))
        .collect();
    graph.tensor("relative", &[features, features], &relative);
    graph.node("MatMul", &["exact", "relative"], "related", &[]);
    graph.tensor("mean", &[features], &about.scaler.mean);
    graph.tensor("scale", &[features], &about.scaler.scale);
    graph.tensor("lowest", &[], &[-about.scaler.clip]);
    graph.tensor("highest", &[], &[about.scaler.clip]);
    graph.node("Sub", &["related", "mean"], "centred", &[]);
    graph.node("Div", &["centred", "scale"], "scaled", &[]);
    graph.node("Clip", &["scaled", "lowest", "highest"], "clipped", &[]);
    graph.inputs(&about.scaler.scores);

    let outputs: Vec<String> = layout
        .split(&model.network.weights)
        .into_iter()
        .enumerate()
        .map(|(member, layers)| {
            let layers = layers.into_iter().zip(layout.neurons(member)).enumerate();
            layers.fold("inputs".to_string(), |before: String, (number, layer)| {
                graph.layer(&before, layer, &format!("{member}.{number}"))
            })
        })
        .collect();
    graph.node("Sum", &outputs.iter().map(String::as_str).collect::<Vec<_>>(), "added", &[]);
    graph.tensor("members", &[], &[layout.members as f64]);
    graph.node("Div", &["added", "members"], "output", &[]);
    graph.node("Cast", &["output"], "untraversable", &[("to", FLOAT)]);
    if let Some(calibration) = &about.calibration {
        let [low, high] = about.targets;
        let numbers = [
            ("target", low),
            ("span", high - low),
            ("edge", calibration.edge),
            ("other_edge", 1.0 - calibration.edge),
            ("one", 1.0),
            ("slope", calibration.slope),
            ("offset", calibration.offset),
        ];
        numbers.iter().for_each(|(name, value)| graph.tensor(name, &[], &[*value]));
        let steps: [(&str, &[&str], &str); 9] = [
            ("Sub", &["output", "target"], "from_target"),
            ("Div", &["from_target", "span"], "between"),
            ("Clip", &["between", "edge", "other_edge"], "share"),
            ("Sub", &["one", "share"], "rest"),
            ("Div", &["share", "rest"], "odds"),
            ("Log", &["odds"], "logit"),
            ("Mul", &["logit", "slope"], "stretched"),
            ("Add", &["stretched", "offset"], "calibrated"),
            ("Sigmoid", &["calibrated"], "chance"),
        ];
        steps.iter().for_each(|(operator, inputs, output)| graph.node(operator, inputs, output, &[]));
        graph.node("Cast", &["chance"], "probability", &[("to", FLOAT)]);
    }

    let mut operators = Message::default();
    operators.text(1, "");
    operators.number(2, 13);
    let mut metadata = Message::default();
    metadata.text(1, "marsyard");
    metadata.text(2, &about.to_json());
    let mut file = Message::default();
    file.number(1, 8);
    file.text(2, "marsyard");
    file.text(3, env!("CARGO_PKG_VERSION"));
    file.message(7, &graph.message);
    file.message(8, &operators);
    file.message(14, &metadata);
    file.bytes
}

/// `GraphProto` in the making: nodes (1), initializers (5).
#[derive(Default)]
struct Graph {
    message: Message,
}

impl Graph {
    /// `NodeProto`: inputs (1), outputs (2), name (3), operator (4), whole-number attributes (5).
    fn node(&mut self, operator: &str, inputs: &[&str], output: &str, attributes: &[(&str, u64)]) {
        self.node_of_many(operator, inputs, &[output], attributes);
    }

    /// The same with several outputs; named by the first.
    fn node_of_many(&mut self, operator: &str, inputs: &[&str], outputs: &[&str], attributes: &[(&str, u64)]) {
        let mut node = Message::default();
        inputs.iter().for_each(|input| node.text(1, input));
        outputs.iter().for_each(|output| node.text(2, output));
        node.text(3, outputs[0]);
        node.text(4, operator);
        for (name, value) in attributes {
            // `AttributeProto`: name (1), whole number (3), type (20) INT.
            let mut attribute = Message::default();
            attribute.text(1, name);
            attribute.number(3, *value);
            attribute.number(20, 2);
            node.message(5, &attribute);
        }
        self.message.message(1, &node);
    }

    /// What the network takes: `clipped`, and behind it the normal scores of `related` where there are any. A score is that of the first knot and,
    /// for each part between two, how far the value has come in it times its slope; that of 0 may be another.
    fn inputs(&mut self, scores: &[NormalScores]) {
        if scores.is_empty() {
            return self.node("Identity", &["clipped"], "inputs", &[]);
        }
        let names = |what: &str| (0..scores.len()).map(|feature| format!("{what}.{feature}")).collect::<Vec<String>>();
        let (values, found) = (names("value"), names("score"));
        let all: Vec<&str> = values.iter().map(String::as_str).collect();
        self.node_of_many("Split", &["related"], &all, &[("axis", 1)]);
        if scores.iter().any(|scores| scores.unseen.is_some()) {
            self.tensor("nought", &[], &[0.0]);
        }
        for (feature, NormalScores { at, score, unseen }) in scores.iter().enumerate() {
            let named = |what: &str| format!("{what}.{feature}");
            let slope = |k: usize| (score[k + 1] - score[k]) / (at[k + 1] - at[k]);
            // A feature that never varied has one knot, which bounds a part of no width.
            let parts = (at.len() - 1).max(1);
            let slopes: Vec<f64> = if at.len() > 1 { (0..parts).map(slope).collect() } else { vec![0.0] };
            self.tensor(&named("from"), &[parts], &at[..parts]);
            self.tensor(&named("to"), &[parts], &at[at.len() - parts..]);
            self.tensor(&named("slope"), &[parts, 1], &slopes);
            self.tensor(&named("first"), &[1], &score[..1]);
            let between = if unseen.is_some() { named("between") } else { found[feature].clone() };
            let steps = [
                ("Max", [values[feature].clone(), named("from")], named("above")),
                ("Min", [named("above"), named("to")], named("within")),
                ("Sub", [named("within"), named("from")], named("way")),
                ("MatMul", [named("way"), named("slope")], named("gain")),
                ("Add", [named("gain"), named("first")], between.clone()),
            ];
            steps.iter().for_each(|(operator, [a, b], output)| self.node(operator, &[a, b], output, &[]));
            if let Some(unseen) = unseen {
                self.tensor(&named("unseen"), &[], &[*unseen]);
                self.node("Equal", &[&values[feature], "nought"], &named("is_unseen"), &[]);
                self.node("Where", &[&named("is_unseen"), &named("unseen"), &between], &found[feature], &[]);
            }
        }
        let all: Vec<&str> = std::iter::once("clipped").chain(found.iter().map(String::as_str)).collect();
        self.node("Concat", &all, "inputs", &[("axis", 1)]);
    }

    /// A layer of a member on the values of the one before; the name of its own.
    fn layer(&mut self, before: &str, (layer, neuron): (LayerOf, Neuron), number: &str) -> String {
        let names = ["weights", "bias", "sum", "values"].map(|what| format!("{what}{number}"));
        let [weights, bias, sum, values] = &names;
        let (of_neurons, biases): (Vec<_>, Vec<_>) = layer.rows().unzip();
        self.tensor(weights, &[layer.neurons, layer.inputs], &of_neurons.concat());
        self.tensor(bias, &[layer.neurons], &biases);
        self.node("Gemm", &[before, weights, bias], sum, &[("transB", 1)]);
        let operator = match neuron {
            Neuron::Logistic => "Sigmoid",
            Neuron::Rectified => "Relu",
        };
        self.node(operator, &[sum], values, &[]);
        values.clone()
    }

    /// `TensorProto`: dimensions (1), element type (2), name (8), raw little-endian data (9).
    fn tensor(&mut self, name: &str, shape: &[usize], values: &[f64]) {
        let mut tensor = Message::default();
        shape.iter().for_each(|&size| tensor.number(1, size as u64));
        tensor.number(2, DOUBLE);
        tensor.text(8, name);
        let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        tensor.block(9, &raw);
        self.message.message(5, &tensor);
    }
}

/// `ValueInfoProto` of a matrix with any number of rows.
fn tensor_type(name: &str, element: u64, columns: usize) -> Message {
    let (mut rows, mut cols) = (Message::default(), Message::default());
    rows.text(2, "rows");
    cols.number(1, columns as u64);
    let (mut shape, mut tensor, mut of_type, mut info) =
        (Message::default(), Message::default(), Message::default(), Message::default());
    shape.message(1, &rows);
    shape.message(1, &cols);
    tensor.number(1, element);
    tensor.message(2, &shape);
    of_type.message(1, &tensor);
    info.text(1, name);
    info.message(2, &of_type);
    info
}

/// A protocol-buffers message in the making.
#[derive(Default)]
struct Message {
    bytes: Vec<u8>,
}

impl Message {
    /// Seven bits a byte, the lowest first, the top bit set on all but the last.
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.bytes.push(value as u8);
    }

    /// A field of wire type 0.
    fn number(&mut self, field: u64, value: u64) {
        self.varint(field << 3);
        self.varint(value);
    }

    /// A field of wire type 2.
    fn block(&mut self, field: u64, bytes: &[u8]) {
        self.varint(field << 3 | 2);
        self.varint(bytes.len() as u64);
        self.bytes.extend_from_slice(bytes);
    }

    fn text(&mut self, field: u64, text: &str) {
        self.block(field, text.as_bytes());
    }

    fn message(&mut self, field: u64, message: &Message) {
        self.block(field, &message.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::train::Activation;
    use crate::train::model::tests::{scored, with_neurons};

    #[test]
    fn exact_fields_are_encoded_as_protocol_buffers_says() {
        let mut message = Message::default();
        // The examples of the encoding's own documentation: field 1 = 150, field 2 = "testing".
        message.number(1, 150);
        message.text(2, "testing");
        assert_eq!(message.bytes, [0x08, 0x96, 0x01, 0x12, 0x07, 0x74, 0x65, 0x73, 0x74, 0x69, 0x6e, 0x67]);
        let mut large = Message::default();
        large.number(20, u64::MAX);
        assert_eq!(large.bytes, [&[0xa0, 0x01], [0xff; 9].as_slice(), &[0x01]].concat());
    }

    #[test]
    fn law_the_file_names_its_operators_and_holds_every_weight() {
        let model = with_neurons(Activation::Both, scored(2, &["a", "b", "c"], &[3], true));
        let bytes = onnx(&model);
        let holds = |part: &[u8]| bytes.windows(part.len()).any(|window| window == part);
        for word in [
            "Cast",
            "MatMul",
            "Sub",
            "Div",
            "Clip",
            "Split",
            "Max",
            "Min",
            "Equal",
            "Where",
            "Concat",
            "Gemm",
            "Sigmoid",
            "Relu",
            "Sum",
            "features",
            "untraversable",
            "Log",
            "probability",
            "marsyard_model",
        ] {
            assert!(holds(word.as_bytes()), "{word}");
        }
        assert!(model.network.weights.iter().all(|weight| holds(&weight.to_le_bytes())));
        let knots = model.about.scaler.scores.iter().flat_map(|scores| &scores.at);
        assert!(knots.into_iter().all(|at| holds(&at.to_le_bytes())));
    }
}
