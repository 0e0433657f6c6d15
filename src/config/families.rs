//! A document's tree -> the tree of each family, its own keys laid over the document's, and what is left beside the sections.

use super::document::MAX_FAMILIES;
use super::error::Fault;
use super::form::Schema;
use super::merge::merge;
use super::schema::{Kind, schema};
use super::tree::{Key, Node, Value};
use crate::plan::SECTIONS;

/// Refuses more families than are held, before any of them is laid over the document's sections.
pub(super) fn few_families(root: &Node) -> Result<(), Fault> {
    match root.get("families") {
        Some(Node { span, value: Value::Seq(families), .. }) if families.len() > MAX_FAMILIES => {
            let rule = format!("'families' may have at most {MAX_FAMILIES} entries, got {}", families.len());
            Err(Fault::new(*span, rule).cure("let a law vary what the families differ in, or make several corpora"))
        }
        _ => Ok(()),
    }
}

/// Name and sections of each family, its overrides laid over the document's; one named `default` where there is none.
pub(super) fn family_trees(root: &Node) -> Vec<(String, Node)> {
    let written = match root.get("families").map(|node| &node.value) {
        Some(Value::Seq(families)) => families.iter().filter(|family| matches!(family.value, Value::Map(_))).collect(),
        _ => Vec::new(),
    };
    if written.is_empty() {
        return vec![("default".into(), sections_of(root, None))];
    }
    let name = |family: &Node| match family.get("name").map(|node| &node.value) {
        Some(Value::Text(name)) => name.clone(),
        _ => "?".into(),
    };
    written.into_iter().map(|family| (name(family), sections_of(root, Some(family)))).collect()
}

fn sections_of(root: &Node, family: Option<&Node>) -> Node {
    let mut sections = Vec::new();
    for name in SECTIONS {
        let entry = |node: &Node| node.entries().iter().find(|(key, _)| key.name == name).cloned();
        let merged = match (entry(root), family.and_then(entry)) {
            (Some((key, base)), Some((_, over))) => {
                Some((key, merge(base, over, Schema::of(schema(Kind::Corpus)).child(name))))
            }
            (base, over) => over.or(base),
        };
        sections.extend(merged);
    }
    Node::new(family.unwrap_or(root).span, Value::Map(sections))
}

/// The document's keys outside the sections, families included.
pub(super) fn without_sections(root: &Node) -> Node {
    let kept = root.entries().iter().filter(|(key, _)| !SECTIONS.contains(&key.name.as_str()));
    let head = |(key, node): &(Key, Node)| match &node.value {
        Value::Seq(families) if key.name == "families" => {
            let bare = |family: &Node| match &family.value {
                Value::Map(_) => without_sections(family),
                _ => family.clone(),
            };
            (key.clone(), Node::new(node.span, Value::Seq(families.iter().map(bare).collect())))
        }
        _ => (key.clone(), node.clone()),
    };
    Node::new(root.span, Value::Map(kept.map(head).collect()))
}
