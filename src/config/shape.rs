//! A tree and the schema -> everything whose shape is wrong: unknown keys, missing keys, wrong types, unknown variants.
//!
//! The schema comes from the types, so that what is checked here is what serde reads later; unlike serde, this goes on
//! after a fault. Ranges are not looked at: they are the types' own rules.

use serde_json::Value as Json;

use super::error::{Fault, quoted};
use super::form::{Form, Schema, Variant, joined, keys_of, laws, meaning, required};
use super::names::{did_you_mean, listed};
use super::tree::{Node, Source, Value};

/// Checks a whole tree; see [`check`].
pub(super) struct Shape<'s> {
    root: Schema<'s>,
    sources: &'s [Source],
    faults: Vec<Fault>,
}

/// Everything whose shape is wrong below `node`, which stands at the dotted `path` of the document.
pub(super) fn check(node: &Node, schema: Schema, path: &str, root: &Json, sources: &[Source]) -> Vec<Fault> {
    let root = Schema::of(root);
    let mut shape = Shape { root, sources, faults: Vec::new() };
    shape.node(node, Schema { defs: schema.defs, part: schema.part }, path);
    shape.faults
}

impl Shape<'_> {
    fn node(&mut self, node: &Node, schema: Schema, path: &str) {
        if matches!(node.value, Value::Null) {
            return self.null(node, schema, path);
        }
        match (schema.form(), &node.value) {
            (Form::Struct(part), Value::Map(_)) => self.mapping(node, part, schema, path),
            (Form::Preset(part), Value::Map(_)) => self.mapping(node, part, schema, path),
            // Names are looked up where presets are written out.
            (Form::Preset(_), Value::Text(_)) => (),
            (Form::Preset(_), _) => {
                self.wrong(node, path, "the name of a preset, a path to a file, or a mapping", None)
            }
            (Form::Struct(part), _) => {
                let keys = keys_of(part);
                self.wrong(node, path, "a mapping", Some(format!("its keys are {}", listed(keys))));
            }
            (Form::Choice(variants), _) => self.choice(node, &variants, schema, path),
            (Form::Dist(_), Value::Int(_) | Value::Float(_)) => self.finite(node, path),
            (Form::Dist(variants), Value::Map(_)) => self.choice(node, &variants, schema, path),
            (Form::Dist(_), Value::Seq(items)) if items.len() == 2 => {
                let pair: Vec<String> = items.iter().map(|item| item.to_json().to_string()).collect();
                let cure = format!("for a range write {{uniform: [{}]}}", quoted(&pair.join(", ")));
                self.wrong(node, path, "a number or a distribution", Some(cure));
            }
            (Form::Dist(variants), _) => {
                let cure =
                    format!("a distribution is a mapping with one key: {}", listed(variants.iter().map(|v| v.name)));
                self.wrong(node, path, "a number or a distribution", Some(quoted_number(node).unwrap_or(cure)));
            }
            (Form::List(part), Value::Seq(items)) => self.list(node, items, part, schema, path),
            (Form::List(_), _) => self.wrong(node, path, "a list", Some("write [a, b, ...]".into())),
            (Form::Number, Value::Int(_) | Value::Float(_)) => self.finite(node, path),
            (Form::Number, Value::Map(entries)) if entries.first().is_some_and(|(key, _)| self.is_law(&key.name)) => {
                self.wrong(
                    node,
                    path,
                    "a number",
                    Some("this value is fixed for the whole corpus: it cannot be drawn".into()),
                );
            }
            (Form::Number, _) => self.wrong(node, path, "a number", quoted_number(node)),
            (Form::Integer(part), Value::Int(value)) => {
                let default_low =
                    if part["format"].as_str().is_some_and(|f| f.starts_with("uint")) { 0 } else { i64::MIN.into() };
                let default_high = if part["format"] == "uint64" { u64::MAX.into() } else { u32::MAX.into() };
                let low = part["minimum"].as_i64().map_or(default_low, i128::from);
                let high = part["maximum"].as_u64().map_or(default_high, i128::from);
                if *value < low || *value > high {
                    let rule = format!(
                        "'{path}' must be a whole number in [{low}, {high}], got {}",
                        quoted(&value.to_string())
                    );
                    self.faults.push(with_cure(Fault::new(node.span, rule), meaning(schema, path)));
                }
            }
            (Form::Integer(_), Value::Float(value)) => {
                // Above 2^53 the decimals are not what was written.
                let whole = value.abs() < 9e15 && *value == value.trunc();
                let cure = if whole {
                    Some(format!("write {}", quoted(&format!("{value:.0}"))))
                } else {
                    meaning(schema, path)
                };
                self.wrong(node, path, "a whole number", cure);
            }
            (Form::Integer(_), _) => self.wrong(node, path, "a whole number", quoted_number(node)),
            (Form::Bool, Value::Bool(_)) | (Form::Text, Value::Text(_)) => (),
            (Form::Bool, _) => self.wrong(node, path, "true or false", None),
            (Form::Text, Value::Int(_) | Value::Float(_) | Value::Bool(_)) => {
                self.wrong(node, path, "text", Some("put it in quotes".into()));
            }
            (Form::Text, _) => self.wrong(node, path, "text", None),
        }
    }

    fn null(&mut self, node: &Node, schema: Schema, path: &str) {
        let text = &self.sources[node.span.source].text;
        let written = ["null", "~", "Null", "NULL"].iter().any(|word| text[node.span.start..].starts_with(word));
        if !schema.nullable() {
            let keys = match schema.form() {
                Form::Struct(part) => {
                    Some(format!("its keys are {}; take it out for its defaults", listed(keys_of(part))))
                }
                Form::Choice(variants) => Some(format!("choose {}", listed(variants.iter().map(|v| v.name)))),
                _ => None,
            };
            self.faults.push(with_cure(Fault::new(node.span, format!("'{path}' has no value")), keys));
        } else if !written {
            // `range_noise:` with nothing behind it might be meant as "on" or as "off".
            let all_default =
                matches!(schema.form(), Form::Struct(part) if part["required"].as_array().is_none_or(Vec::is_empty));
            let on = if all_default { "write {} for its defaults, " } else { "fill it in, " };
            let cure = format!("{on}null to switch it off, or take the key out");
            self.faults.push(Fault::new(node.span, format!("'{path}' is empty")).cure(cure));
        }
    }

    fn mapping(&mut self, node: &Node, part: &serde_json::Value, schema: Schema, path: &str) {
        for (key, value) in node.entries() {
            match part["properties"].get(&key.name) {
                Some(property) => self.node(value, schema.at(property), &joined(path, &key.name)),
                None => {
                    let place = if path.is_empty() { String::new() } else { format!(" in '{path}'") };
                    let rule = format!("unknown key '{}'{place}", super::tree::shortened(&key.name));
                    let near = did_you_mean(&key.name, keys_of(part));
                    let cure = near.map(|name| format!("did you mean '{name}'?"));
                    let cure = cure.or_else(|| self.home_of(&key.name).map(|home| format!("it belongs in '{home}'")));
                    let cure = cure.unwrap_or_else(|| format!("the keys here are {}", listed(keys_of(part))));
                    self.faults.push(Fault::new(key.span, rule).cure(cure));
                }
            }
        }
        let missing: Vec<&str> = required(part).filter(|name| node.get(name).is_none()).collect();
        if !missing.is_empty() {
            let place = if path.is_empty() { "the config".into() } else { format!("'{path}'") };
            let quoted: Vec<String> = missing.iter().map(|name| format!("'{name}'")).collect();
            let names = listed(quoted.iter().map(String::as_str)).replace(" or ", " and ");
            let plural = if missing.len() == 1 { "" } else { "s" };
            let meanings = missing.iter().filter_map(|name| meaning(schema.at(&part["properties"][name]), name));
            let meanings = meanings.collect::<Vec<_>>().join("\n");
            let fault = Fault::new(node.span, format!("{place} needs the key{plural} {names}"));
            self.faults.push(with_cure(fault, (!meanings.is_empty()).then_some(meanings)));
        }
    }

    fn choice(&mut self, node: &Node, variants: &[Variant], schema: Schema, path: &str) {
        let all = || variants.iter().map(|v| v.name);
        let unknown = |name: &str| {
            let rule = format!("'{path}' cannot be '{}'", super::tree::shortened(name));
            let cure = match did_you_mean(name, all()) {
                Some(near) => format!("did you mean '{near}'?"),
                None => format!("choose {}", listed(all())),
            };
            (rule, cure)
        };
        match &node.value {
            Value::Text(word) => match variants.iter().find(|v| v.name == word) {
                Some(Variant { content: None, .. }) => (),
                Some(Variant { content: Some(content), meaning, .. }) => {
                    let last = path.rsplit('.').next().unwrap_or(path);
                    let (lacks, cure) = match schema.at(content).form() {
                        Form::Struct(part) if part["required"].as_array().is_none_or(Vec::is_empty) => {
                            ("settings", format!("write {{{word}: {{}}}} for its defaults"))
                        }
                        Form::Struct(part) => {
                            ("settings", format!("write {{{word}: {{...}}}} with {}", listed(required(part))))
                        }
                        _ => {
                            let meaning =
                                meaning.map_or(String::new(), |text| format!(": {}", text.replace('\n', " ")));
                            ("a value", format!("write {last}: {{{word}: VALUE}}{meaning}"))
                        }
                    };
                    self.faults.push(Fault::new(node.span, format!("'{path}: {word}' needs {lacks}")).cure(cure));
                }
                None => {
                    let (rule, cure) = unknown(word);
                    self.faults.push(Fault::new(node.span, rule).cure(cure));
                }
            },
            Value::Map(entries) => match entries.as_slice() {
                [(key, value)] => match variants.iter().find(|v| v.name == key.name) {
                    Some(Variant { content: Some(content), .. }) => {
                        self.node(value, schema.at(content), &joined(path, &key.name));
                    }
                    Some(Variant { name, content: None, .. }) => {
                        let last = path.rsplit('.').next().unwrap_or(path);
                        let fault = Fault::new(key.span, format!("'{path}: {name}' takes no settings"));
                        self.faults.push(fault.cure(format!("write {last}: {name}")));
                    }
                    None => {
                        let (rule, cure) = unknown(&key.name);
                        self.faults.push(Fault::new(key.span, rule).cure(cure));
                    }
                },
                [] => self.faults.push(
                    Fault::new(node.span, format!("'{path}' is empty")).cure(format!("choose {}", listed(all()))),
                ),
                [first, rest @ ..] => {
                    let names = listed(entries.iter().map(|(key, _)| key.name.as_str())).replace(" or ", " and ");
                    let rule = format!("'{path}' is one thing, got {}", quoted(&names));
                    let mut fault = Fault::new(first.0.span, rule).cure(format!("choose one of {}", listed(all())));
                    for (key, _) in rest {
                        fault = fault.also(key.span, "and here");
                    }
                    self.faults.push(fault);
                }
            },
            _ => {
                let form = |variant: &Variant| match variant.content {
                    Some(_) => format!("{{{}: ...}}", variant.name),
                    None => variant.name.to_owned(),
                };
                let forms: Vec<String> = variants.iter().map(form).collect();
                self.wrong(node, path, &listed(forms.iter().map(String::as_str)), number_for(node, variants, schema));
            }
        }
    }

    fn list(&mut self, node: &Node, items: &[Node], part: &serde_json::Value, schema: Schema, path: &str) {
        let least = part["minItems"].as_u64().unwrap_or(0) as usize;
        let most = part["maxItems"].as_u64().map_or(usize::MAX, |most| most as usize);
        if items.len() < least || items.len() > most {
            let limit = match items.len() > most {
                _ if least == most => format!("{least}"),
                true => format!("at most {most}"),
                false => format!("at least {least}"),
            };
            let plural = if limit.ends_with(" 1") { "" } else { "s" };
            self.faults
                .push(Fault::new(node.span, format!("'{path}' needs {limit} value{plural}, got {}", items.len())));
        }
        for (i, item) in items.iter().enumerate() {
            self.node(item, schema.at(&part["items"]), &format!("{path}[{i}]"));
        }
    }

    fn finite(&mut self, node: &Node, path: &str) {
        if let Value::Float(value) = node.value
            && !value.is_finite()
        {
            self.wrong(node, path, "a finite number", None);
        }
    }

    fn wrong(&mut self, node: &Node, path: &str, expected: &str, cure: Option<String>) {
        let name = if path.is_empty() { "the config".into() } else { format!("'{path}'") };
        let fault = Fault::new(node.span, format!("{name} must be {expected}, got {}", node.kind()));
        self.faults.push(with_cure(fault, cure));
    }

    fn is_law(&self, name: &str) -> bool {
        laws(self.root).any(|(law, _)| law == name)
    }

    /// Where in the document a key of this name has its place, if in one place only.
    fn home_of(&self, key: &str) -> Option<String> {
        let mut homes = Vec::new();
        find_key(self.root, key, "", 0, &mut homes);
        homes.sort();
        homes.dedup();
        match homes.as_slice() {
            [one] if !one.is_empty() => Some(one.clone()),
            _ => None,
        }
    }
}

fn find_key(schema: Schema, key: &str, path: &str, depth: usize, homes: &mut Vec<String>) {
    if depth > 8 || path == "families" {
        return;
    }
    let entries: Vec<(&str, &serde_json::Value)> = match schema.form() {
        Form::Struct(part) => {
            part["properties"].as_object().into_iter().flatten().map(|(k, v)| (k.as_str(), v)).collect()
        }
        Form::Choice(variants) => variants.iter().filter_map(|v| v.content.map(|content| (v.name, content))).collect(),
        _ => return,
    };
    for (name, part) in entries {
        if name == key {
            homes.push(path.to_owned());
        }
        find_key(schema.at(part), key, &joined(path, name), depth + 1, homes);
    }
}

/// The variant that a bare number was probably meant for.
fn number_for(node: &Node, variants: &[Variant], schema: Schema) -> Option<String> {
    let takes = |variant: &&Variant| match variant.content.map(|content| schema.at(content).form()) {
        Some(Form::Integer(_)) => matches!(node.value, Value::Int(_)),
        Some(Form::Number) => matches!(node.value, Value::Int(_) | Value::Float(_)),
        _ => false,
    };
    let variant = variants.iter().find(takes)?;
    Some(format!("write {{{}: {}}}", variant.name, quoted(&node.to_json().to_string())))
}

fn quoted_number(node: &Node) -> Option<String> {
    match &node.value {
        Value::Text(text) if text.trim().parse::<f64>().is_ok() => Some("take the quotes off".into()),
        _ => None,
    }
}

fn with_cure(fault: Fault, cure: Option<String>) -> Fault {
    match cure {
        Some(cure) => fault.cure(cure),
        None => fault,
    }
}
