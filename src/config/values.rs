//! A value that was read -> what its type's own rules say of it, each with the key's place and meaning.

use garde::Validate;

use super::error::{Fault, quoted};
use super::form::{Schema, meaning, meaning_of_law};
use super::key_path::KeyPath;
use super::schema::{Kind, schema};

/// What a type's own rules say of a value.
pub(super) fn value_faults<T: Validate<Context = ()>>(
    value: &T,
    place: &KeyPath,
    section: &str,
    kind: Kind,
) -> Vec<Fault> {
    let Err(report) = value.validate() else { return Vec::new() };
    let mut faults = Vec::new();
    for (path, error) in report.iter() {
        let joint = if section.is_empty() || path.is_empty() { "" } else { "." };
        let found = place.find(&format!("{section}{joint}{path}"));
        let said = plain(error.message(), found.value);
        let joint =
            if said.starts_with("must") || said.starts_with("needs") || said.starts_with("may") { "" } else { ":" };
        let fault = Fault::new(found.span, format!("'{}'{joint} {said}", found.dotted));
        let schema = Schema::of(schema(kind));
        faults.push(match meaning_of_law(schema, &said).or_else(|| described(schema, &found.dotted)) {
            Some(meaning) => fault.cure(meaning),
            None => fault,
        });
    }
    faults
}

/// A range rule in words, with the value that broke it.
fn plain(message: &str, value: Option<String>) -> String {
    let got = value.map_or(String::new(), |value| format!(", got {}", quoted(&value)));
    for (said, meant) in [
        ("length is lower than ", "needs at least this many entries: "),
        ("length is greater than ", "may have at most this many entries: "),
        ("lower than ", "must be at least "),
        ("greater than ", "must be at most "),
    ] {
        if let Some(limit) = message.strip_prefix(said) {
            return format!("{meant}{limit}{got}");
        }
    }
    // What the file gave stands last.
    match message.split_once(", got ") {
        Some((rule, got)) => format!("{rule}, got {}", quoted(got)),
        None => message.to_owned(),
    }
}

/// What the schema says that a key means.
fn described(schema: Schema<'static>, dotted: &str) -> Option<String> {
    let mut here = schema;
    for step in dotted.split(['.', '[']) {
        here = if step.ends_with(']') { here.item()? } else { here.child(step)? };
    }
    meaning(here, dotted)
}
