//! Decides how commands that the user may try next are spelt: with the program named as the user has named it.

/// The program as it was called, quoted for a shell where it must be.
#[must_use]
pub fn program() -> String {
    let name = std::env::args().next().unwrap_or_default();
    if name.is_empty() {
        return "athermal".to_owned();
    }
    quoted(&name)
}

/// A word for a shell.
#[must_use]
pub fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_alphanumeric() || "/._-+:@%,=".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn words_are_quoted_only_where_a_shell_needs_it() {
        assert_eq!(quoted("target/release/athermal"), "target/release/athermal");
        assert_eq!(quoted("my log.csv"), "'my log.csv'");
        assert_eq!(quoted("it's"), "'it'\\''s'");
    }
}
