//! Rovers and sensors by name or by path -> their trees, in place of the name.

use std::path::Path;

use super::error::Fault;
use super::names::{did_you_mean, listed};
use super::reader::Reader;
use super::tree::{Key, Node, Source, Value};
use crate::drive::DriveParams;
use crate::sweep::SweepParams;

struct Kind {
    section: &'static str,
    key: &'static str,
    shipped: &'static [(&'static str, &'static str)],
}

macro_rules! shipped {
    ($folder:literal: $($name:literal)*) => {
        &[$(($name, include_str!(concat!("../../configs/", $folder, "/", $name, ".yaml")))),*]
    };
}

const KINDS: [Kind; 2] = [
    Kind { section: "drive", key: "rover", shipped: shipped!("rovers": "kapvik" "pioneer-3at" "husky-a200") },
    Kind {
        section: "sweep",
        key: "sensor",
        shipped: shipped!("sensors": "urg-04lx" "utm-30lx" "lms111" "lms291" "vlp-16" "os1-64" "raster" "rosette"),
    },
];

/// Names of the shipped rovers and sensors, with their YAML texts.
pub fn shipped(key: &str) -> &'static [(&'static str, &'static str)] {
    KINDS.iter().find(|kind| kind.key == key).map_or(&[], |kind| kind.shipped)
}

/// Names the types' default rover and sensor where a document names none.
pub(crate) fn name_defaults(root: &mut Node) {
    let defaults = [DriveParams::default().rover.name(), SweepParams::default().sensor.name()];
    for (kind, name) in KINDS.iter().zip(defaults) {
        let span = root.span;
        let Value::Map(sections) = &mut root.value else { continue };
        let key = |name: &str, span| Key { name: name.into(), span };
        let at = sections.iter().position(|(key, _)| key.name == kind.section).unwrap_or_else(|| {
            sections.push((key(kind.section, span), Node::new(span, Value::Map(Vec::new()))));
            sections.len() - 1
        });
        let section = &mut sections[at].1;
        let (span, lacks) = (section.span, section.get(kind.key).is_none());
        if let Value::Map(keys) = &mut section.value
            && lacks
        {
            keys.push((key(kind.key, span), Node::new(span, Value::Text(name))));
        }
    }
}

/// Writes the presets out that the sections of a document (or of a family) name.
pub(crate) fn write_out(sections: &mut Node, reader: &mut Reader, faults: &mut Vec<Fault>) {
    for kind in &KINDS {
        let Some(node) = sections.get_mut(kind.section).and_then(|section| section.get_mut(kind.key)) else { continue };
        let Value::Text(name) = &node.value else { continue };
        match tree_of(kind, &name.clone(), node, reader) {
            Ok(tree) => *node = Node { whole: true, ..tree },
            // The name stays in the tree; the fault already says it all.
            Err(fault) => faults.push(fault),
        }
    }
}

fn tree_of(kind: &Kind, name: &str, node: &Node, reader: &mut Reader) -> Result<Node, Fault> {
    if let Some((name, text)) = kind.shipped.iter().find(|(shipped, _)| *shipped == name) {
        let text = (*text).to_owned().into();
        return reader.parse(Source { name: format!("preset {name}"), text, folder: "".into(), is_shown: true });
    }
    let is_path = name.contains('/') || name.ends_with(".yaml") || name.ends_with(".yml");
    if !is_path {
        let names = || kind.shipped.iter().map(|(name, _)| *name);
        let rule = format!("there is no {} '{}'", kind.key, super::tree::shortened(name));
        let cure = match did_you_mean(name, names()) {
            Some(near) => format!("did you mean '{near}'?"),
            None => format!("shipped are {}; a path to your own has a '/' or ends in .yaml", listed(names())),
        };
        return Err(Fault::new(node.span, rule).cure(cure));
    }
    let path = reader.folder(node.span).join(name);
    let shown = if Path::new(name).is_absolute() { name.to_owned() } else { path.display().to_string() };
    let text = reader.path_of(node.span, name).and_then(|path| reader.text_of(&path)).map_err(|why| {
        Fault::new(node.span, format!("the {} file {shown} cannot be read: {why}", kind.key))
            .cure("paths start at the folder of the file that names them")
    })?;
    let folder = path.parent().map(Path::to_owned).unwrap_or_default();
    let is_shown = reader.may_show(&path);
    let tree = reader.parse(Source { name: shown, text: text.into(), folder, is_shown })?;
    if matches!(tree.value, Value::Map(_)) {
        return Ok(tree);
    }
    // A text would be taken for another name, and nothing for a section without one.
    let rule = format!("a {} file is a mapping of its keys, got {}", kind.key, tree.kind());
    Err(Fault::new(tree.span, rule).cure("begin with its keys; `marsyard schema corpus` has them all"))
}
