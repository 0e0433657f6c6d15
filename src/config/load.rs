//! Path and overrides -> plan: the steps in their order.

use std::collections::BTreeMap;
use std::path::Path;

use garde::Validate;
use serde::de::DeserializeOwned;

use super::document::Document;
use super::error::{ConfigError, Fault};
use super::families::{family_trees, few_families, without_sections};
use super::fidelity;
use super::form::Schema;
use super::key_path::KeyPath;
use super::overrides::with_set;
use super::presets;
use super::reader::Reader;
use super::remarks;
use super::rules;
use super::schema::{Kind, schema};
use super::shape;
use super::tree::{Node, Source, Span, Value};
use super::values::value_faults;
use crate::plan::{Family, Plan, PlanFile};
use crate::preset::Preset;
use crate::scene::SceneParams;
use crate::scene::params::GroundSource;
use crate::sweep::SweepParams;
use crate::sweep::sensor::PatternParams;

/// Reads, resolves and checks a config; `sets` are overrides like `scene.rocks.count=5`.
///
/// A resolved plan (`plan.yaml`) is a config too, and gives the same plan again.
///
/// All faults of a config come at once, those of overrides first, each with its place, its rule and a cure.
///
/// ```
/// use marsyard::config;
///
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("yard.yaml");
/// let head = "marsyard: 1\nname: yard\nseed: 1\nscenes: 10\nscenes_per_shard: 5\n";
/// std::fs::write(&path, format!("{head}scene: {{extend_m: 20, rocks: {{count: 5, diameter_m: 0.4}}}}\n"))?;
/// let error = config::load(&path, &["cells.neighbours=5".into()]).unwrap_err();
/// let [neighbours, key] = &error.faults[..] else { panic!("{}", error.lines()) };
/// assert_eq!(neighbours.rule, "'cells.neighbours' must be 4, 8 or 24, got 5");
/// assert_eq!((key.line, key.column), (6, 9));
/// assert!(key.cure.as_ref().is_some_and(|cure| cure.contains("extent_m")));
/// // With both mended, the plan: defaults written out, presets read.
/// std::fs::write(&path, format!("{head}scene: {{extent_m: 20, rocks: {{count: 5, diameter_m: 0.4}}}}\n"))?;
/// let plan = config::load(&path, &["cells.neighbours=4".into()])?;
/// assert_eq!((plan.shards(), plan.families[0].cells.neighbours), (2, 4));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn load(path: &Path, sets: &[String]) -> Result<Plan, ConfigError> {
    load_with_remarks(path, sets).map(|(plan, _)| plan)
}

/// As [`load`], with what is legal and hardly meant: one line each, with file, place, rule and cure.
pub fn load_with_remarks(path: &Path, sets: &[String]) -> Result<(Plan, Vec<String>), ConfigError> {
    let mut loader = Loader { reader: Reader::of(path), faults: Vec::new(), remarks: Vec::new() };
    let shown = path.display().to_string();
    match loader.plan(path, sets) {
        Some(plan) if loader.faults.is_empty() => {
            let remarks = ConfigError::new(shown, &loader.reader.sources, loader.remarks).lines();
            Ok((plan, remarks.lines().map(str::to_owned).collect()))
        }
        _ => Err(ConfigError {
            unreachable: loader.reader.unreachable.get(),
            untrusted: loader.reader.untrusted.get(),
            ..ConfigError::new(shown, &loader.reader.sources, loader.faults)
        }),
    }
}

struct Loader {
    reader: Reader,
    faults: Vec<Fault>,
    remarks: Vec<Fault>,
}

impl Loader {
    /// The plan, or at least one fault.
    fn plan(&mut self, path: &Path, sets: &[String]) -> Option<Plan> {
        let root = self.root(path, sets)?;
        let document = self.document(&root);
        let trees = family_trees(&root);
        let families: Vec<Option<Family>> = trees.iter().map(|(name, tree)| self.family(name, tree)).collect();
        let families: Vec<(Family, KeyPath)> = families
            .into_iter()
            .zip(&trees)
            .filter_map(|(family, (_, tree))| Some((family?, KeyPath { root: tree })))
            .collect();
        self.rules_of_families(&families, trees.len());
        if !self.faults.is_empty() || families.len() < trees.len() {
            return None;
        }
        let document = document?;
        let mut plan = Plan {
            marsyard: document.marsyard,
            name: document.name,
            seed: document.seed,
            scenes: document.scenes,
            scenes_per_shard: document.scenes_per_shard,
            tables: document.tables,
            pose_covariance: document.pose_covariance,
            max_failed_share: document.max_failed_share,
            fidelity: document.fidelity,
            card: document.card,
            families: Vec::new(),
            files: Vec::new(),
        };
        for (i, (mut family, place)) in families.into_iter().enumerate() {
            if let Some(head) = document.families.get(i) {
                (family.weight, family.hold_out) = (head.weight, head.hold_out);
            }
            let file = self.read_height_map(&mut family.scene, &place);
            plan.files.extend(file.filter(|file| !plan.files.contains(file)));
            plan.families.push(family);
        }
        remarks::of_families(&plan.families, &KeyPath { root: &root }, &mut self.remarks);
        Some(plan)
    }

    /// The document's tree with presets written out and overrides laid over; `None` where there is nothing to go on with.
    fn root(&mut self, path: &Path, sets: &[String]) -> Option<Node> {
        let folder = path.parent().map(Path::to_owned).unwrap_or_default();
        let shown = path.display().to_string();
        let text = self.reader.text_of(path);
        let (text, unreadable) = text.map_or_else(|why| (String::new(), Some(why)), |text| (text, None));
        if let Some(why) = unreadable {
            self.reader.sources.push(Source { name: shown, text: text.into(), folder, is_shown: true });
            self.faults.push(Fault::new(Span::default(), format!("the config cannot be read: {why}")));
            return None;
        }
        let is_shown = self.reader.may_show(path);
        let mut root = self.kept(|reader| reader.parse(Source { name: shown, text: text.into(), folder, is_shown }))?;
        if !matches!(root.value, Value::Map(_)) {
            let fault = Fault::new(root.span, format!("a config is a mapping, got {}", root.kind()));
            self.faults.push(fault.cure("begin with 'marsyard: 1'"));
            return None;
        }
        self.kept(|_| few_families(&root))?;
        self.write_out_presets(&mut root);
        for argument in sets {
            root = self.kept(|reader| with_set(root, argument, reader, Kind::Corpus))?;
            self.kept(|_| few_families(&root))?;
            self.write_out_presets(&mut root);
        }
        fidelity::lay_under(&mut root, &mut self.reader);
        Some(root)
    }

    fn kept<T>(&mut self, step: impl FnOnce(&mut Reader) -> Result<T, Fault>) -> Option<T> {
        step(&mut self.reader).map_err(|fault| self.faults.push(fault)).ok()
    }

    fn write_out_presets(&mut self, root: &mut Node) {
        presets::name_defaults(root);
        presets::write_out(root, &mut self.reader, &mut self.faults);
        if let Some(Node { value: Value::Seq(families), .. }) = root.get_mut("families") {
            families.iter_mut().for_each(|family| presets::write_out(family, &mut self.reader, &mut self.faults));
        }
    }

    /// The keys outside the sections.
    fn document(&mut self, root: &Node) -> Option<Document> {
        let head = without_sections(root);
        let whole = schema(Kind::Corpus);
        let shape = shape::check(&head, Schema::of(whole), "", whole, &self.reader.sources);
        let sound = shape.is_empty();
        self.faults.extend(shape);
        let document: Document = sound.then(|| self.typed(&head, "the config"))??;
        let place = KeyPath { root: &head };
        self.check_values(&document, &place, "");
        rules::of_document(&document, &place, &mut self.faults);
        Some(document)
    }

    /// One family's sections, if all of them have the right shape.
    fn family(&mut self, name: &str, tree: &Node) -> Option<Family> {
        let scene = self.section(tree, "scene");
        let drive = self.section(tree, "drive");
        let sweep = self.section(tree, "sweep");
        let slam = self.section(tree, "slam");
        let cells = self.section(tree, "cells");
        let mut family = Family {
            name: name.to_owned(),
            weight: 1.0,
            hold_out: false,
            scene: scene?,
            drive: drive?,
            sweep: sweep?,
            slam: slam.unwrap_or_default(),
            cells: cells?,
        };
        if matches!(family.drive.rover, Preset::Inline(_)) {
            resolve_rover(&mut family);
        }
        // A preset that could not be read has its fault already.
        let resolved = matches!((&family.drive.rover, &family.sweep.sensor), (Preset::Inline(_), Preset::Inline(_)));
        (resolved && self.read_pattern(&mut family.sweep, &KeyPath { root: tree }).is_some()).then_some(family)
    }

    /// A section as its type; the faults of its shape, or else of its values, are noted.
    fn section<T: DeserializeOwned + Validate<Context = ()>>(&mut self, tree: &Node, name: &str) -> Option<T> {
        let whole = schema(Kind::Corpus);
        let part = Schema::of(whole).child(name)?;
        let absent = Node::new(tree.span, Value::Map(Vec::new()));
        let node = tree.get(name).unwrap_or(&absent);
        if tree.get(name).is_none() && name == "slam" {
            return None;
        }
        let shape = shape::check(node, part, name, whole, &self.reader.sources);
        let sound = shape.is_empty();
        let rest = if sound { Some(node.clone()) } else { self.sound_part(node, part, name, &shape) };
        self.faults.extend(shape);
        // What has a wrong shape is left out, so that the values of the rest are judged in the same go.
        let section = rest.map(|rest| self.typed(&rest, name))??;
        self.check_values(&section, &KeyPath { root: tree }, name);
        sound.then_some(section)
    }

    /// What is left of a section without the parts that have a wrong shape.
    fn sound_part(&self, node: &Node, part: Schema, name: &str, faults: &[Fault]) -> Option<Node> {
        let mut rest = without(node, faults)?;
        // What loses a part it needs is wrong in its turn, at most once a level.
        loop {
            let faults = shape::check(&rest, part, name, schema(Kind::Corpus), &self.reader.sources);
            if faults.is_empty() {
                return Some(rest);
            }
            rest = without(&rest, &faults)?;
        }
    }

    fn typed<T: DeserializeOwned>(&mut self, node: &Node, name: &str) -> Option<T> {
        let read = serde_json::from_value(node.to_json());
        // The shape was checked against the schema of this very type.
        // What it quotes may be of any of the files that are put together here.
        let is_shown = self.reader.sources.iter().all(|source| source.is_shown);
        let why = |error: serde_json::Error| if is_shown { format!(": {error}") } else { String::new() };
        read.map_err(|error| self.faults.push(Fault::new(node.span, format!("'{name}' cannot be read{}", why(error)))))
            .ok()
    }

    /// The types' own rules: ranges, lengths, laws.
    fn check_values<T: Validate<Context = ()>>(&mut self, value: &T, place: &KeyPath, section: &str) {
        self.faults.extend(value_faults(value, place, section, Kind::Corpus));
    }

    /// Rules between keys, for those families that could be read. A fault of some families says of which.
    fn rules_of_families(&mut self, families: &[(Family, KeyPath)], all: usize) {
        let mut found: BTreeMap<Fault, Vec<&str>> = BTreeMap::new();
        for (family, place) in families {
            let mut faults = Vec::new();
            rules::of_family(family, place, &mut faults);
            remarks::of_family(family, place, &mut self.remarks);
            faults.into_iter().for_each(|fault| found.entry(fault).or_default().push(&family.name));
        }
        for (mut fault, names) in found {
            if names.len() < all {
                fault.rule += &format!(" (in family '{}')", names.join("', '"));
            }
            self.faults.push(fault);
        }
        rules::between_families(families, &mut self.faults);
    }

    /// Puts the beams of a pattern file into the sensor.
    fn read_pattern(&mut self, sweep: &mut SweepParams, place: &KeyPath) -> Option<()> {
        let Preset::Inline(sensor) = &mut sweep.sensor else { return Some(()) };
        let PatternParams::File(file) = &mut sensor.pattern else { return Some(()) };
        if file.beams.is_empty() {
            let span = place.span("sweep.sensor.pattern.file.path");
            let found = self.reader.path_of(span, &file.path).and_then(|path| self.reader.pattern(&path));
            match found {
                Ok(beams) => file.beams = beams,
                Err(why) => {
                    let shown = self.reader.folder(span).join(&file.path);
                    let rule = format!("the pattern file {} cannot be used: {why}", shown.display());
                    self.faults.push(
                        Fault::new(span, rule).cure("a CSV file with the header time_s,azimuth_deg,elevation_deg"),
                    );
                    return None;
                }
            }
        }
        Some(())
    }

    /// Puts the heights of a height map into the scene; its path becomes the one beside `plan.yaml`.
    fn read_height_map(&mut self, scene: &mut SceneParams, place: &KeyPath) -> Option<PlanFile> {
        let GroundSource::File(file) = &mut scene.ground.source else { return None };
        let span = place.span("scene.ground.source.file.path");
        let from = self.reader.folder(span).join(&file.path);
        let map =
            match self.reader.path_of(span, &file.path).and_then(|path| self.reader.height_map(&path, file.height_m)) {
                Ok(map) => map,
                Err(why) => {
                    self.faults
                        .push(Fault::new(span, format!("the height map {} cannot be used: {why}", from.display())));
                    return None;
                }
            };
        if file.blake3.as_ref().is_some_and(|expected| *expected != map.blake3) {
            let rule = format!("the height map {} is another one: its BLAKE3 hash is {}", from.display(), map.blake3);
            let hash = place.span("scene.ground.source.file.blake3");
            self.faults.push(Fault::new(hash, rule).cure("bring the old file back, or take the hash out"));
        }
        let extension = from.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        file.path = format!("height-maps/{}.{extension}", &map.blake3[..16]);
        file.raster = Some(map.raster);
        file.blake3 = Some(map.blake3);
        Some(PlanFile { path: file.path.clone(), from })
    }
}

/// Writes the rover's limits and its height out where cells read them, and leaves the limits where its drive does: plans that do not ask
/// stay as they were.
fn resolve_rover(family: &mut Family) {
    if let Some(overhang) = &mut family.cells.overhang {
        *overhang = overhang.resolved(&family.drive.rover, family.sweep.mount.as_ref());
    }
    if let Some(rule) = &mut family.cells.labels.rover {
        *rule = rule.resolved(&family.drive.rover);
    }
    if let Preset::Inline(rover) = &mut family.drive.rover {
        rover.height_m = None;
        if !family.drive.over_bodies {
            rover.limits = None;
        }
    }
}

/// A tree without what the faults point at; `None` where they point at all of it.
pub(super) fn without(node: &Node, faults: &[Fault]) -> Option<Node> {
    let faulty =
        |span: Span| faults.iter().any(|fault| fault.at == span || fault.also.iter().any(|(also, _)| *also == span));
    if faulty(node.span) {
        return None;
    }
    let value = match &node.value {
        Value::Map(entries) => {
            let kept = entries.iter().filter(|(key, _)| !faulty(key.span));
            Value::Map(kept.filter_map(|(key, node)| Some((key.clone(), without(node, faults)?))).collect())
        }
        Value::Seq(items) => Value::Seq(items.iter().map(|item| without(item, faults)).collect::<Option<_>>()?),
        leaf => leaf.clone(),
    };
    Some(Node { span: node.span, value, whole: node.whole })
}
