//! A model <-> the bytes of `model.safetensors`.
//!
//! One tensor a layer, `layers.0` from the input on, or of several members `members.0.layers.0`: F64, shape [neurons, inputs] or, with
//! biases, [neurons, inputs + 1] with the bias last in each row. One metadata key, `marsyard`: [`About`] as JSON with sorted keys, and a [`checksum`] of the whole file.
//! Equal models give equal bytes. Files of format 1 have no checksum, and do not name their run; files of formats 1 and 2 have no calibration, and
//! files of formats 1 to 3 have one member, files of formats 1 to 4 no normal scores, files of formats 1 to 5 logistic neurons alone, and in files of formats
//! 1 to 6 no calibration names its edge.
//!
//! Loading trusts nothing: sizes are checked against the bytes that are there before anything is made of that size.

use std::collections::HashMap;
use std::io::Read;
use std::path::Path;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};
use serde_json::Value;

use super::{About, MODEL_FORMAT, Model, ModelError};
use crate::corpus::limits::MODEL_BYTES;
use crate::corpus::sha256;
use crate::train::{Layout, Network, checksum};

/// The one metadata key.
const KEY: &str = "marsyard";

/// The first format with a checksum.
const CHECKED_FORMAT: u32 = 2;

/// More than any network that the trainer makes: 64 million weights.
const MAX_BYTES: usize = MODEL_BYTES as usize;

impl Model {
    /// The bytes of a model file.
    pub fn save(&self) -> Result<Vec<u8>, ModelError> {
        self.check()?;
        let layout = &self.network.layout;
        let mut layers = Vec::new();
        for (member, of_member) in layout.split(&self.network.weights).into_iter().enumerate() {
            for (number, layer) in of_member.into_iter().enumerate() {
                let shape = vec![layer.neurons, layer.inputs + usize::from(layout.bias)];
                let bytes: Vec<u8> = layer.weights.iter().flat_map(|w| w.to_le_bytes()).collect();
                layers.push((layer_name(layout, member, number), shape, bytes));
            }
        }
        let failed = |error: &dyn std::fmt::Display| ModelError::Contradiction { reason: error.to_string() };
        let tensors = layers
            .iter()
            .map(|(name, shape, bytes)| Ok((name, TensorView::new(Dtype::F64, shape.clone(), bytes)?)))
            .collect::<Result<Vec<_>, safetensors::SafeTensorError>>()
            .map_err(|error| failed(&error))?;
        let checked = self.about.is_checked();
        let metadata = HashMap::from([(KEY.to_string(), self.about.text(checked.then_some(checksum::UNSET)))]);
        let bytes = safetensors::serialize(tensors, Some(metadata)).map_err(|error| failed(&error))?;
        Ok(if checked { checksum::seal(bytes) } else { bytes })
    }

    /// A model from the bytes of its file.
    pub fn load(bytes: &[u8]) -> Result<Model, ModelError> {
        let foreign = |reason: String| ModelError::NotAModel { reason };
        if bytes.len() > MAX_BYTES {
            return Err(foreign(format!("{} bytes are more than the {MAX_BYTES} that a model may have", bytes.len())));
        }
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|error| foreign(format!("{error}")))?;
        let text = header.metadata().as_ref().and_then(|pairs| pairs.get(KEY));
        let text = text.ok_or_else(|| foreign(format!("its metadata has no key '{KEY}'")))?;
        let about = About::read(bytes, text)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(|error| foreign(format!("{error}")))?;
        let network = network(&about, &tensors)?;
        let model = Model { network, about, sha256: Some(sha256(bytes)) };
        model.check()?;
        Ok(model)
    }

    /// A model from its file.
    pub fn read(path: &Path) -> Result<Model, ModelError> {
        let failed = |source| ModelError::Io { name: path.display().to_string(), source };
        // Asked first, so that no hostile size is read into memory; a device has no end, and a pipe may have no writer.
        let facts = std::fs::metadata(path).map_err(failed)?;
        if !facts.is_file() {
            return Err(ModelError::NotAModel { reason: "it is not a file".into() });
        }
        let length = facts.len();
        if length > MAX_BYTES as u64 {
            let reason = format!("{length} bytes are more than the {MAX_BYTES} that a model may have");
            return Err(ModelError::NotAModel { reason });
        }
        // It may grow while it is read.
        let mut bytes = Vec::with_capacity(length as usize);
        let file = std::fs::File::open(path).map_err(failed)?;
        file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(failed)?;
        Model::load(&bytes)
    }
}

impl About {
    /// Whether its file has a checksum.
    pub(crate) fn is_checked(&self) -> bool {
        self.marsyard_model >= CHECKED_FORMAT
    }

    /// Sorted JSON, one line.
    pub(crate) fn to_json(&self) -> String {
        self.text(None)
    }

    fn text(&self, checksum: Option<&str>) -> String {
        let mut value = serde_json::to_value(self).expect("the facts of a model are plain data");
        if let Some(digits) = checksum {
            value[checksum::KEY] = digits.into();
        }
        value.sort_all_objects();
        value.to_string()
    }

    /// Those of a file, whose bytes are checked where it is of a format that has a checksum.
    fn read(bytes: &[u8], text: &str) -> Result<About, ModelError> {
        let foreign = |reason: String| ModelError::NotAModel { reason };
        let mut value: Value = serde_json::from_str(text).map_err(|e| foreign(format!("metadata '{KEY}': {e}")))?;
        // The version first: another version may have other keys.
        let version = value.get("marsyard_model").and_then(Value::as_u64);
        let version = version.ok_or_else(|| foreign(format!("metadata '{KEY}' has no format version")))?;
        if !(1..=u64::from(MODEL_FORMAT)).contains(&version) {
            return Err(ModelError::OtherVersion { there: version });
        }
        let needed = version >= u64::from(CHECKED_FORMAT);
        checksum::take(bytes, &mut value, needed).map_err(|reason| ModelError::Damaged { reason })?;
        serde_json::from_value(value).map_err(|e| foreign(format!("metadata '{KEY}': {e}")))
    }
}

fn layer_name(layout: &Layout, member: usize, layer: usize) -> String {
    format!("{}layers.{layer}", layout.member_name(member))
}

/// The weights, once the tensors are exactly those that the metadata tells of.
fn network(about: &About, tensors: &SafeTensors) -> Result<Network, ModelError> {
    let contradiction = |reason: String| ModelError::Contradiction { reason };
    let layout = about.layout();
    let sizes = layout.sizes();
    let layers = sizes.len() - 1;
    if layout.members == 0 || layers.checked_mul(layout.members) != Some(tensors.len()) {
        let told = format!("{} tensors for {} members of {layers} layers", tensors.len(), layout.members);
        return Err(contradiction(told));
    }
    if sizes.contains(&0) {
        return Err(contradiction(format!("a layer without neurons: {sizes:?}")));
    }
    let mut weights = Vec::new();
    for (place, pair) in
        (0..layout.members).flat_map(|member| sizes.windows(2).enumerate().map(move |(k, pair)| ((member, k), pair)))
    {
        let name = layer_name(&layout, place.0, place.1);
        let layer = tensors.tensor(&name).map_err(|_| contradiction(format!("there is no tensor '{name}'")))?;
        let columns = pair[0].checked_add(usize::from(layout.bias));
        let fits = columns.is_some_and(|columns| layer.shape() == [pair[1], columns]);
        if layer.dtype() != Dtype::F64 || !fits {
            return Err(contradiction(format!(
                "tensor '{name}' is {:?} of shape {:?}, the metadata tells of F64 with {} neurons of {} inputs{}",
                layer.dtype(),
                layer.shape(),
                pair[1],
                pair[0],
                if layout.bias { " and a bias" } else { "" }
            )));
        }
        weights.extend(layer.data().as_chunks::<8>().0.iter().map(|bytes| f64::from_le_bytes(*bytes)));
    }
    Ok(Network { layout, weights })
}
