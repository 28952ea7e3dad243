//! The codes of all mistakes that this program knows, each declared with its first mistake by [`problem!`](crate::problem).

use std::sync::OnceLock;

use super::Severity;

/// A kind of mistake, as `athermal explain CODE` shows it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Code {
    /// The code: `A` and three digits. It never changes its meaning.
    pub code: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// What it is about, in a few words.
    pub title: &'static str,
    /// Why it is a mistake and what to do.
    pub explanation: &'static str,
    /// A graph file with the mistake, called `graph.toml`; `base.toml` beside it is any graph, `chuck.csv` a schedule.
    pub wrong: &'static str,
    /// A graph file without.
    pub right: &'static str,
}

inventory::collect!(Code);

/// Every code, in ascending order: A001 to A039 for reading files, A040 and above for compiling them, A070 to A089 and from A170 for
/// their tests, A110 for learning while they run, A180 for mistakes in the code of a node's kind, from A190 for the models that they name, from A200 for what a machine file says of a
/// service.
pub fn codes() -> &'static [Code] {
    static CODES: OnceLock<Vec<Code>> = OnceLock::new();
    CODES.get_or_init(|| {
        let mut codes: Vec<_> = inventory::iter::<Code>.into_iter().copied().collect();
        codes.sort_by_key(|entry| entry.code);
        codes
    })
}

/// The entry of a code, e.g. `"A006"`.
pub fn explain(code: &str) -> Option<&'static Code> {
    codes()
        .iter()
        .find(|entry| entry.code.eq_ignore_ascii_case(code))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_ascend_and_so_none_stands_twice() {
        assert!(codes().windows(2).all(|pair| pair[0].code < pair[1].code));
        assert!(
            codes()
                .iter()
                .all(|entry| entry.code.len() == 4 && entry.explanation.ends_with('.'))
        );
    }

    #[test]
    fn a_code_is_explained_in_either_case() {
        let title = |code| explain(code).map(|entry| entry.title);
        assert_eq!(title("a001"), title("A001"));
        assert!(title("A001").is_some());
        assert_eq!(explain("A999"), None);
    }
}
