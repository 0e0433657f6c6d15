//! `fidelity: draft | standard | reference` -> the keys it sets, laid under what the document says.
//!
//! In: the document's tree. Out: the same tree, each key that the document does not name itself filled in. A choice that the
//! document makes (`slam: truth`) stays; within the same choice, keys it leaves out are filled in. A part of the yard or the
//! sensor is never switched on: sub-rays are set only where mixed pixels are modelled. The values come from
//! `marsyard tradeoff configs/paper.yaml` (`scripts/results/tradeoff_paper.md`): casting exactly costs least and errs least in all three,
//! Gauss-Newton less than a twentieth of Nelder-Mead at the same pose. A hundred particles: more gain nothing, fewer save little (`scripts/results/studies.md`).

use super::reader::Reader;
use super::tree::{Key, Node, Source, Value};
use crate::plan::Fidelity;

/// A key and its value as YAML.
pub(crate) type Setting = (&'static str, &'static str);

/// Set only where the document models mixed pixels.
pub(crate) const SUB_RAYS: &str = "sweep.effects.mixed_pixels.sub_rays";

impl Fidelity {
    /// What it sets.
    pub fn settings(self) -> &'static [Setting] {
        match self {
            Fidelity::Draft => {
                &[("sweep.cast", "exact"), ("drive.contact", "plane_fit"), ("slam", "{surrogate: {}}"), (SUB_RAYS, "1")]
            }
            Fidelity::Standard => &[
                ("sweep.cast", "exact"),
                ("drive.contact", "gauss_newton"),
                ("slam", "{fastslam: {particles: 100}}"),
                (SUB_RAYS, "7"),
            ],
            Fidelity::Reference => &[
                ("sweep.cast", "exact"),
                ("drive.contact", "gauss_newton"),
                ("slam", "{fastslam: {particles: 100}}"),
                (SUB_RAYS, "19"),
            ],
        }
    }

    fn of_name(name: &str) -> Option<Fidelity> {
        Fidelity::ALL.into_iter().find(|fidelity| fidelity.name() == name)
    }
}

/// Fills in what the document's `fidelity` sets; a word that is none is left to the schema.
pub(crate) fn lay_under(root: &mut Node, reader: &mut Reader) {
    let Some(Node { value: Value::Text(name), .. }) = root.get("fidelity") else { return };
    let Some(fidelity) = Fidelity::of_name(name) else { return };
    for (key, value) in fidelity.settings() {
        let source = Source {
            name: format!("fidelity {}", fidelity.name()),
            text: (*value).to_owned().into(),
            folder: "".into(),
            is_shown: true,
        };
        let Ok(leaf) = reader.parse(source) else { unreachable!("constant YAML") };
        let path: Vec<&str> = key.split('.').collect();
        if *key != SUB_RAYS {
            fill(root, &path, leaf);
            continue;
        }
        fill_where_named(root, &path, &leaf);
        if let Some(Node { value: Value::Seq(families), .. }) = root.get_mut("families") {
            families.iter_mut().for_each(|family| fill_where_named(family, &path, &leaf));
        }
    }
}

/// Puts a leaf at a path unless something stands there or in the way.
fn fill(node: &mut Node, path: &[&str], leaf: Node) {
    let Value::Map(entries) = &mut node.value else { return };
    let Some((first, rest)) = path.split_first() else {
        fill_choice(entries, leaf);
        return;
    };
    match entries.iter_mut().find(|(key, _)| key.name == *first) {
        Some((_, child)) => fill(child, rest, leaf),
        None => {
            let span = leaf.span;
            let nested = rest.iter().rev().fold(leaf, |inner, name| {
                Node::new(span, Value::Map(vec![(Key { name: (*name).to_owned(), span }, inner)]))
            });
            entries.push((Key { name: (*first).to_owned(), span }, nested));
        }
    }
}

/// The same choice made with fewer keys takes the others over.
fn fill_choice(entries: &mut [(Key, Node)], leaf: Node) {
    let ([(chosen, own)], Value::Map(mut variants)) = (entries, leaf.value) else { return };
    let ([(variant, _)], Value::Map(own)) = (variants.as_slice(), &mut own.value) else { return };
    if variant.name != chosen.name {
        return;
    }
    let Some((_, Node { value: Value::Map(keys), .. })) = variants.pop() else { return };
    for (key, node) in keys {
        if own.iter().all(|(there, _)| there.name != key.name) {
            own.push((key, node));
        }
    }
}

/// As [`fill`], where all but the last piece of the path is there.
fn fill_where_named(node: &mut Node, path: &[&str], leaf: &Node) {
    match path {
        [] => {}
        [last] => fill(node, &[last], leaf.clone()),
        [first, rest @ ..] => {
            if let Some(child) = node.get_mut(first) {
                fill_where_named(child, rest, leaf);
            }
        }
    }
}
