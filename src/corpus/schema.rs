//! The columns: each one's name, type, unit and meaning, from which Arrow, Parquet, the card, Croissant and `schemas/` follow.
//!
//! What a column says of itself stands once: for fixed columns beside the code that takes its value (`tables/`), for
//! features in `cells`, for drawn values in the register of purposes.

use std::sync::Arc;

use arrow_schema::{DataType, Field, Schema, SchemaRef};
use serde::{Deserialize, Serialize};

use super::{Table, tables};
use crate::cells::{FeatureColumn, Label as CellLabel, LossColumn, TruthColumn};
use crate::random::Purpose;

/// Names of `cells.label`, by value.
pub(crate) const LABELS: [&str; 2] = [CellLabel::Traversable.name(), CellLabel::Untraversable.name()];

/// Types on disk: those that every reader knows, none unsigned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Kind {
    Int8,
    Int32,
    Int64,
    Float32,
    Float64,
    Bool,
    String,
}

impl Kind {
    pub(crate) fn arrow(self) -> DataType {
        match self {
            Kind::Int8 => DataType::Int8,
            Kind::Int32 => DataType::Int32,
            Kind::Int64 => DataType::Int64,
            Kind::Float32 => DataType::Float32,
            Kind::Float64 => DataType::Float64,
            Kind::Bool => DataType::Boolean,
            Kind::String => DataType::Utf8,
        }
    }

    /// As Hugging Face `datasets` names it; the names in the metadata are the same.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Kind::Int8 => "int8",
            Kind::Int32 => "int32",
            Kind::Int64 => "int64",
            Kind::Float32 => "float32",
            Kind::Float64 => "float64",
            Kind::Bool => "bool",
            Kind::String => "string",
        }
    }

    /// As schema.org and MLCommons name it.
    pub(crate) fn croissant(self) -> &'static str {
        match self {
            Kind::Int8 => "cr:Int8",
            Kind::Int32 => "cr:Int32",
            Kind::Int64 => "cr:Int64",
            Kind::Float32 => "cr:Float32",
            Kind::Float64 => "cr:Float64",
            Kind::Bool => "sc:Boolean",
            Kind::String => "sc:Text",
        }
    }
}

/// What a column may be used for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(crate) enum Role {
    /// Says which row this is.
    Key,
    Label,
    /// An input of a classifier.
    Feature,
    /// Known to the simulator only: never an input.
    Truth,
    /// Everything else: never an input.
    Info,
    /// A value drawn for the scene.
    Drawn,
}

/// A column of a table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Column {
    pub name: String,
    #[serde(rename = "type")]
    pub kind: Kind,
    pub nullable: bool,
    /// SI, or "1" for counts, numbers, shares and names.
    pub unit: String,
    pub role: Role,
    pub description: String,
}

/// The columns of a table, in order.
/// `by_rover`: cells are labelled by a rover; `poses`: it is set down in each of them; `pose_covariance`: estimates have all of theirs.
pub(crate) fn columns(
    table: Table,
    features: &[FeatureColumn],
    truth: &[TruthColumn],
    losses: &[LossColumn],
    drawn: &[Purpose],
    [by_rover, poses, pose_covariance]: [bool; 3],
) -> Vec<Column> {
    match table {
        Table::Cells => {
            let mut columns = tables::columns(&tables::cells::definitions(by_rover, poses));
            columns.extend(features.iter().map(|feature| Column {
                name: feature.name.clone(),
                kind: Kind::Float32,
                nullable: false,
                unit: if feature.unit.is_empty() { "1".into() } else { feature.unit.into() },
                role: Role::Feature,
                description: feature.description.clone(),
            }));
            columns.extend(truth.iter().map(|truth| Column {
                name: truth.name.into(),
                kind: Kind::Float32,
                nullable: false,
                unit: truth.unit.into(),
                role: Role::Truth,
                description: truth.description.into(),
            }));
            columns
        }
        Table::Scenes => {
            let mut columns = tables::columns(&tables::scenes::definitions());
            columns.extend(losses.iter().map(|loss| Column {
                name: loss.name.into(),
                kind: Kind::Int64,
                nullable: false,
                unit: "1".into(),
                role: Role::Info,
                description: loss.description.into(),
            }));
            columns.extend(drawn.iter().map(|purpose| Column {
                name: purpose.key().into(),
                kind: Kind::Float64,
                nullable: true,
                unit: unit_of_key(purpose.key()).into(),
                role: Role::Drawn,
                description: format!(
                    "Value drawn for the scene from the config's {}; null where its family has none.",
                    purpose.key()
                ),
            }));
            columns
        }
        Table::Poses => tables::columns(&tables::poses::definitions(pose_covariance)),
        Table::Points => tables::columns(&tables::points::definitions()),
    }
}

/// The unit that ends a config key.
fn unit_of_key(key: &str) -> &'static str {
    const UNITS: [(&str, &str); 12] = [
        ("_m_per_sqrt_m", "m/sqrt(m)"),
        ("_deg_per_sqrt_m", "deg/sqrt(m)"),
        ("_per_sqrt_m", "1/sqrt(m)"),
        ("_per_m2", "1/m2"),
        ("_per_m", "1/m"),
        ("_mps", "m/s"),
        ("_degps", "deg/s"),
        ("_m2", "m2"),
        ("_mrad", "mrad"),
        ("_rad", "rad"),
        ("_deg", "deg"),
        ("_m", "m"),
    ];
    UNITS.iter().find(|(end, _)| key.ends_with(end)).map_or("1", |(_, unit)| unit)
}

/// The Arrow schema; unit, role and description of a column are its field's metadata.
pub(crate) fn arrow_schema(columns: &[Column]) -> SchemaRef {
    let fields: Vec<Field> = columns
        .iter()
        .map(|column| {
            let role =
                serde_json::to_value(column.role).ok().and_then(|v| v.as_str().map(str::to_string)).unwrap_or_default();
            let about = [("description", column.description.clone()), ("role", role), ("unit", column.unit.clone())];
            let about: std::collections::HashMap<String, String> =
                about.into_iter().map(|(k, v)| (k.to_string(), v)).collect();
            Field::new(&column.name, column.kind.arrow(), column.nullable).with_metadata(about)
        })
        .collect();
    Arc::new(Schema::new(fields))
}

/// The columns as the JSON text of the Parquet key-value `marsyard.columns`.
pub(crate) fn columns_json(columns: &[Column]) -> String {
    serde_json::to_string(columns).expect("columns are plain text")
}

/// A table's entry in `schemas/`.
pub(crate) fn document(table: Table, features: &[FeatureColumn], drawn: &[Purpose]) -> serde_json::Value {
    serde_json::json!({
        "format": super::PARQUET_FORMAT,
        "table": table.name(),
        "row": table.row_is(),
        "sorted_by": sort_keys(table),
        "columns": columns(table, features, &[], &[], drawn, [false; 3]),
    })
}

/// The columns that rows of a table are sorted by.
pub(crate) fn sort_keys(table: Table) -> &'static [&'static str] {
    match table {
        Table::Cells => &["scene_id", "scan_id", "row", "col"],
        Table::Scenes => &["scene_id"],
        Table::Poses => &["scene_id", "step"],
        Table::Points => &["scene_id", "scan_id", "line", "beam"],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_cells_columns_stand_in_the_order_of_the_design() {
        let feature = FeatureColumn { name: "mean_height_m".into(), unit: "m", description: "d".into() };
        let names: Vec<String> =
            columns(Table::Cells, &[feature], &[], &[], &[], [false; 3]).into_iter().map(|c| c.name).collect();
        let expected = "scene_id scan_id row col label points range_m neighbour_mask truth_obstacle_points truth_top_points \
                        truth_class truth_object_id truth_protrusion_m truth_slope_rad mean_height_m";
        assert_eq!(names, expected.split_whitespace().collect::<Vec<_>>());
    }

    #[test]
    fn law_every_column_has_a_unique_name_a_unit_and_a_meaning() {
        for table in Table::ALL {
            let columns = columns(table, &[], &[], &[], Purpose::ALL, [true; 3]);
            let mut names: Vec<&str> = columns.iter().map(|c| c.name.as_str()).collect();
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), columns.len(), "{table:?}");
            assert!(columns.iter().all(|c| !c.unit.is_empty() && c.description.ends_with('.')), "{table:?}");
            for key in sort_keys(table) {
                assert!(
                    columns.iter().any(|c| c.name == *key && c.role == Role::Key && !c.nullable),
                    "{table:?} {key}"
                );
            }
        }
    }

    #[test]
    fn law_units_end_the_names_of_columns_that_have_one() {
        let ends = [("m", "_m"), ("m2", "_m2"), ("rad", "_rad"), ("s", "_s")];
        for table in Table::ALL {
            for column in columns(table, &[], &[], &[], &[], [true; 3]) {
                if let Some((_, end)) = ends.iter().find(|(unit, _)| *unit == column.unit) {
                    assert!(column.name.ends_with(end), "{table:?} {} [{}]", column.name, column.unit);
                }
            }
        }
    }

    #[test]
    fn exact_units_of_drawn_values_come_from_their_keys() {
        for (key, unit) in [
            ("scene.rocks.diameter_m", "m"),
            ("drive.instruments.odometry_m_per_sqrt_m", "m/sqrt(m)"),
            ("drive.speed_mps", "m/s"),
            ("scene.trees.crown.extinction_per_m", "1/m"),
            ("scene.rocks.count", "1"),
        ] {
            assert_eq!(unit_of_key(key), unit, "{key}");
        }
    }

    #[test]
    fn exact_field_metadata_carries_unit_role_and_description() {
        let columns = columns(Table::Cells, &[], &[], &[], &[], [false; 3]);
        let schema = arrow_schema(&columns);
        let range = schema.field_with_name("range_m").unwrap();
        let about = range.metadata();
        assert_eq!(about.get("unit").map(String::as_str), Some("m"));
        assert_eq!(about.get("role").map(String::as_str), Some("info"));
        let label = schema.field_with_name("label").unwrap();
        assert!(label.is_nullable() && *label.data_type() == DataType::Int8);
    }
}
