//! A dotted key -> where it stands in a tree.

use super::tree::{Node, Span, Value};

/// A tree, to be asked where its parts stand.
#[derive(Clone, Debug)]
pub(crate) struct KeyPath<'a> {
    pub root: &'a Node,
}

/// What a rule's path leads to.
pub(crate) struct Found {
    pub span: Span,
    /// The path by keys, variants by their names.
    pub dotted: String,
    /// Whether the document holds the key itself, not only something above it.
    pub whole: bool,
    /// The value there, where the document holds a plain one.
    pub value: Option<String>,
}

impl KeyPath<'_> {
    /// The place of a key, or of the nearest thing above it that the document holds.
    pub(super) fn span(&self, path: &str) -> Span {
        self.find(path).span
    }

    /// Whether the document names the key itself.
    pub(super) fn holds(&self, path: &str) -> bool {
        self.find(path).whole
    }

    /// Follows a path like `ground.source[0].rms_height_m` or `families[1].name`. A position in a mapping is what serde calls
    /// a newtype: the content of a variant, or of a preset.
    pub(super) fn find(&self, path: &str) -> Found {
        let mut found = Found { span: self.root.span, dotted: String::new(), whole: true, value: None };
        let mut here = Some(self.root);
        for step in path.split(['.', '[']).filter(|step| !step.is_empty()) {
            let index = step.strip_suffix(']').and_then(|index| index.parse::<usize>().ok());
            match (index, here.map(|node| &node.value)) {
                (Some(index), Some(Value::Seq(items))) => {
                    here = items.get(index);
                    found.dotted += &format!("[{index}]");
                }
                (Some(_), Some(Value::Map(entries))) if entries.len() == 1 => {
                    here = Some(&entries[0].1);
                    join(&mut found.dotted, &entries[0].0.name);
                }
                (Some(_), _) => (),
                (None, _) => {
                    here = here.and_then(|node| node.get(step));
                    join(&mut found.dotted, step);
                }
            }
            match here {
                Some(node) => found.span = node.span,
                None => found.whole = false,
            }
        }
        found.value = here.map(|node| &node.value).and_then(|value| match value {
            Value::Int(i) => Some(i.to_string()),
            Value::Float(f) => Some(f.to_string()),
            _ => None,
        });
        found
    }
}

fn join(path: &mut String, key: &str) {
    if !path.is_empty() {
        path.push('.');
    }
    path.push_str(key);
}
