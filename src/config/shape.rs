//! A tree and the schema -> everything whose shape is wrong: unknown keys, missing keys, wrong types, unknown variants.
//!
//! The schema comes from the types, so that what is checked here is what serde reads later; unlike serde, this goes on
//! after a fault. Ranges are not looked at: they are the types' own rules.

use serde_json::Value as Json;

use super::error::{Fault, quoted};
use super::tree::{Node, Source, Value};

/// How a part of the schema can be written, with references and optional wrappers taken off.
pub(crate) enum Form<'s> {
    /// A mapping with fixed keys.
    Struct(&'s Json),
    /// One of several: a bare word, or a mapping with one key.
    Choice(Vec<Variant<'s>>),
    /// A number, or a law as a mapping with one key.
    Dist(Vec<Variant<'s>>),
    /// The name of a preset, or the mapping it stands for.
    Preset(&'s Json),
    List(&'s Json),
    Number,
    Integer(&'s Json),
    Text,
    Bool,
}

pub(crate) struct Variant<'s> {
    pub name: &'s str,
    /// The schema of what the key holds; `None` for a bare word.
    pub content: Option<&'s Json>,
    /// What it means, where the type says.
    pub meaning: Option<&'s str>,
}

/// A schema with its definitions.
#[derive(Clone, Copy)]
pub(crate) struct Schema<'s> {
    pub defs: &'s serde_json::Map<String, Json>,
    pub part: &'s Json,
}

impl<'s> Schema<'s> {
    pub(super) fn of(document: &'s Json) -> Schema<'s> {
        static NONE: std::sync::LazyLock<serde_json::Map<String, Json>> = std::sync::LazyLock::new(Default::default);
        Schema { defs: document["$defs"].as_object().unwrap_or(&NONE), part: document }
    }

    pub(super) fn at(self, part: &'s Json) -> Schema<'s> {
        Schema { part, ..self }
    }

    fn resolved(self) -> &'s Json {
        let mut part = self.part;
        while let Some(name) = part["$ref"].as_str() {
            part = &self.defs[name.trim_start_matches("#/$defs/")];
        }
        part
    }

    /// Whether `null` is legal here (a part that may be switched off).
    pub(crate) fn nullable(self) -> bool {
        let part = self.resolved();
        has_type(part, "null") || part["anyOf"].as_array().is_some_and(|any| any.iter().any(|p| has_type(p, "null")))
    }

    pub(super) fn form(self) -> Form<'s> {
        let part = self.resolved();
        if let Some(any) = part["anyOf"].as_array() {
            let mut real = any.iter().filter(|p| !has_type(p, "null"));
            return match (real.next(), real.next()) {
                (Some(one), None) => self.at(one).form(),
                (Some(first), Some(second)) if has_type(first, "number") => Form::Dist(self.at(second).variants()),
                (Some(_), Some(second)) => Form::Preset(self.at(second).resolved()),
                _ => unreachable!("schemars writes anyOf with alternatives"),
            };
        }
        if part["oneOf"].is_array() || (part["enum"].is_array() && has_type(part, "string")) {
            return Form::Choice(self.variants());
        }
        match () {
            _ if part["properties"].is_object() => Form::Struct(part),
            _ if has_type(part, "array") => Form::List(part),
            _ if has_type(part, "number") => Form::Number,
            _ if has_type(part, "integer") => Form::Integer(part),
            _ if has_type(part, "boolean") => Form::Bool,
            _ => Form::Text,
        }
    }

    fn variants(self) -> Vec<Variant<'s>> {
        let part = self.resolved();
        let one_of = part["oneOf"].as_array().map_or(std::slice::from_ref(part), Vec::as_slice);
        let mut variants = Vec::new();
        for option in one_of {
            let option = self.at(option).resolved();
            let meaning = option["description"].as_str();
            let words = option["enum"].as_array().into_iter().flatten().chain(option.get("const"));
            variants.extend(words.filter_map(Json::as_str).map(|name| Variant { name, content: None, meaning }));
            let keyed = option["properties"].as_object().into_iter().flatten();
            variants.extend(keyed.map(|(name, content)| Variant { name, content: Some(content), meaning }));
        }
        variants
    }

    /// The schema of what a key of this mapping holds.
    pub(super) fn child(self, key: &str) -> Option<Schema<'s>> {
        let part = match self.form() {
            Form::Struct(part) | Form::Preset(part) => part["properties"].get(key)?,
            Form::Choice(variants) | Form::Dist(variants) => variants.into_iter().find(|v| v.name == key)?.content?,
            _ => return None,
        };
        Some(self.at(part))
    }

    /// The schema of a list's entries.
    pub(super) fn item(self) -> Option<Schema<'s>> {
        match self.form() {
            Form::List(part) => Some(self.at(&part["items"])),
            _ => None,
        }
    }

    /// What the key itself means, where its type says more than its name.
    pub(crate) fn own_description(self) -> Option<&'s str> {
        self.part["description"].as_str()
    }
}

fn has_type(part: &Json, name: &str) -> bool {
    match &part["type"] {
        Json::String(one) => one == name,
        Json::Array(several) => several.iter().any(|t| t == name),
        _ => false,
    }
}

/// The one that was most likely meant.
pub(crate) fn did_you_mean<'a>(typed: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace(['-', '_', ' '], "");
    let typed = plain(typed);
    let score = |known: &str| {
        let name = plain(known);
        let unit_less = name.strip_suffix('m').or(name.strip_suffix("deg")).unwrap_or(&name);
        let alike = strsim::jaro_winkler(&typed, &name).max(strsim::jaro_winkler(&typed, unit_less) - 0.01);
        // A name cut short, or one of its words alone, says more than letters in common: 'tall', 'noise'.
        let is_part = typed.len() >= 4 && (name.starts_with(&typed) || known.split('_').any(|word| word == typed));
        if is_part { alike.max(0.95) } else { alike }
    };
    // The first of equals.
    let first = |best: (f64, &'a str), next: (f64, &'a str)| if next.0 > best.0 { next } else { best };
    let best = known.into_iter().map(|name| (score(name), name)).reduce(first)?;
    (best.0 > 0.82).then_some(best.1)
}

/// 'a', 'b' or 'c'.
pub(super) fn listed<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    let names: Vec<&str> = names.into_iter().collect();
    match names.as_slice() {
        [] => "nothing".into(),
        [one] => (*one).into(),
        [rest @ .., last] => format!("{} or {last}", rest.join(", ")),
    }
}

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

fn keys_of(part: &serde_json::Value) -> impl Iterator<Item = &str> {
    part["properties"].as_object().into_iter().flatten().map(|(name, _)| name.as_str())
}

/// The keys that a mapping must have.
pub(super) fn required(part: &serde_json::Value) -> impl Iterator<Item = &str> {
    part["required"].as_array().into_iter().flatten().filter_map(|name| name.as_str())
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

/// The laws of a document, each with its description.
fn laws(document: Schema<'_>) -> impl Iterator<Item = (&str, &str)> {
    let forms = document.defs.get("Law").and_then(|law| law["oneOf"].as_array()).into_iter().flatten();
    forms.filter_map(|form| {
        let (name, _) = form["properties"].as_object()?.iter().next()?;
        Some((name.as_str(), form["description"].as_str()?))
    })
}

/// What the law that a message begins with is.
pub(crate) fn meaning_of_law(document: Schema, message: &str) -> Option<String> {
    let (name, meaning) = laws(document).find(|(name, _)| message.split(' ').next() == Some(name))?;
    Some(format!("{name}: {meaning}"))
}

/// "key: what it means", from the type's own words.
pub(super) fn meaning(schema: Schema, path: &str) -> Option<String> {
    let name = path.rsplit('.').next().unwrap_or(path);
    schema.own_description().map(|text| format!("{name}: {}", text.replace('\n', " ")))
}

fn with_cure(fault: Fault, cure: Option<String>) -> Fault {
    match cure {
        Some(cure) => fault.cure(cure),
        None => fault,
    }
}

pub(crate) fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_likely_slips_find_their_key() {
        let keys = ["extent_m", "ground", "rocks", "boxes", "trees", "vegetation"];
        for (typed, meant) in [
            ("extent", Some("extent_m")),
            ("Extent_M", Some("extent_m")),
            ("rock", Some("rocks")),
            ("rokcs", Some("rocks")),
            ("vegitation", Some("vegetation")),
            ("terrain", None),
            ("", None),
        ] {
            assert_eq!(did_you_mean(typed, keys), meant, "{typed}");
        }
        // A name cut short, and a word of a name; two letters of a name are no guess.
        let rules = ["taller_than_wheel", "all", "taller_than_m"];
        assert_eq!(did_you_mean("tall", rules), Some("taller_than_wheel"));
        assert_eq!(did_you_mean("noise", ["range_noise", "intensity", "gates"]), Some("range_noise"));
        assert_eq!(did_you_mean("xy", rules), None);
    }
}
