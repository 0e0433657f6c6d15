//! Label ids of a cloud -> which points are an obstacle's.
//!
//! In: a mapping file (YAML), for example `labels: {40: traversable, 50: untraversable, 0: ignore}`; `others` says what an id that is
//! not listed means (without it, such an id is refused). Ignored points take part in features, never in scores.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::CloudError;

/// What a label id means for a rover.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum PointClass {
    Traversable,
    Untraversable,
    Ignore,
}

/// A mapping file.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LabelMap {
    labels: BTreeMap<i64, PointClass>,
    #[serde(default)]
    others: Option<PointClass>,
}

impl LabelMap {
    /// The mapping in the text of a file.
    pub fn parse(file: &str, text: &str) -> Result<LabelMap, CloudError> {
        // What the parser says may quote the file, and any file may be named here.
        let place = |error: &serde_saphyr::Error| match error.location() {
            Some(at) => format!("line {}, column {}", at.line(), at.column()),
            None => "label mapping".into(),
        };
        serde_saphyr::from_str(text).map_err(|error| CloudError::Malformed {
            file: file.into(),
            place: place(error.without_snippet()),
            reason: "this is no label mapping: write `labels: {40: traversable, 50: untraversable, 0: ignore}`, and beside it, if \
                     need be, `others: ignore`"
                .into(),
        })
    }

    /// One verdict a point: an obstacle's, not one's, or none. `file`: the cloud's, for messages.
    pub fn verdicts(&self, file: &str, labels: &[i64]) -> Result<Vec<Option<bool>>, CloudError> {
        let verdict = |(point, label): (usize, &i64)| match self.labels.get(label).copied().or(self.others) {
            Some(PointClass::Traversable) => Ok(Some(false)),
            Some(PointClass::Untraversable) => Ok(Some(true)),
            Some(PointClass::Ignore) => Ok(None),
            None => Err(CloudError::UnmappedLabel { file: file.into(), label: *label, point }),
        };
        labels.iter().enumerate().map(verdict).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_ids_become_verdicts_and_strangers_are_refused_unless_told_of() {
        let map = LabelMap::parse("m.yaml", "labels: {40: traversable, 50: untraversable, -1: ignore}").unwrap();
        assert_eq!(map.verdicts("c.ply", &[50, 40, -1]).unwrap(), [Some(true), Some(false), None]);
        let error = map.verdicts("c.ply", &[40, 7]).unwrap_err().to_string();
        assert_eq!(error, "c.ply: label 7 (point 1) is not in the label mapping; add it, or add `others: ignore`");
        let map = LabelMap::parse("m.yaml", "labels: {}\nothers: untraversable").unwrap();
        assert_eq!(map.verdicts("c.ply", &[7]).unwrap(), [Some(true)]);
        let error = LabelMap::parse("m.yaml", "labels:\n  1: lava").unwrap_err().to_string();
        assert!(error.starts_with("m.yaml: line 2, column 6: ") && !error.contains("lava"), "{error}");
    }

    #[test]
    fn law_shipped_mappings_parse() {
        for text in [
            include_str!("../../configs/labels/semantic-kitti.yaml"),
            include_str!("../../configs/labels/kitti-360.yaml"),
            include_str!("../../configs/labels/mcd.yaml"),
            include_str!("../../configs/labels/rellis-3d.yaml"),
            include_str!("../../configs/labels/marsyard.yaml"),
        ] {
            assert!(!LabelMap::parse("shipped", text).unwrap().labels.is_empty());
        }
    }
}
