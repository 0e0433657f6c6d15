//! Faults of a config: where, which rule, and the cure. All of them at once.

use std::fmt;
use std::sync::Arc;

use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

use super::tree::{Source, Span};

/// One broken rule, before its place is turned into line and column.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Fault {
    pub at: Span,
    pub rule: String,
    pub cure: Option<String>,
    /// The other places that the rule speaks of, each with a word on it.
    pub also: Vec<(Span, String)>,
}

impl Fault {
    pub(crate) fn new(at: Span, rule: impl Into<String>) -> Fault {
        Fault { at, rule: rule.into(), cure: None, also: Vec::new() }
    }

    pub(crate) fn cure(mut self, cure: impl Into<String>) -> Fault {
        self.cure = Some(cure.into());
        self
    }

    pub(crate) fn also(mut self, at: Span, word: impl Into<String>) -> Fault {
        self.also.push((at, word.into()));
        self
    }
}

/// The name of the source that an override of the command line is.
pub(crate) const OVERRIDE: &str = "--set";

/// Around what a message quotes from a source; characters of Unicode's private use, which mean nothing.
const QUOTE: [char; 2] = ['\u{e000}', '\u{e001}'];

/// A text of a source, marked, so that it can be left out where the source is not to be shown.
pub(crate) fn quoted(text: &str) -> String {
    let [open, close] = QUOTE;
    format!("{open}{}{close}", text.replace(QUOTE, ""))
}

/// A message with what it quotes, or with dots in its place.
pub(crate) fn told(message: &str, is_shown: bool) -> String {
    if is_shown {
        return message.replace(QUOTE, "");
    }
    let [open, close] = QUOTE;
    let mut parts = message.split(open);
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + "..." + part.split_once(close).map_or("", |(_, rest)| rest))
}

/// Everything that is wrong with a config. `Display` is the heading, [`ConfigError::lines`] the faults one by one; as a
/// miette [`Diagnostic`] it shows the places.
#[derive(Debug)]
pub struct ConfigError {
    pub config: String,
    pub faults: Vec<Located>,
    /// A file could not be read that another time may be: the config may be fine.
    pub unreachable: bool,
    /// An object store is not known to be it.
    pub untrusted: bool,
}

/// A fault with its source.
#[derive(Debug)]
pub struct Located {
    pub line: usize,
    pub column: usize,
    pub rule: String,
    pub cure: Option<String>,
    labels: Vec<LabeledSpan>,
    source: NamedSource<Arc<String>>,
    /// Whether the place is shown with the text around it.
    is_shown: bool,
}

impl ConfigError {
    /// Overrides first, since what was set last most often led to the rest; then in order of place. The same fault found twice (in two
    /// families) is listed once.
    pub(crate) fn new(config: impl Into<String>, sources: &[Source], mut faults: Vec<Fault>) -> ConfigError {
        let in_a_file = |fault: &Fault| sources[fault.at.source].name != OVERRIDE;
        faults.sort_by(|a, b| (in_a_file(a), a).cmp(&(in_a_file(b), b)));
        faults.dedup();
        ConfigError {
            config: config.into(),
            unreachable: false,
            untrusted: false,
            faults: faults.into_iter().map(|fault| Located::new(fault, sources)).collect(),
        }
    }
}

impl Located {
    fn new(fault: Fault, sources: &[Source]) -> Located {
        let source = &sources[fault.at.source];
        let is_shown = source.is_shown;
        let (line, column) = line_column(&source.text, fault.at.start);
        let mut cure = fault.cure.map(|cure| told(&cure, is_shown));
        if !is_shown {
            let note = "what stands there is not shown: the file is no YAML file below the config's folder";
            cure = Some(cure.map_or(note.into(), |cure| format!("{cure}; {note}")));
        }
        let mut labels = vec![label(source, fault.at, None)];
        for (span, word) in fault.also {
            if span.source == fault.at.source && span.start != fault.at.start {
                labels.push(label(source, span, Some(word)));
            } else if span.source != fault.at.source {
                let other = &sources[span.source];
                let (line, column) = line_column(&other.text, span.start);
                let word = format!("{word}: {}:{line}:{column}", other.name);
                cure = Some(cure.map_or(word.clone(), |cure| format!("{cure}; {word}")));
            }
        }
        let named = NamedSource::new(&source.name, Arc::clone(&source.text)).with_language("yaml");
        Located { line, column, rule: told(&fault.rule, is_shown), cure, labels, source: named, is_shown }
    }

    pub(crate) fn file(&self) -> &str {
        self.source.name()
    }
}

fn label(source: &Source, span: Span, word: Option<String>) -> LabeledSpan {
    let text = &source.text;
    let start = span.start.min(text.len());
    // A label never runs past its line: whole blocks would bury the fault.
    let rest_of_line = text[start..].find('\n').unwrap_or(text.len() - start);
    let len = span.len.clamp(1, rest_of_line.max(1)).min(text.len() - start);
    match word {
        None => LabeledSpan::new_primary_with_span(None, (start, len)),
        Some(word) => LabeledSpan::new_with_span(Some(word), (start, len)),
    }
}

/// Line and column (in characters) of a byte offset, counted from 1.
pub(crate) fn line_column(text: &str, offset: usize) -> (usize, usize) {
    let mut end = offset.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    let before = &text[..end];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
}

impl ConfigError {
    /// One line a fault, `file:line:column: rule; cure`, for logs and editors.
    pub fn lines(&self) -> String {
        let line = |fault: &Located| {
            let cure = fault.cure.as_deref().map_or(String::new(), |cure| format!("; {cure}"));
            format!("{}:{}:{}: {}{cure}\n", fault.file(), fault.line, fault.column, fault.rule)
        };
        self.faults.iter().map(line).collect()
    }
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let count = self.faults.len();
        write!(f, "{}: {count} fault{}, nothing was written", self.config, if count == 1 { "" } else { "s" })
    }
}

impl std::error::Error for ConfigError {}

impl Diagnostic for ConfigError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let again = "a file could not be read just now: the same command again goes on";
        self.unreachable.then(|| Box::new(again) as Box<dyn fmt::Display>)
    }
    fn related<'a>(&'a self) -> Option<Box<dyn Iterator<Item = &'a dyn Diagnostic> + 'a>> {
        Some(Box::new(self.faults.iter().map(|fault| fault as &dyn Diagnostic)))
    }
}

impl fmt::Display for Located {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if !self.is_shown {
            write!(f, "{}:{}:{}: ", self.file(), self.line, self.column)?;
        }
        f.write_str(&self.rule)
    }
}

impl std::error::Error for Located {}

impl Diagnostic for Located {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.cure.as_ref().map(|cure| Box::new(cure) as Box<dyn fmt::Display>)
    }
    fn source_code(&self) -> Option<&dyn SourceCode> {
        self.is_shown.then_some(&self.source as &dyn SourceCode)
    }
    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.is_shown.then(|| Box::new(self.labels.iter().cloned()) as Box<dyn Iterator<Item = LabeledSpan> + '_>)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_what_is_quoted_is_left_out_whatever_it_holds() {
        let rule = format!("unknown key '{}' in 'a', got {}", quoted("x' or 'y\u{e001}"), quoted("z"));
        assert_eq!(told(&rule, true), "unknown key 'x' or 'y' in 'a', got z");
        assert_eq!(told(&rule, false), "unknown key '...' in 'a', got ...");
        assert_eq!(told("no quote", false), "no quote");
    }

    #[test]
    fn exact_lines_and_columns_count_characters_from_one() {
        let text = "a: 1\né: ü\n";
        let places = [0, 3, 5, 7, 9, 11, 12, 99].map(|offset| line_column(text, offset));
        assert_eq!(places, [(1, 1), (1, 4), (2, 1), (2, 2), (2, 4), (2, 5), (3, 1), (3, 1)]);
        // Inside a character: its beginning.
        assert_eq!(line_column(text, 6), (2, 1));
    }
}
