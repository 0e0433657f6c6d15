//! A JSON Schema, as schemars writes it -> how each part of a config can be written, what its keys are, and what they mean.

use serde_json::Value as Json;

/// How a part of the schema can be written, with references and optional wrappers taken off.
pub(super) enum Form<'s> {
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

pub(super) struct Variant<'s> {
    pub name: &'s str,
    /// The schema of what the key holds; `None` for a bare word.
    pub content: Option<&'s Json>,
    /// What it means, where the type says.
    pub meaning: Option<&'s str>,
}

/// A schema with its definitions.
#[derive(Clone, Copy)]
pub(super) struct Schema<'s> {
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
    pub(super) fn nullable(self) -> bool {
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
    fn own_description(self) -> Option<&'s str> {
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

pub(super) fn keys_of(part: &serde_json::Value) -> impl Iterator<Item = &str> {
    part["properties"].as_object().into_iter().flatten().map(|(name, _)| name.as_str())
}

/// The keys that a mapping must have.
pub(super) fn required(part: &serde_json::Value) -> impl Iterator<Item = &str> {
    part["required"].as_array().into_iter().flatten().filter_map(|name| name.as_str())
}

/// The laws of a document, each with its description.
pub(super) fn laws(document: Schema<'_>) -> impl Iterator<Item = (&str, &str)> {
    let forms = document.defs.get("Law").and_then(|law| law["oneOf"].as_array()).into_iter().flatten();
    forms.filter_map(|form| {
        let (name, _) = form["properties"].as_object()?.iter().next()?;
        Some((name.as_str(), form["description"].as_str()?))
    })
}

/// What the law that a message begins with is.
pub(super) fn meaning_of_law(document: Schema, message: &str) -> Option<String> {
    let (name, meaning) = laws(document).find(|(name, _)| message.split(' ').next() == Some(name))?;
    Some(format!("{name}: {meaning}"))
}

/// "key: what it means", from the type's own words.
pub(super) fn meaning(schema: Schema, path: &str) -> Option<String> {
    let name = path.rsplit('.').next().unwrap_or(path);
    schema.own_description().map(|text| format!("{name}: {}", text.replace('\n', " ")))
}

pub(super) fn joined(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}
