//! A resolved plan -> YAML that a person can read and `config::load` reads back to the same plan.

use serde_json::{Map, Value as Json};

/// Columns up to which a part is written on one line.
const WIDTH: usize = 110;

/// A JSON value as YAML: short parts on one line, long ones as blocks.
pub(super) fn yaml(value: &Json) -> String {
    let mut out = String::new();
    match value {
        Json::Object(entries) if !entries.is_empty() => block_mapping(entries, 0, &mut out),
        other => {
            out.push_str(&inline(other));
            out.push('\n');
        }
    }
    out
}

fn block_mapping(entries: &Map<String, Json>, indent: usize, out: &mut String) {
    for (key, value) in entries {
        out.push_str(&" ".repeat(indent));
        out.push_str(&scalar_text(key));
        out.push(':');
        after_colon(value, indent + 2, key.len(), out);
    }
}

fn after_colon(value: &Json, indent: usize, used: usize, out: &mut String) {
    let line = inline(value);
    let is_block = matches!(value, Json::Object(entries) if !entries.is_empty())
        || matches!(value, Json::Array(items) if !items.is_empty());
    if !is_block || indent + used + line.len() <= WIDTH {
        out.push(' ');
        out.push_str(&line);
        out.push('\n');
        return;
    }
    out.push('\n');
    match value {
        Json::Object(entries) => block_mapping(entries, indent, out),
        Json::Array(items) => {
            for item in items {
                let line = inline(item);
                out.push_str(&" ".repeat(indent));
                match item {
                    Json::Object(entries) if indent + line.len() > WIDTH => {
                        let mut block = String::new();
                        block_mapping(entries, indent + 2, &mut block);
                        out.push_str("- ");
                        out.push_str(&block[indent + 2..]);
                    }
                    _ => {
                        out.push_str("- ");
                        out.push_str(&line);
                        out.push('\n');
                    }
                }
            }
        }
        _ => unreachable!("scalars are written on the key's line"),
    }
}

/// Flow style.
fn inline(value: &Json) -> String {
    match value {
        Json::Null => "null".into(),
        Json::Bool(b) => b.to_string(),
        Json::Number(number) => number.to_string(),
        Json::String(text) => scalar_text(text),
        Json::Array(items) => format!("[{}]", items.iter().map(inline).collect::<Vec<_>>().join(", ")),
        Json::Object(entries) => {
            let pair = |(key, value): (&String, &Json)| format!("{}: {}", scalar_text(key), inline(value));
            format!("{{{}}}", entries.iter().map(pair).collect::<Vec<_>>().join(", "))
        }
    }
}

/// A plain word where YAML takes it for text; a JSON string, which is YAML too, anywhere else.
fn scalar_text(text: &str) -> String {
    let plain = text.starts_with(|c: char| c.is_ascii_alphabetic())
        && text.chars().all(|c| c.is_ascii_alphanumeric() || "_-./".contains(c))
        && !["null", "true", "false", "yes", "no", "on", "off", "y", "n"].contains(&text.to_lowercase().as_str());
    if plain { text.to_owned() } else { Json::from(text).to_string() }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::config::tree::parse;

    fn any_json() -> impl Strategy<Value = Json> {
        let leaf = prop_oneof![
            Just(Json::Null),
            any::<bool>().prop_map(Json::from),
            any::<u64>().prop_map(Json::from),
            any::<i64>().prop_map(Json::from),
            any::<f64>().prop_filter("JSON has finite numbers", |x| x.is_finite()).prop_map(Json::from),
            "\\PC{0,30}".prop_map(Json::from),
            "[a-z0-9.:#{}\\[\\],&*!|>'\"%@` \n\t~-]{0,12}".prop_map(Json::from),
            prop::sample::select(vec![
                "null", "Yes", "off", "1e5", "0x1", ".nan", "~", "-", "", " a", "a ", "1:2", "é"
            ])
            .prop_map(Json::from),
        ];
        leaf.prop_recursive(5, 60, 6, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..6).prop_map(Json::from),
                prop::collection::vec(("[a-z_0-9 :-]{1,12}", inner), 0..6)
                    .prop_map(|entries| Json::from(entries.into_iter().collect::<Map<_, _>>())),
            ]
        })
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 500, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn equal_values_written_and_read_back(value in any_json()) {
            let text = yaml(&value);
            let read = parse(0, &text, 0).map_err(|fault| TestCaseError::fail(format!("{fault:?}\n{text}")))?;
            prop_assert_eq!(read.to_json(), value, "{}", text);
        }
    }

    #[test]
    fn exact_short_parts_stand_on_one_line() {
        let value = serde_json::json!({"a": {"b": [1, 2.5, "x y"], "c": {}}, "list": ["w".repeat(60), "v".repeat(60)]});
        let (w, v) = ("w".repeat(60), "v".repeat(60));
        assert_eq!(yaml(&value), format!("a: {{b: [1, 2.5, \"x y\"], c: {{}}}}\nlist:\n  - {w}\n  - {v}\n"));
    }
}
