//! `--set key=value` -> laid over a document's tree.

use super::error::{Fault, OVERRIDE};
use super::form::Schema;
use super::merge::set;
use super::reader::Reader;
use super::schema::{Kind, schema};
use super::tree::{self, Key, Node, Source, Span};

/// A `--set key=value` laid over the document.
pub(super) fn with_set(root: Node, argument: &str, reader: &mut Reader, kind: Kind) -> Result<Node, Fault> {
    let example = match kind {
        #[cfg(feature = "train")]
        Kind::Train => "for example: network.hidden=[8]",
        _ => "for example: scene.rocks.count=5",
    };
    let source = reader.sources.len();
    let text = std::sync::Arc::new(argument.to_owned());
    let folder = reader.folder(root.span);
    reader.sources.push(Source { name: OVERRIDE.into(), text, folder, is_shown: true });
    let whole = Span { source, start: 0, len: argument.len() };
    let Some((dotted, _)) = argument.split_once('=') else {
        return Err(Fault::new(whole, "an override has the form key=value").cure(example));
    };
    let mut path = Vec::new();
    let mut start = 0;
    for name in dotted.split('.') {
        path.push(Key { name: name.trim().to_owned(), span: Span { source, start, len: name.len() } });
        start += name.len() + 1;
    }
    if path.iter().any(|key| key.name.is_empty()) {
        return Err(Fault::new(whole, "the key of an override has an empty part").cure(example));
    }
    let value = tree::parse(source, argument, dotted.len() + 1)?;
    set(Some(root), &path, value, Some(Schema::of(schema(kind))))
}
