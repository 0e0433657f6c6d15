//! Weights and a filter's memory <-> a safetensors file.
//!
//! Checkpoints hold two of them (now, and the best so far); `filter.safetensors` in a finished run holds the best, so that another
//! training can start from its covariance. One metadata key, `marsyard`, holds what else there is to know, as JSON.

use std::collections::HashMap;

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde_json::{Value as Json, json};

use super::filter::FilterState;

/// What learning goes on from.
#[derive(Clone, Debug, PartialEq)]
pub struct Snapshot {
    pub weights: Vec<f64>,
    pub filter: FilterState,
}

const KEY: &str = "marsyard";
/// Between a snapshot's name and its arrays' names; the weights come first.
const WEIGHTS: &str = "weights";

/// Named snapshots and a header as the bytes of a file.
pub fn to_bytes(header: &Json, snapshots: &[(&str, &Snapshot)]) -> Vec<u8> {
    let mut arrays: Vec<(String, Dtype, Vec<usize>, Vec<u8>)> = Vec::new();
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
    let about = json!({"header": header, "snapshots": listed}).to_string();
    serialize(views, Some(HashMap::from([(KEY.to_string(), about)]))).expect("names and sizes are sound")
}

const DTYPES: [(Dtype, &str); 3] = [(Dtype::F32, "F32"), (Dtype::F64, "F64"), (Dtype::U64, "U64")];

/// The header and the snapshots of a file.
pub fn from_bytes(bytes: &[u8]) -> Result<(Json, HashMap<String, Snapshot>), String> {
    let unreadable = |error: safetensors::SafeTensorError| format!("it is no whole safetensors file ({error})");
    let (_, metadata) = SafeTensors::read_metadata(bytes).map_err(unreadable)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(unreadable)?;
    let about = metadata.metadata().as_ref().and_then(|all| all.get(KEY)).ok_or("its metadata lack 'marsyard'")?;
    let mut about: Json = serde_json::from_str(about).map_err(|error| format!("its metadata are no JSON ({error})"))?;
    let mut snapshots = HashMap::new();
    for (name, listed) in about["snapshots"].as_object().into_iter().flatten() {
        let tensor = |array: &str| tensors.tensor(&format!("{name}/{array}")).map_err(unreadable);
        if name.contains('/') {
            return Err(format!("'{name}' is no name of a snapshot"));
        }
        let weights = tensor(WEIGHTS)?;
        if weights.dtype() != Dtype::F64 {
            return Err(format!("the weights of '{name}' are of type {:?}, not F64", weights.dtype()));
        }
        let words = weights.data().chunks_exact(8).map(|word| f64::from_le_bytes(word.try_into().expect("8 bytes")));
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
        let snapshot = Snapshot { weights: words.collect(), filter };
        snapshots.insert(name.clone(), snapshot);
    }
    Ok((about["header"].take(), snapshots))
}

#[cfg(test)]
mod tests {
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
        let bytes = to_bytes(&json!({"rows": 7}), &[("now", &now), ("best", &best)]);
        assert_eq!(bytes, to_bytes(&json!({"rows": 7}), &[("now", &now), ("best", &best)]));
        let (header, read) = from_bytes(&bytes).unwrap();
        assert_eq!(header["rows"], 7);
        assert_eq!((&read["now"], &read["best"]), (&now, &best));
        for cut in [0, 7, 8, 100, bytes.len() - 1] {
            assert!(from_bytes(&bytes[..cut]).is_err(), "{cut}");
        }
    }

    #[test]
    fn extreme_an_array_listed_many_times_is_refused_before_it_is_copied() {
        let arrays = vec![("factor".to_string(), "F64", vec![2], vec![0; 16])];
        let now = Snapshot { weights: vec![1.0], filter: FilterState { kind: "ekf-f64".into(), arrays } };
        let bytes = to_bytes(&json!({}), &[("now", &now)]);
        let (_, metadata) = SafeTensors::read_metadata(&bytes).unwrap();
        let about = metadata.metadata().clone().unwrap()[KEY].clone();
        let with = |from: &str, to: &str| {
            assert!(about.contains(from), "{about}");
            let metadata = HashMap::from([(KEY.to_string(), about.replace(from, to))]);
            let tensors = SafeTensors::deserialize(&bytes).unwrap();
            from_bytes(&serialize(tensors.tensors(), Some(metadata)).unwrap()).unwrap_err()
        };
        assert!(with(r#"["factor"]"#, r#"["factor","factor"]"#).contains("'factor' is listed twice"));
        assert!(with(r#""now""#, r#""now/filter""#).contains("no name of a snapshot"));
    }

    proptest::proptest! {
        #![proptest_config(proptest::prelude::ProptestConfig { failure_persistence: None, ..Default::default() })]

        #[test]
        fn extreme_broken_checkpoints_are_read_or_refused(
            changes in proptest::collection::vec((proptest::prelude::any::<proptest::sample::Index>(), 0..=255u8), 1..6),
        ) {
            let arrays = vec![("factor".to_string(), "F32", vec![3], vec![0; 12])];
            let now = Snapshot { weights: vec![1.0, 2.0], filter: FilterState { kind: "ekf-f32".into(), arrays } };
            let mut bytes = to_bytes(&json!({"rows": 7}), &[("now", &now), ("best", &now)]);
            for (at, value) in changes {
                let at = at.index(bytes.len());
                bytes[at] = value;
            }
            if let Ok((_, snapshots)) = from_bytes(&bytes) {
                proptest::prop_assert!(snapshots.values().all(|snapshot| snapshot.weights.len() <= bytes.len() / 8));
            }
        }
    }
}
