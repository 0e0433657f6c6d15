//! YAML text -> a tree of nodes that know where they stand.
//!
//! Typed reading stops at the first fault and forgets positions inside untagged values. A tree keeps both: it is checked
//! against the schema whole, merged with overrides, and only then read into the stages' types. Budgets bound what a hostile
//! file can cost (YAML bombs); anchors and merge keys are allowed within them.

use std::path::PathBuf;
use std::sync::Arc;

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;

use super::error::{Fault, quoted};

/// Bytes of the largest document; a resolved plan may hold a beam pattern.
const MAX_BYTES: usize = 32 << 20;
const MAX_NODES: usize = 1_200_000;
const MAX_DEPTH: usize = 40;

/// A text that nodes point into: a file, a preset of the binary, or a `--set` argument.
#[derive(Clone, Debug)]
pub(crate) struct Source {
    pub name: String,
    pub text: Arc<String>,
    /// Where relative paths written in it start.
    pub folder: PathBuf,
    /// Whether messages may show what stands in it: not that of files anywhere, which may be anything.
    pub is_shown: bool,
}

/// A place in one of the sources, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Span {
    pub source: usize,
    pub start: usize,
    pub len: usize,
}

#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub span: Span,
    pub value: Value,
    /// Replaces what it overrides instead of being merged into it: presets, and the values of `--set`.
    pub whole: bool,
}

#[derive(Clone, Debug)]
pub(crate) enum Value {
    Null,
    Bool(bool),
    Int(i128),
    Float(f64),
    Text(String),
    Seq(Vec<Node>),
    Map(Vec<(Key, Node)>),
}

#[derive(Clone, Debug)]
pub(crate) struct Key {
    pub name: String,
    pub span: Span,
}

impl Node {
    pub(crate) fn new(span: Span, value: Value) -> Node {
        Node { span, value, whole: false }
    }

    /// The value of a key, where this is a mapping that has it.
    pub(crate) fn get(&self, name: &str) -> Option<&Node> {
        self.entries().iter().find(|(key, _)| key.name == name).map(|(_, node)| node)
    }

    pub(crate) fn get_mut(&mut self, name: &str) -> Option<&mut Node> {
        match &mut self.value {
            Value::Map(entries) => entries.iter_mut().find(|(key, _)| key.name == name).map(|(_, node)| node),
            _ => None,
        }
    }

    /// The entries of a mapping; none for anything else.
    pub(crate) fn entries(&self) -> &[(Key, Node)] {
        match &self.value {
            Value::Map(entries) => entries,
            _ => &[],
        }
    }

    /// What it is, for messages.
    pub(crate) fn kind(&self) -> String {
        match &self.value {
            Value::Null => "nothing".into(),
            Value::Bool(b) => format!("{b}"),
            Value::Int(i) => format!("the number {}", quoted(&i.to_string())),
            Value::Float(f) if f.is_nan() => "NaN".into(),
            Value::Float(f) if f.is_infinite() => "infinity".into(),
            Value::Float(f) => format!("the number {}", quoted(&f.to_string())),
            Value::Text(text) => format!("the text '{}'", shortened(text)),
            Value::Seq(items) => format!("a list of {}", items.len()),
            Value::Map(entries) => match entries.as_slice() {
                [] => "an empty mapping".into(),
                [(key, _)] => format!("a mapping with the key '{}'", shortened(&key.name)),
                _ => format!("a mapping of {} keys", entries.len()),
            },
        }
    }

    /// The same content without positions. Numbers that JSON cannot hold have been refused before.
    pub(crate) fn to_json(&self) -> serde_json::Value {
        match &self.value {
            Value::Null => serde_json::Value::Null,
            Value::Bool(b) => (*b).into(),
            Value::Int(i) => match (u64::try_from(*i), i64::try_from(*i)) {
                (Ok(u), _) => u.into(),
                (_, Ok(i)) => i.into(),
                _ => (*i as f64).into(),
            },
            Value::Float(f) => (*f).into(),
            Value::Text(text) => text.clone().into(),
            Value::Seq(items) => items.iter().map(Node::to_json).collect(),
            Value::Map(entries) => entries.iter().map(|(key, node)| (key.name.clone(), node.to_json())).collect(),
        }
    }
}

/// A text of a source, cut to a length that a message can hold.
pub(crate) fn shortened(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    if line.chars().count() <= 40 && line.len() == text.len() {
        quoted(line)
    } else {
        quoted(&line.chars().take(37).chain("...".chars()).collect::<String>())
    }
}

/// Reads the text of a source from byte `from` on; positions count from the text's start.
pub(super) fn parse(source: usize, text: &str, from: usize) -> Result<Node, Fault> {
    let body = &text[from..];
    if body.len() > MAX_BYTES {
        return Err(Fault::new(Span { source, start: 0, len: 1 }, format!("the file has {} MB", body.len() >> 20))
            .cure(format!("a config has at most {} MB", MAX_BYTES >> 20)));
    }
    let read = serde_saphyr::from_str_with_options::<Spanned<Raw>>(body, options());
    match read {
        Ok(tree) => Ok(located(tree, source, from)),
        Err(error) => Err(syntax_fault(&error, source, text, from)),
    }
}

fn options() -> serde_saphyr::Options {
    serde_saphyr::options! {
        budget: serde_saphyr::budget! {
            max_events: 3 * MAX_NODES,
            max_nodes: MAX_NODES,
            max_depth: MAX_DEPTH,
            max_documents: 2,
            max_anchors: 100,
            max_aliases: 1000,
            max_recorded_anchor_events: 20_000,
            max_total_scalar_bytes: MAX_BYTES,
        },
        alias_limits: serde_saphyr::alias_limits! { max_total_replayed_events: 50_000 },
        strict_booleans: true,
        reject_unsupported_tags: true,
        non_finite_float_policy: serde_saphyr::options::NonFiniteFloatPolicy::PassThrough,
        with_snippet: false,
    }
}

/// What the parser stopped at, in our own words where they are better.
fn syntax_fault(error: &serde_saphyr::Error, source: usize, text: &str, from: usize) -> Fault {
    use serde_saphyr::Error;
    let error = error.without_snippet();
    let location = error.location();
    let start = location.map_or(from, |location| match location.span().byte_offset() {
        Some(offset) => from + offset as usize,
        None => from + offset_of(&text[from..], location.line() as usize, location.column() as usize),
    });
    let span = Span { source, start: start.min(text.len()), len: 1 };
    match error {
        Error::DuplicateMappingKey { key, .. } => {
            let key = key.as_deref().unwrap_or("?");
            Fault::new(span, format!("the key '{}' stands twice in one mapping", shortened(key)))
                .cure("keep one of them")
        }
        Error::MultipleDocuments { .. } => {
            Fault::new(span, "a second document begins here").cure("one file holds one document: take the '---' out")
        }
        Error::UnsupportedTag { tag, .. } => {
            Fault::new(span, format!("the tag {} has no meaning here", shortened(tag))).cure("take it out")
        }
        other => {
            let rendered = other.render();
            let too_much =
                matches!(other, Error::AliasReplayLimitExceeded { .. } | Error::AliasExpansionLimitExceeded { .. });
            if too_much || rendered.contains("budget breached") {
                let rule = "here the file becomes larger or deeper than a config may be, aliases written out";
                return Fault::new(span, rule).cure(format!("at most {MAX_DEPTH} levels, and few and small aliases"));
            }
            // The parser appends its own position; ours is in front.
            let message =
                rendered.split(" at line ").next().unwrap_or(&rendered).trim_start_matches("error: ").to_owned();
            let message =
                message.split(", column ").next().unwrap_or(&message).lines().next().unwrap_or_default().to_owned();
            Fault::new(span, format!("this is no YAML: {}", quoted(&message))).cure(cure_of_syntax(&message))
        }
    }
}

/// What is most often wrong where the parser says so.
fn cure_of_syntax(message: &str) -> &'static str {
    if message.contains("tab") {
        "indent with blanks: YAML takes no tabs there"
    } else if ["bracket", "flow mapping", "flow sequence"].iter().any(|word| message.contains(word)) {
        "close each { with } and each [ with ], and put commas between what stands inside"
    } else if message.contains("quote") || message.contains("scalar") {
        "close the quotes"
    } else {
        "indent the keys of one section alike, and put a blank behind each colon"
    }
}

/// Byte offset of a line and column, both counted from 1.
fn offset_of(text: &str, line: usize, column: usize) -> usize {
    let start: usize = text.split_inclusive('\n').take(line.saturating_sub(1)).map(str::len).sum();
    let within = text[start.min(text.len())..].chars().take_while(|c| *c != '\n').take(column.saturating_sub(1));
    start + within.map(char::len_utf8).sum::<usize>()
}

fn located(tree: Spanned<Raw>, source: usize, from: usize) -> Node {
    let place = |location: serde_saphyr::Location| Span {
        source,
        start: from + location.span().byte_offset().unwrap_or(0) as usize,
        len: location.span().byte_len().unwrap_or(0) as usize,
    };
    let value = match tree.value {
        Raw::Leaf(value) => value,
        Raw::Seq(items) => Value::Seq(items.into_iter().map(|item| located(item, source, from)).collect()),
        Raw::Map(entries) => Value::Map(
            entries
                .into_iter()
                .map(|(key, node)| (Key { name: key.value, span: place(key.defined) }, located(node, source, from)))
                .collect(),
        ),
    };
    Node::new(place(tree.defined), value)
}

/// A node as the parser hands it over.
enum Raw {
    Leaf(Value),
    Seq(Vec<Spanned<Raw>>),
    Map(Vec<(Spanned<String>, Spanned<Raw>)>),
}

impl<'de> Deserialize<'de> for Raw {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Raw, D::Error> {
        struct Any;
        impl<'de> Visitor<'de> for Any {
            type Value = Raw;

            fn expecting(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
                f.write_str("a value, a list or a mapping")
            }
            fn visit_unit<E>(self) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Null))
            }
            fn visit_none<E>(self) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Null))
            }
            fn visit_bool<E>(self, v: bool) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Bool(v)))
            }
            fn visit_u64<E>(self, v: u64) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Int(v.into())))
            }
            fn visit_i64<E>(self, v: i64) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Int(v.into())))
            }
            fn visit_f64<E>(self, v: f64) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Float(v)))
            }
            fn visit_str<E>(self, v: &str) -> Result<Raw, E> {
                Ok(Raw::Leaf(Value::Text(v.to_owned())))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, mut access: A) -> Result<Raw, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = access.next_element()? {
                    items.push(item);
                }
                Ok(Raw::Seq(items))
            }
            fn visit_map<A: MapAccess<'de>>(self, mut access: A) -> Result<Raw, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = access.next_entry()? {
                    entries.push(entry);
                }
                Ok(Raw::Map(entries))
            }
        }
        deserializer.deserialize_any(Any)
    }
}
