//! Weights and a filter's memory <-> a safetensors file.
//!
//! Checkpoints hold two of them (now, and the best so far) and the weights of the first look; `filter.safetensors` in a finished run holds the best, so that another
//! training can start from its covariance. One metadata key, `marsyard`, holds what else there is to know, as JSON; the tensor
//! `looks` holds the looks at the validation split, five words each. A [`checksum`] covers every byte.

use std::collections::HashMap;

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde_json::{Value as Json, json};

use super::checksum;
use super::filter::FilterState;
use super::looks::{Line, WORDS};

/// What learning goes on from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Snapshot {
    pub weights: Vec<f64>,
    pub filter: FilterState,
}

/// A file's content.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    pub header: Json,
    pub looks: Vec<Line>,
    pub snapshots: HashMap<String, Snapshot>,
    /// A checksum vouches for it; files of format 1 had none.
    pub checked: bool,
}

/// Version of these files; those of version 1 have neither version nor checksum nor looks.
const FORMAT: u32 = 2;
const KEY: &str = "marsyard";
const VERSION: &str = "marsyard_state";
/// Between a snapshot's name and its arrays' names; the weights come first.
const WEIGHTS: &str = "weights";
const LOOKS: &str = "looks";

/// A header, looks and named snapshots as the bytes of a file.
pub(crate) fn to_bytes(header: &Json, looks: &[Line], snapshots: &[(&str, &Snapshot)]) -> Vec<u8> {
    let mut arrays: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
    let words = looks.iter().flat_map(|line| line.to_words()).flat_map(u64::to_le_bytes).collect();
    arrays.push((LOOKS.into(), Dtype::U64, vec![looks.len(), WORDS], words));
    let mut listed = serde_json::Map::new();
    for (name, snapshot) in snapshots {
        let bytes = snapshot.weights.iter().flat_map(|w| w.to_le_bytes()).collect();
        arrays.push((format!("{name}/{WEIGHTS}"), Dtype::F64, vec![snapshot.weights.len()], bytes));
        let mut names = Vec::new();
        for (array, kind, shape, bytes) in &snapshot.filter.arrays {
            let dtype = DTYPES.iter().find(|(_, name)| name == kind).map_or(Dtype::U8, |(dtype, _)| *dtype);
            arrays.push((format!("{name}/filter/{array}"), dtype, shape.clone(), bytes.clone()));
            names.push(array.as_str());
        }
        listed.insert((*name).into(), json!({"filter": snapshot.filter.kind, "arrays": names}));
    }
    let views = arrays.iter().map(|(name, dtype, shape, bytes)| {
        let view = TensorView::new(*dtype, shape.clone(), bytes).expect("an array has the bytes of its shape");
        (name.as_str(), view)
    });
    let about = json!({VERSION: FORMAT, checksum::KEY: checksum::UNSET, "header": header, "snapshots": listed});
    let metadata = HashMap::from([(KEY.to_string(), about.to_string())]);
    checksum::seal(serialize(views, Some(metadata)).expect("names and sizes are sound"))
}

const DTYPES: [(Dtype, &str); 3] = [(Dtype::F32, "F32"), (Dtype::F64, "F64"), (Dtype::U64, "U64")];

/// Why a file says nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Unreadable {
    /// Whole for all that is known, but not for this program.
    #[error("it is of format {there}, this marsyard reads up to {FORMAT}: use the one that wrote it")]
    Newer { there: u64 },
    #[error("{0}")]
    Damaged(String),
}

impl From<String> for Unreadable {
    fn from(reason: String) -> Unreadable {
        Unreadable::Damaged(reason)
    }
}

/// The content of a file.
pub(crate) fn from_bytes(bytes: &[u8]) -> Result<State, Unreadable> {
    let unreadable = |error: safetensors::SafeTensorError| format!("it is no whole safetensors file ({error})");
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
    let about = metadata.metadata().as_ref().and_then(|all| all.get(KEY));
    let about = about.ok_or_else(|| "its metadata lack 'marsyard'".to_string())?;
    let mut about: Json = serde_json::from_str(about).map_err(|error| format!("its metadata are no JSON ({error})"))?;
    let format = about.get(VERSION).map_or(Some(1), Json::as_u64);
    if format.is_none_or(|format| format > u64::from(FORMAT)) {
        return Err(Unreadable::Newer { there: format.unwrap_or_default() });
    }
    let checked = checksum::take(bytes, &mut about, format == Some(u64::from(FORMAT)))?;
    let tensors = SafeTensors::deserialize(bytes).map_err(unreadable)?;
    let mut snapshots = HashMap::new();
    for (name, listed) in about["snapshots"].as_object().into_iter().flatten() {
        if name.contains('/') {
            return Err(format!("'{name}' is no name of a snapshot").into());
        }
        snapshots.insert(name.clone(), snapshot(&tensors, name, listed)?);
    }
    let header = about.get_mut("header").map(Json::take).unwrap_or_default();
    Ok(State { header, looks: looks(&tensors)?, snapshots, checked })
}

fn snapshot(tensors: &SafeTensors, name: &str, listed: &Json) -> Result<Snapshot, String> {
    let tensor = |array: &str| {
        let found = tensors.tensor(&format!("{name}/{array}"));
        found.map_err(|error| format!("it is no whole safetensors file ({error})"))
    };
    let weights = tensor(WEIGHTS)?;
    if weights.dtype() != Dtype::F64 {
        return Err(format!("the weights of '{name}' are of type {:?}, not F64", weights.dtype()));
    }
    let words = weights.data().as_chunks().0.iter().map(|word| f64::from_le_bytes(*word));
    let kind = listed["filter"].as_str().unwrap_or_default().to_string();
    let mut filter = FilterState { kind, arrays: Vec::new() };
    for array in listed["arrays"].as_array().into_iter().flatten().filter_map(Json::as_str) {
        // Each would be copied again.
        if filter.arrays.iter().any(|(known, ..)| known == array) {
            return Err(format!("its array '{array}' is listed twice"));
        }
        let view = tensor(&format!("filter/{array}"))?;
        let known = DTYPES.iter().find(|(dtype, _)| *dtype == view.dtype());
        let (_, kind) = known.ok_or_else(|| format!("its array '{array}' is of type {:?}", view.dtype()))?;
        filter.arrays.push((array.to_string(), *kind, view.shape().to_vec(), view.data().to_vec()));
    }
    Ok(Snapshot { weights: words.collect(), filter })
}

/// None where the file is of a time when it had none.
fn looks(tensors: &SafeTensors) -> Result<Vec<Line>, String> {
    let Ok(view) = tensors.tensor(LOOKS) else { return Ok(Vec::new()) };
    if view.dtype() != Dtype::U64 || view.shape().get(1) != Some(&WORDS) || view.shape().len() != 2 {
        return Err(format!("its looks are {:?} of shape {:?}, not U64 by {WORDS}", view.dtype(), view.shape()));
    }
    let (words, _) = view.data().as_chunks::<8>();
    let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
    Ok(words.as_chunks::<WORDS>().0.iter().map(|words| Line::from_words(*words)).collect())
}

#[cfg(test)]
mod tests {
    use super::super::stopping::Look;
    use super::*;

    #[test]
    fn equal_snapshots_after_a_file() {
        let words = |n: u8| (0..n).collect::<Vec<u8>>();
        let now = Snapshot {
            weights: vec![0.1, -1e300, f64::MIN_POSITIVE],
            filter: FilterState {
                kind: "ekf-f32".into(),
                arrays: vec![("p".into(), "F32", vec![3], words(12)), ("a".into(), "U64", vec![1], words(8))],
            },
        };
        let best = Snapshot { weights: vec![2.0], ..now.clone() };
        let look = Look { rows: 7, epoch: 1, train_error: None, validation_error: Some(0.1) };
        let looks = [Line { look, best: true, elapsed_s: 0.5 }; 2];
        let write = || to_bytes(&json!({"rows": 7}), &looks, &[("now", &now), ("best", &best)]);
        let bytes = write();
        assert_eq!(bytes, write());
        let read = from_bytes(&bytes).unwrap();
        assert_eq!((&read.header["rows"], &read.looks[..], read.checked), (&json!(7), &looks[..], true));
        assert_eq!((&read.snapshots["now"], &read.snapshots["best"]), (&now, &best));
        for cut in [0, 7, 8, 100, bytes.len() - 1] {
            assert!(from_bytes(&bytes[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn extreme_an_array_listed_many_times_is_refused_before_it_is_copied() {
        let arrays = vec![("factor".to_string(), "F64", vec![2], vec![0; 16])];
        let now = Snapshot { weights: vec![1.0], filter: FilterState { kind: "ekf-f64".into(), arrays } };
        let bytes = to_bytes(&json!({}), &[], &[("now", &now)]);
        let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
        let about = metadata.metadata().clone().unwrap()[KEY].clone();
        let with = |from: &str, to: &str| {
            assert!(about.contains(from), "{about}");
            let mut about: Json = serde_json::from_str(&about.replace(from, to)).unwrap();
            about[checksum::KEY] = checksum::UNSET.into();
            let metadata = HashMap::from([(KEY.to_string(), about.to_string())]);
            let tensors = SafeTensors::deserialize(&bytes).unwrap();
            from_bytes(&checksum::seal(serialize(tensors.tensors(), Some(metadata)).unwrap())).unwrap_err().to_string()
        };
        assert!(with(r#"["factor"]"#, r#"["factor","factor"]"#).contains("'factor' is listed twice"));
        assert!(with(r#""now""#, r#""now/filter""#).contains("no name of a snapshot"));
    }

    #[test]
    fn exact_every_flipped_bit_is_refused() {
        let arrays = vec![("factor".to_string(), "F32", vec![1], vec![7; 4])];
        let best = Snapshot { weights: vec![1.0], filter: FilterState { kind: "ekf-f32".into(), arrays } };
        let look = Look { rows: 7, epoch: 1, train_error: None, validation_error: Some(0.1) };
        let mut bytes = to_bytes(&json!({"rows": 7}), &[Line { look, best: true, elapsed_s: 0.5 }], &[("best", &best)]);
        for at in 0..bytes.len() {
            for bit in 0..8 {
                bytes[at] ^= 1 << bit;
                assert!(from_bytes(&bytes).is_err(), "bit {bit} of byte {at}");
                bytes[at] ^= 1 << bit;
            }
        }
        from_bytes(&bytes).unwrap();
    }

    /// The file as it was before there were checksums.
    fn of_before(bytes: &[u8]) -> Vec<u8> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).unwrap();
        let mut about: Json = serde_json::from_str(&metadata.metadata().as_ref().unwrap()[KEY]).unwrap();
        for key in [VERSION, checksum::KEY] {
            about.as_object_mut().unwrap().remove(key).unwrap();
        }
        let metadata = HashMap::from([(KEY.to_string(), about.to_string())]);
        serialize(SafeTensors::deserialize(bytes).unwrap().tensors(), Some(metadata)).unwrap()
    }

    #[test]
    fn law_files_of_before_have_no_checksum_and_are_still_read() {
        let filter = FilterState { kind: "ekf-f32".into(), arrays: Vec::new() };
        let bytes = to_bytes(&json!({"rows": 7}), &[], &[("now", &Snapshot { weights: vec![1.0], filter })]);
        let (now, before) = (from_bytes(&bytes).unwrap(), from_bytes(&of_before(&bytes)).unwrap());
        assert!(now.checked && !before.checked);
        assert_eq!((now.header, now.snapshots), (before.header, before.snapshots));
    }

    proptest::proptest! {
        #![proptest_config(proptest::prelude::ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn extreme_broken_checkpoints_are_read_or_refused(
            changes in proptest::collection::vec((proptest::prelude::any::<proptest::sample::Index>(), 0..=255u8), 1..6),
        ) {
            let arrays = vec![("factor".to_string(), "F32", vec![3], vec![0; 12])];
            let now = Snapshot { weights: vec![1.0, 2.0], filter: FilterState { kind: "ekf-f32".into(), arrays } };
            // With a checksum all of them would be refused by that alone.
            let mut bytes = of_before(&to_bytes(&json!({"rows": 7}), &[], &[("now", &now), ("best", &now)]));
            for (at, value) in changes {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            if let Ok(State { snapshots, .. }) = from_bytes(&bytes) {
                proptest::prop_assert!(snapshots.values().all(|snapshot| snapshot.weights.len() <= bytes.len() / 8));
            }
        }
    }
}
