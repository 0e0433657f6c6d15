//! Overrides laid over a tree, key by key where the schema says "mapping", whole where it says anything else.
//!
//! A choice (`source: {random: ...}`) with another variant replaces the old one; with the same variant it is merged.

use super::error::Fault;
use super::form::{Form, Schema, required};
use super::tree::{Key, Node, Span, Value};

/// `over` laid over `base`.
pub(super) fn merge(base: Node, over: Node, schema: Option<Schema>) -> Node {
    let Some(schema) = schema.filter(|_| !over.whole) else { return over };
    let (span, whole) = (over.span, base.whole);
    match (base.value, over.value) {
        (Value::Map(old), Value::Map(new)) => {
            let same_variant = || old.len() == 1 && new.len() == 1 && old[0].0.name == new[0].0.name;
            let by_key = match schema.form() {
                Form::Struct(_) => true,
                // A rover or sensor written out in full is another one; a few keys change the one there is.
                Form::Preset(part) => required(part).any(|name| new.iter().all(|(key, _)| key.name != name)),
                Form::Choice(_) | Form::Dist(_) => same_variant(),
                _ => false,
            };
            let value = if by_key { laid_over(old, new, schema) } else { Value::Map(new) };
            Node { span, value, whole }
        }
        (_, value) => Node { span, value, whole },
    }
}

fn laid_over(mut old: Vec<(Key, Node)>, new: Vec<(Key, Node)>, schema: Schema) -> Value {
    for (key, over) in new {
        match old.iter().position(|(existing, _)| existing.name == key.name) {
            Some(at) => {
                let base = std::mem::replace(&mut old[at].1, Node::new(Span::default(), Value::Null));
                old[at] = (key.clone(), merge(base, over, schema.child(&key.name)));
            }
            None => old.push((key, over)),
        }
    }
    Value::Map(old)
}

/// Lays one `--set` over the document: `path` is the dotted key in pieces, each with its place.
pub(super) fn set(base: Option<Node>, path: &[Key], leaf: Node, schema: Option<Schema>) -> Result<Node, Fault> {
    let Some((first, rest)) = path.split_first() else {
        return Ok(Node { whole: true, ..leaf });
    };
    if let Some(Node { value: Value::Seq(mut items), span, whole }) = base {
        let index = first.name.parse::<usize>().ok().filter(|&index| index < items.len());
        let index = index.ok_or_else(|| {
            Fault::new(first.span, format!("'{}' is no place in a list of {}", first.name, items.len()))
                .cure("places are counted from 0")
        })?;
        let item = items[index].clone();
        items[index] = set(Some(item), rest, leaf, schema.and_then(Schema::item))?;
        return Ok(Node { span, value: Value::Seq(items), whole });
    }
    let child_schema = schema.and_then(|schema| schema.child(&first.name));
    // The child holds what was there already. Only the leaf is whole: what stands between it and the root is merged again where
    // it is a family's, laid over the document's section.
    let child = set(base.as_ref().and_then(|node| node.get(&first.name)).cloned(), rest, leaf, child_schema)?;
    Ok(match (base, schema) {
        (Some(Node { span, value: Value::Map(mut entries), whole }), Some(schema))
            if !chooses_another(schema, &entries, first) =>
        {
            match entries.iter_mut().find(|(key, _)| key.name == first.name) {
                Some(entry) => *entry = (first.clone(), child),
                None => entries.push((first.clone(), child)),
            }
            Node { span, value: Value::Map(entries), whole }
        }
        _ => Node::new(first.span, Value::Map(vec![(first.clone(), child)])),
    })
}

/// Whether a key is another variant than the one that stands there.
fn chooses_another(schema: Schema, entries: &[(Key, Node)], key: &Key) -> bool {
    let is_choice = matches!(schema.form(), Form::Choice(_) | Form::Dist(_));
    is_choice && entries.iter().any(|(there, _)| there.name != key.name)
}
