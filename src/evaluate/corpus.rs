//! The cells of one split of a corpus -> the judge, row group by row group.
//!
//! Row groups hold whole scans, so a scan is judged at once. Columns that only some corpora have (truth, height difference) may be
//! missing; those that the model needs may not.

use std::collections::BTreeMap;

use arrow::array::{Array, ArrowPrimitiveType, Int64Array, PrimitiveArray, RecordBatch, StringArray};
use arrow::datatypes::{Float32Type, Int8Type, Int32Type, Int64Type};

use super::judge::{Cell, Judge, Threshold, ThresholdOrigin};
use super::report::{DataFacts, Report};
use crate::corpus::manifest::{self, ShardLine};
use crate::corpus::reader::TableFile;
use crate::corpus::{CorpusError, Manifest, Split, Store, Table};
use crate::train::labels::{self, LabelRule, Truth};
use crate::train::{Model, ModelError};

/// What the plan says of a family.
#[derive(Clone, Debug, PartialEq)]
pub struct FamilyFacts {
    pub name: String,
    pub sensor: String,
    pub cell_size_m: f64,
    /// The rule of its labels, for people.
    pub labels: String,
}

/// How to judge.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    pub split: Split,
    /// Labels by another rule than the corpus's.
    pub labels: Option<LabelRule>,
    /// Thresholds of the output in place of the model's.
    pub thresholds: Vec<f64>,
    /// Choose a threshold on the validation split, too.
    pub choose: bool,
    /// Judge the scenes of these families alone; empty = all. Thresholds are chosen on all families all the same: one that is held
    /// out has no validation scenes.
    pub only_families: Vec<String>,
}

impl Options {
    pub fn of(split: Split) -> Options {
        Options { split, labels: None, thresholds: Vec::new(), choose: true, only_families: Vec::new() }
    }
}

/// Why a model could not be judged.
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Model(#[from] ModelError),
    #[error("{place}/{name}: {reason}; run `marsyard verify {place}` to see whether the corpus is whole")]
    Table { place: String, name: String, reason: String },
    #[error(
        "{place}: the {split} split holds no cell with a known label; build at least 7 shards, or choose another `--split`"
    )]
    EmptySplit { place: String, split: &'static str },
    #[error("family '{family}': {source}")]
    Family { family: String, source: ModelError },
    #[error("the corpus has no family '{family}'; it has {known}")]
    NoFamily { family: String, known: String },
    #[error("the thresholds {0:?} are not 1 to 16 rising numbers within 0 and 1")]
    Thresholds(Vec<f64>),
}

/// Judges a model on a split. `families` may be empty: then nothing is known of sensors and cell sizes.
pub fn evaluate(
    model: &Model,
    store: &dyn Store,
    families: &[FamilyFacts],
    options: &Options,
) -> Result<Report, EvaluateError> {
    for family in families {
        let named = |source| EvaluateError::Family { family: family.name.clone(), source };
        model.check_cell_size(family.cell_size_m).map_err(named)?;
    }
    if let Some(family) = options.only_families.iter().find(|name| families.iter().all(|f| f.name != **name)) {
        let known: Vec<&str> = families.iter().map(|f| f.name.as_str()).collect();
        return Err(EvaluateError::NoFamily { family: family.clone(), known: known.join(", ") });
    }
    let manifest = Manifest::read(store)?;
    let columns: Vec<&str> = manifest.features.iter().map(|feature| feature.name.as_str()).collect();
    model.inputs_of(&columns)?;
    let reader =
        Reader { model, store, families, labels: options.labels.as_ref(), lines: manifest::read_shard_lines(store)? };
    let mut thresholds = thresholds(model, options)?;
    let mut notes = Vec::new();
    let mut height_threshold = None;
    if options.choose {
        let chosen = reader.judge(Split::Validation, &[], Judge::new(Vec::new(), None))?.0.best_thresholds();
        let origin = ThresholdOrigin::Validation;
        thresholds.extend(chosen.map(|(value, _)| Threshold { value, origin }));
        height_threshold = chosen.map(|(_, value)| Threshold { value, origin });
        match chosen {
            None => {
                notes.push("no threshold was chosen: the validation split lacks one of the two classes".to_string())
            }
            Some(_) if options.split == Split::Validation => {
                notes.push("the chosen thresholds were chosen on these very cells: they flatter".to_string());
            }
            Some(_) => {}
        }
    }
    let (judge, scans) =
        reader.judge(options.split, &options.only_families, Judge::new(thresholds, height_threshold))?;
    if judge.groups.is_empty() {
        return Err(EvaluateError::EmptySplit { place: store.place(), split: options.split.name() });
    }
    if !options.only_families.is_empty() {
        notes.push(format!("judged on the scenes of {} alone", options.only_families.join(", ")));
    }
    if options.split == Split::Train {
        notes.push("the model may have learnt these very cells: quote the test split".to_string());
    }
    if options.labels.is_some() {
        notes.push("labels were derived anew from the truth columns by another rule than the corpus's".to_string());
    }
    if judge.not_finite_cells > 0 {
        notes.push(format!("{} cells were left out: a feature is NaN or infinite", judge.not_finite_cells));
    }
    let data = DataFacts {
        name: manifest.name.clone(),
        corpus_id: manifest.corpus_id.clone(),
        split: options.split.name().into(),
        labels: rule_text(families, options.labels.as_ref()),
        scans,
        ..DataFacts::default()
    };
    Ok(Report::new(model, &judge, data, notes))
}

fn thresholds(model: &Model, options: &Options) -> Result<Vec<Threshold>, EvaluateError> {
    let given = &options.thresholds;
    if given.is_empty() {
        let of_model = |&value| Threshold { value, origin: ThresholdOrigin::Model };
        return Ok(model.about.thresholds.iter().map(of_model).collect());
    }
    let fine = given.len() <= 16 && given.is_sorted() && given.iter().all(|t| (0.0..=1.0).contains(t));
    if !fine {
        return Err(EvaluateError::Thresholds(given.clone()));
    }
    Ok(given.iter().map(|&value| Threshold { value, origin: ThresholdOrigin::Given }).collect())
}

fn rule_text(families: &[FamilyFacts], rule: Option<&LabelRule>) -> String {
    if let Some(rule) = rule {
        return serde_json::to_string(rule).expect("a rule is plain data");
    }
    let mut rules: Vec<&str> = families.iter().map(|family| family.labels.as_str()).collect();
    rules.dedup();
    if rules.is_empty() { "as the corpus has them".into() } else { rules.join(" | ") }
}

struct Reader<'a> {
    model: &'a Model,
    store: &'a dyn Store,
    families: &'a [FamilyFacts],
    labels: Option<&'a LabelRule>,
    lines: Vec<ShardLine>,
}

/// One scan in the making.
#[derive(Default)]
struct Scan {
    key: Option<(i64, i32)>,
    cells: Vec<Cell>,
    features: Vec<f32>,
}

impl Reader<'_> {
    /// Runs the cells of a split through the judge, those of some families where any is named; also the number of scans.
    fn judge(&self, split: Split, only: &[String], mut judge: Judge) -> Result<(Judge, u64), EvaluateError> {
        let mut scans = 0;
        let mut outputs = Vec::new();
        for line in self.lines.iter().filter(|line| line.split == split) {
            let Some(facts) = line.tables.get(&Table::Cells) else { continue };
            let family_of = self.families_of_scenes(line)?;
            let wanted_scene =
                |scene: i64| only.is_empty() || family_of.get(&scene).is_some_and(|family| only.contains(family));
            let table = TableFile::open(self.store, &facts.path)?;
            let mut scan = Scan::default();
            let wanted = self.wanted(&table)?;
            for group in 0..table.row_groups().len() {
                let batch = table.read_row_group(group, Some(&wanted))?;
                let columns = Columns::of(&batch, self.model, self.labels).map_err(|r| self.fault(table.name(), r))?;
                for row in (0..batch.num_rows()).filter(|&row| wanted_scene(columns.scene_id.value(row))) {
                    let key = (columns.scene_id.value(row), columns.scan_id.value(row));
                    if scan.key != Some(key) {
                        scans += self.finish(&mut scan, &family_of, &mut judge, &mut outputs);
                        scan.key = Some(key);
                    }
                    columns.push(row, &mut scan, &mut judge);
                }
            }
            scans += self.finish(&mut scan, &family_of, &mut judge, &mut outputs);
        }
        Ok((judge, scans))
    }

    fn fault(&self, name: &str, reason: String) -> EvaluateError {
        EvaluateError::Table { place: self.store.place(), name: name.into(), reason }
    }

    /// The columns to read of a table.
    fn wanted<'n>(&'n self, table: &TableFile) -> Result<Vec<&'n str>, EvaluateError> {
        let there = |name: &str| table.schema().field_with_name(name).is_ok();
        let mut needed = vec!["scene_id", "scan_id", "row", "col", "label", "points", "range_m"];
        needed.extend(self.model.about.features.iter().map(String::as_str));
        needed.extend(labels::COLUMNS.iter().filter(|_| self.labels.is_some()));
        if let Some(absent) = needed.iter().find(|name| !there(name)) {
            return Err(self.fault(table.name(), format!("it has no column '{absent}'")));
        }
        needed.extend([HEIGHT_DIFFERENCE, OBSTACLE_POINTS, TOP_POINTS, CLASS].into_iter().filter(|name| there(name)));
        needed.sort_unstable();
        needed.dedup();
        Ok(needed)
    }

    fn finish(
        &self,
        scan: &mut Scan,
        family_of: &BTreeMap<i64, String>,
        judge: &mut Judge,
        outputs: &mut Vec<f64>,
    ) -> u64 {
        let Some((scene, _)) = scan.key.filter(|_| !scan.cells.is_empty()) else { return 0 };
        outputs.clear();
        self.model.outputs(&scan.features, outputs);
        let family = family_of.get(&scene).map_or("", String::as_str);
        let sensor = self.families.iter().find(|facts| facts.name == family).map_or("", |facts| facts.sensor.as_str());
        judge.add_scan(family, sensor, &scan.cells, outputs);
        scan.cells.clear();
        scan.features.clear();
        1
    }

    /// Family by scene, from the small `scenes` table; empty where the corpus has none.
    fn families_of_scenes(&self, line: &ShardLine) -> Result<BTreeMap<i64, String>, EvaluateError> {
        let mut families = BTreeMap::new();
        let Some(facts) = line.tables.get(&Table::Scenes) else { return Ok(families) };
        for batch in TableFile::open(self.store, &facts.path)?.batches() {
            let batch = batch?;
            let ids = batch.column_by_name("scene_id").and_then(|c| c.as_any().downcast_ref::<Int64Array>());
            let names = batch.column_by_name("family").and_then(|c| c.as_any().downcast_ref::<StringArray>());
            let (Some(ids), Some(names)) = (ids, names) else {
                let reason = "it has no columns 'scene_id' and 'family' of whole numbers and text".into();
                return Err(self.fault(&facts.path, reason));
            };
            families.extend(ids.values().iter().zip(names.iter()).map(|(&id, name)| (id, name.unwrap_or("").into())));
        }
        Ok(families)
    }
}

const HEIGHT_DIFFERENCE: &str = "height_difference_m";
const OBSTACLE_POINTS: &str = "truth_obstacle_points";
const TOP_POINTS: &str = "truth_top_points";
const CLASS: &str = "truth_class";

/// The columns of a row group.
struct Columns<'b> {
    scene_id: &'b PrimitiveArray<Int64Type>,
    scan_id: &'b PrimitiveArray<Int32Type>,
    row: &'b PrimitiveArray<Int32Type>,
    col: &'b PrimitiveArray<Int32Type>,
    label: &'b PrimitiveArray<Int8Type>,
    points: &'b PrimitiveArray<Int32Type>,
    range_m: &'b PrimitiveArray<Float32Type>,
    height_difference_m: Option<&'b PrimitiveArray<Float32Type>>,
    obstacle_points: Option<&'b PrimitiveArray<Int32Type>>,
    top_points: Option<&'b PrimitiveArray<Int32Type>>,
    class: Option<&'b PrimitiveArray<Int8Type>>,
    features: Vec<&'b PrimitiveArray<Float32Type>>,
    relabel: Option<Relabel<'b>>,
}

struct Relabel<'b> {
    rule: &'b LabelRule,
    obstacle_points: &'b PrimitiveArray<Int32Type>,
    class: &'b PrimitiveArray<Int8Type>,
    protrusion_m: &'b PrimitiveArray<Float32Type>,
    slope_rad: &'b PrimitiveArray<Float32Type>,
}

impl<'b> Columns<'b> {
    fn of(batch: &'b RecordBatch, model: &Model, rule: Option<&'b LabelRule>) -> Result<Columns<'b>, String> {
        let optional = |name: &str| batch.column_by_name(name).map(|_| name.to_string());
        let relabel = rule
            .map(|rule| {
                let [obstacle_points, class, protrusion_m, slope_rad] = labels::COLUMNS;
                Ok::<_, String>(Relabel {
                    rule,
                    obstacle_points: column(batch, obstacle_points)?,
                    class: column(batch, class)?,
                    protrusion_m: column(batch, protrusion_m)?,
                    slope_rad: column(batch, slope_rad)?,
                })
            })
            .transpose()?;
        Ok(Columns {
            scene_id: column(batch, "scene_id")?,
            scan_id: column(batch, "scan_id")?,
            row: column(batch, "row")?,
            col: column(batch, "col")?,
            label: column(batch, "label")?,
            points: column(batch, "points")?,
            range_m: column(batch, "range_m")?,
            height_difference_m: optional(HEIGHT_DIFFERENCE).map(|name| column(batch, &name)).transpose()?,
            obstacle_points: optional(OBSTACLE_POINTS).map(|name| column(batch, &name)).transpose()?,
            top_points: optional(TOP_POINTS).map(|name| column(batch, &name)).transpose()?,
            class: optional(CLASS).map(|name| column(batch, &name)).transpose()?,
            features: model.about.features.iter().map(|name| column(batch, name)).collect::<Result<_, _>>()?,
            relabel,
        })
    }

    /// Adds a row to its scan, or counts why it cannot be judged.
    fn push(&self, row: usize, scan: &mut Scan, judge: &mut Judge) {
        let untraversable = match &self.relabel {
            _ if self.label.is_null(row) => {
                judge.unknown_cells += 1;
                return;
            }
            Some(relabel) => relabel.untraversable(row),
            None => self.label.value(row) != 0,
        };
        let start = scan.features.len();
        scan.features.extend(self.features.iter().map(|c| if c.is_valid(row) { c.value(row) } else { f32::NAN }));
        if scan.features[start..].iter().any(|value| !value.is_finite()) {
            scan.features.truncate(start);
            judge.not_finite_cells += 1;
            return;
        }
        let count = |column: Option<&PrimitiveArray<Int32Type>>| column.map_or(0, |c| c.value(row));
        scan.cells.push(Cell {
            row: self.row.value(row),
            col: self.col.value(row),
            untraversable,
            points: self.points.value(row),
            obstacle_points: count(self.obstacle_points),
            top_points: count(self.top_points),
            range_m: self.range_m.value(row),
            height_difference_m: self.height_difference_m.map_or(0.0, |c| c.value(row)),
            class: self.class.filter(|c| c.is_valid(row)).map(|c| c.value(row)),
        });
    }
}

impl Relabel<'_> {
    fn untraversable(&self, row: usize) -> bool {
        let truth = Truth {
            obstacle_points: self.obstacle_points.value(row),
            class: self.class.value(row),
            protrusion_m: self.protrusion_m.value(row),
            slope_rad: self.slope_rad.value(row),
        };
        self.rule.label(&truth) != 0
    }
}

fn column<'b, T: ArrowPrimitiveType>(batch: &'b RecordBatch, name: &str) -> Result<&'b PrimitiveArray<T>, String> {
    let found = batch.column_by_name(name).ok_or_else(|| format!("it has no column '{name}'"))?;
    let typed = found.as_any().downcast_ref::<PrimitiveArray<T>>();
    typed.ok_or_else(|| format!("its column '{name}' is {:?}, not {:?}", found.data_type(), T::DATA_TYPE))
}
