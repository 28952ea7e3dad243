//! Commands that the user may try next, with the program named as the user named it.

use std::path::Path;
use std::sync::OnceLock;

use athermal_jobs::data::Data;
pub use athermal_jobs::path::quoted;

static CALLED: OnceLock<String> = OnceLock::new();

/// Keeps how the program was called.
pub fn called(name: String) {
    // A process is one program; whoever calls it twice calls it so.
    let _ = CALLED.set(name);
}

/// The program as it was called, quoted for a shell where it must be.
#[must_use]
pub fn program() -> String {
    let name = CALLED.get().filter(|name| !name.is_empty());
    name.map_or_else(|| "athermal".to_owned(), |name| quoted(name))
}

/// The words of a command that takes a model and data; more of them may follow.
#[must_use]
pub fn words_with(data: &Data, command: &str, model: &Path) -> Vec<String> {
    let model = quoted(&model.display().to_string());
    let mut words = vec![program(), command.to_owned(), model];
    words.extend(data.words());
    words
}

/// A command for a shell, in lines of at most 80 columns.
#[must_use]
pub fn command(words: &[impl AsRef<str>]) -> String {
    led(" ", words)
}

/// What a user would type next, in a line where it fits.
#[must_use]
pub fn next(words: &[impl AsRef<str>]) -> String {
    led("next:", words)
}

fn led(by: &str, words: &[impl AsRef<str>]) -> String {
    const WIDTH: usize = 78;
    let mut text = by.to_owned();
    let mut column = by.len();
    for (position, word) in words.iter().enumerate() {
        let length = word.as_ref().chars().count() + 1;
        if position > 0 && column + length > WIDTH {
            text.push_str(" \\\n     ");
            column = 5;
        }
        text.push(' ');
        text.push_str(word.as_ref());
        column += length;
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{command, next, quoted};

    #[test]
    fn long_commands_go_on_in_the_next_line() {
        let long = ["x".repeat(40), "y".repeat(40)];
        let words: Vec<&str> = long.iter().map(String::as_str).collect();
        let text = command(&words);
        assert_eq!(text, format!("  {} \\\n      {}", long[0], long[1]));
    }

    #[test]
    fn what_comes_next_stands_in_a_line_where_it_fits() {
        assert_eq!(next(&["athermal", "check"]), "next: athermal check");
        let long = "x".repeat(80);
        assert_eq!(next(&["run", &long]), format!("next: run \\\n      {long}"));
    }

    #[test]
    fn words_are_quoted_only_where_a_shell_needs_it() {
        assert_eq!(quoted("target/release/athermal"), "target/release/athermal");
        assert_eq!(quoted("my log.csv"), "'my log.csv'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
    }
}
