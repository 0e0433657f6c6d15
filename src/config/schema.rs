//! The types -> JSON Schemas (draft 2020-12) of the files a user writes.
//!
//! Descriptions are the doc comments. Ranges stand once, in the types' `within` rules: the schema learns them by asking the
//! rules about values that are far too large, so that schema and rules cannot drift apart.

use std::sync::LazyLock;

use garde::Validate;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json, json};

use super::document::Document;
use super::form::{Form, Schema};
use super::presets::shipped;
use crate::cells::CellParams;
use crate::drive::{DriveParams, Rover};
use crate::plan::SECTIONS;
use crate::scene::SceneParams;
use crate::slam::SlamParams;
use crate::sweep::{Sensor, SweepParams};
#[cfg(feature = "train")]
use crate::train::TrainParams;

/// A kind of file that has a schema.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Corpus,
    Rover,
    Sensor,
    #[cfg(feature = "train")]
    Train,
}

impl Kind {
    #[cfg(feature = "train")]
    pub const ALL: [Kind; 4] = [Kind::Corpus, Kind::Rover, Kind::Sensor, Kind::Train];

    /// As in `schemas/NAME.schema.json`.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Corpus => "corpus",
            Kind::Rover => "rover",
            Kind::Sensor => "sensor",
            #[cfg(feature = "train")]
            Kind::Train => "train",
        }
    }
}

/// The schema of one kind of file.
pub fn schema(kind: Kind) -> &'static Json {
    static CORPUS: LazyLock<Json> = LazyLock::new(corpus);
    static ROVER: LazyLock<Json> = LazyLock::new(|| ranged::<Rover>("rover"));
    static SENSOR: LazyLock<Json> = LazyLock::new(|| ranged::<Sensor>("sensor"));
    #[cfg(feature = "train")]
    static TRAIN: LazyLock<Json> = LazyLock::new(|| ranged::<TrainParams>("train"));
    match kind {
        Kind::Corpus => &CORPUS,
        Kind::Rover => &ROVER,
        Kind::Sensor => &SENSOR,
        #[cfg(feature = "train")]
        Kind::Train => &TRAIN,
    }
}

fn corpus() -> Json {
    let mut schema = titled::<Document>("corpus");
    let head = sample(Schema::of(&schema), 0, true);
    let mut bounds = bounds_of::<Document>(&head);
    for variant in 0..MOST_VARIANTS {
        bounds.extend(section_bounds::<SceneParams>(&schema, "scene", variant));
        bounds.extend(section_bounds::<DriveParams>(&schema, "drive", variant));
        bounds.extend(section_bounds::<SweepParams>(&schema, "sweep", variant));
        bounds.extend(section_bounds::<SlamParams>(&schema, "slam", variant));
        bounds.extend(section_bounds::<CellParams>(&schema, "cells", variant));
    }
    for (path, rule) in bounds {
        bound(&mut schema, &path, &rule);
    }
    // Editors offer the shipped names.
    for (def, key) in [("RoverPreset", "rover"), ("SensorPreset", "sensor")] {
        let names: Vec<&str> = shipped(key).iter().map(|(name, _)| *name).collect();
        schema["$defs"][def]["anyOf"][0]["examples"] = json!(names);
    }
    families_are_partial(&mut schema);
    schema
}

/// Choices have at most this many variants.
const MOST_VARIANTS: usize = 8;

fn ranged<T: JsonSchema + DeserializeOwned + Validate<Context = ()>>(name: &str) -> Json {
    let mut schema = titled::<T>(name);
    for variant in 0..MOST_VARIANTS {
        for (path, rule) in bounds_of::<T>(&sample(Schema::of(&schema), variant, false)) {
            bound(&mut schema, &path, &rule);
        }
    }
    schema
}

fn titled<T: JsonSchema>(name: &str) -> Json {
    let mut schema = schemars::schema_for!(T).to_value();
    schema["title"] = format!("marsyard {name}").into();
    schema
}

fn section_bounds<T: DeserializeOwned + Validate<Context = ()>>(
    schema: &Json,
    section: &str,
    variant: usize,
) -> Vec<(Vec<String>, String)> {
    let Some(part) = Schema::of(schema).child(section) else { return Vec::new() };
    let mut bounds = bounds_of::<T>(&sample(part, variant, false));
    for (path, _) in &mut bounds {
        path.insert(0, section.into());
    }
    bounds
}

/// A value of the schema's shape in which every number is far too large and every optional part is there.
fn sample(schema: Schema, variant: usize, head_only: bool) -> Json {
    match schema.form() {
        Form::Struct(part) | Form::Preset(part) => {
            let properties = part["properties"].as_object().into_iter().flatten();
            let kept = properties.filter(|(name, _)| !head_only || !SECTIONS.contains(&name.as_str()));
            kept.map(|(name, part)| (name.clone(), sample(schema.at(part), variant, head_only)))
                .collect::<Map<_, _>>()
                .into()
        }
        Form::Choice(variants) => {
            let chosen = &variants[variant % variants.len()];
            match chosen.content {
                Some(content) => json!({ chosen.name: sample(schema.at(content), variant, head_only) }),
                None => chosen.name.into(),
            }
        }
        Form::Dist(_) | Form::Number => json!(1e300),
        Form::List(part) => {
            let items = part["minItems"].as_u64().unwrap_or(1).max(1);
            (0..items).map(|_| sample(schema.at(&part["items"]), variant, head_only)).collect()
        }
        // 0 is legal or refused by the type's own rule; larger numbers might be refused by the type's width.
        Form::Integer(part) => part["minimum"].as_u64().unwrap_or(0).into(),
        Form::Text => "x".into(),
        Form::Bool => false.into(),
    }
}

/// What the rules say of a sample: (path by keys, message).
fn bounds_of<T: DeserializeOwned + Validate<Context = ()>>(sample: &Json) -> Vec<(Vec<String>, String)> {
    let value: T = serde_json::from_value(sample.clone()).expect("a sample of a type's own schema reads as that type");
    let Err(report) = value.validate() else { return Vec::new() };
    report.iter().map(|(path, error)| (keys_along(sample, &path.to_string()), error.to_string())).collect()
}

/// A rule's path (`source[0].rms_height_m`) -> the keys along it; list positions are `[]`.
fn keys_along(sample: &Json, path: &str) -> Vec<String> {
    let mut keys = Vec::new();
    let mut here = sample;
    for step in path.split(['.', '[']).filter(|step| !step.is_empty()) {
        match (step.strip_suffix(']'), here) {
            (Some(index), Json::Array(items)) => {
                keys.push("[]".into());
                here = &items[index.parse::<usize>().unwrap_or(0)];
            }
            // The content of a variant, or of a preset written out.
            (Some(_), Json::Object(entries)) if entries.len() == 1 => {
                let (name, content) = entries.iter().next().expect("one entry");
                keys.push(name.clone());
                here = content;
            }
            (Some(_), _) => (),
            (None, _) => {
                keys.push(step.into());
                here = &here[step];
            }
        }
    }
    keys
}

/// Writes a rule's bounds into the schema. Beside a reference they apply to numbers alone, as they should.
fn bound(schema: &mut Json, path: &[String], rule: &str) {
    let Some(pointer) = pointer_to(Schema::of(schema), path) else { return };
    let Some(part) = schema.pointer_mut(&pointer) else { return };
    if let Some(interval) = rule.strip_prefix("must lie in [").and_then(|rest| rest.split_once(']')) {
        let mut ends = interval.0.split(", ").filter_map(|end| end.parse::<f64>().ok());
        if let (Some(low), Some(high)) = (ends.next(), ends.next()) {
            part["minimum"] = json!(low);
            part["maximum"] = json!(high);
        }
    } else if let Some(values) = rule.strip_prefix("must be ").and_then(|rest| rest.split_once(", got")) {
        let words = values.0.split([' ', ',']);
        let numbers: Vec<u64> = words.filter_map(|word| word.parse().ok()).collect();
        if !numbers.is_empty() {
            part["enum"] = json!(numbers);
        }
    }
}

/// The JSON pointer of what a path of keys leads to.
fn pointer_to(schema: Schema, path: &[String]) -> Option<String> {
    let mut pointer = String::new();
    let mut part = schema.part;
    for key in path {
        // Definitions are entered by their own address, so that what is written there is written once.
        loop {
            if let Some(name) = part["$ref"].as_str() {
                pointer = name.trim_start_matches('#').to_owned();
                part = &schema.defs[name.trim_start_matches("#/$defs/")];
            } else if let Some(any) = part["anyOf"].as_array() {
                let index = any.iter().rposition(|p| p.get("$ref").is_some())?;
                pointer += &format!("/anyOf/{index}");
                part = &any[index];
            } else {
                break;
            }
        }
        if key == "[]" {
            pointer += "/items";
            part = &part["items"];
        } else if let Some(one_of) = part["oneOf"].as_array() {
            let index = one_of.iter().position(|option| option["properties"].get(key).is_some())?;
            pointer += &format!("/oneOf/{index}/properties/{key}");
            part = &one_of[index]["properties"][key];
        } else {
            pointer += &format!("/properties/{key}");
            part = part["properties"].get(key)?;
        }
    }
    Some(pointer)
}

/// Families override: their sections are the sections' types with nothing required and no defaults.
fn families_are_partial(schema: &mut Json) {
    let defs = schema["$defs"].as_object().cloned().unwrap_or_default();
    let mut partial = Map::new();
    let mut waiting: Vec<String> = Vec::new();
    for section in SECTIONS {
        let part = &mut schema["$defs"]["FamilyDocument"]["properties"][section];
        redirect(part, &defs, &mut waiting);
    }
    while let Some(name) = waiting.pop() {
        let key = format!("{name}Override");
        if partial.contains_key(&key) {
            continue;
        }
        let mut def = defs[&name].clone();
        if let Some(object) = def.as_object_mut().filter(|object| object.contains_key("properties")) {
            object.remove("required");
        }
        redirect(&mut def, &defs, &mut waiting);
        partial.insert(key, def);
    }
    if let Some(all) = schema["$defs"].as_object_mut() {
        all.extend(partial);
    }
}

/// Points references at the overriding kind of what they point at; laws stay as they are.
fn redirect(part: &mut Json, defs: &Map<String, Json>, waiting: &mut Vec<String>) {
    match part {
        Json::Object(object) => {
            object.remove("default");
            if let Some(Json::String(reference)) = object.get_mut("$ref") {
                let name = reference.trim_start_matches("#/$defs/").to_owned();
                if !["Dist", "Law"].contains(&name.as_str()) && defs.contains_key(&name) {
                    *reference = format!("#/$defs/{name}Override");
                    waiting.push(name);
                }
            }
            for (_, child) in object.iter_mut() {
                redirect(child, defs, waiting);
            }
        }
        Json::Array(items) => items.iter_mut().for_each(|item| redirect(item, defs, waiting)),
        _ => (),
    }
}

/// As written to `schemas/`.
pub fn schema_text(kind: Kind) -> String {
    let mut text = serde_json::to_string_pretty(schema(kind)).expect("a schema is JSON");
    text.push('\n');
    text
}
