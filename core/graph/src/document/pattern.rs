//! Patterns of names: `*` is any text, `?` one character and `{a,b}` a choice.

use std::fmt;

/// A pattern of names: `*` is any text, `?` one character and `{a,b}` a choice.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pattern(Vec<String>);

impl Pattern {
    /// Reads a pattern; every text is one.
    #[must_use]
    pub fn new(text: &str) -> Self {
        Self(choices(text))
    }

    /// Whether a name matches it.
    #[must_use]
    pub fn matches(&self, name: &str) -> bool {
        self.0.iter().any(|choice| glob(choice, name))
    }
}

impl fmt::Display for Pattern {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &*self.0 {
            [one] => f.write_str(one),
            choices => write!(f, "{{{}}}", choices.join(",")),
        }
    }
}

/// The patterns without choices that a pattern stands for. The number is bounded; beyond it the text is taken as it is.
fn choices(pattern: &str) -> Vec<String> {
    const MOST: usize = 4096;
    let mut done = Vec::new();
    let mut open = vec![pattern.to_owned()];
    while let Some(text) = open.pop() {
        let group = text
            .find('{')
            .and_then(|start| text[start..].find('}').map(|len| (start, start + len)));
        match group {
            Some((start, end)) if done.len() + open.len() < MOST => {
                for choice in text[start + 1..end].split(',').rev() {
                    open.push(format!("{}{}{}", &text[..start], choice, &text[end + 1..]));
                }
            }
            _ => done.push(text),
        }
    }
    done
}

/// Matching with backtracking to the last star only, which is enough and takes at most pattern × name steps.
fn glob(pattern: &str, name: &str) -> bool {
    let (mut pattern, mut name) = (pattern.chars(), name.chars());
    // What follows the last star, and where in the name it was looked for last.
    let mut star = None;
    loop {
        let (mut after, mut rest) = (pattern.clone(), name.clone());
        let Some(letter) = rest.next() else {
            return pattern.all(|wanted| wanted == '*');
        };
        match after.next() {
            Some('*') => {
                star = Some((after.clone(), name.clone()));
                pattern = after;
            }
            Some(wanted) if wanted == '?' || wanted == letter => (pattern, name) = (after, rest),
            _ => {
                let Some((begin, from)) = &mut star else {
                    return false;
                };
                from.next();
                (pattern, name) = (begin.clone(), from.clone());
            }
        }
    }
}
