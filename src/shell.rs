//! A text -> a word of a command that a person may copy into a shell (POSIX).

use std::fmt::Display;

/// In quotes where a shell would split or expand it.
pub(crate) fn word(text: impl Display) -> String {
    let text = text.to_string();
    let is_plain = |c: char| c.is_alphanumeric() || "_-./:@%+,".contains(c);
    if !text.is_empty() && text.chars().all(is_plain) { text } else { quoted(text) }
}

/// In quotes, whatever it is.
pub(crate) fn quoted(text: impl Display) -> String {
    format!("'{}'", text.to_string().replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exact_a_shell_reads_the_same_words_again() {
        assert_eq!(word("corpora/quick-start_2.v1"), "corpora/quick-start_2.v1");
        assert_eq!(quoted("scenes=5"), "'scenes=5'");
        for text in [
            "my corpus",
            "",
            "it's \"here\"",
            "$HOME",
            "a;b|c&d",
            "~x",
            "*.ply",
            "a\\b",
            "name={a: [1, 2]}",
            "b\u{e4}ume",
        ] {
            let script = format!("set -- {}; printf '%s:%s' $# \"$1\"", word(text));
            let said = std::process::Command::new("sh").args(["-c", &script]).output().unwrap();
            assert_eq!(String::from_utf8_lossy(&said.stdout), format!("1:{text}"));
        }
    }
}
