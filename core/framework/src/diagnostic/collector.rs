//! Collecting diagnostics in any order and telling each mistake once; how they look is decided by the renderer.

use std::collections::HashMap;

use super::{Place, Sources, render};

/// How bad a problem is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// The file cannot be used.
    Error,
    /// The file can be used, and probably does not do what was meant.
    Warning,
}

impl Severity {
    /// The word that is shown.
    pub fn word(self) -> &'static str {
        match self {
            Severity::Error => "error",
            Severity::Warning => "warning",
        }
    }
}

/// One kind of mistake. Each layer has an enum of its own whose variants carry the data of their texts.
pub trait Problem {
    /// The stable code, registered in [`super::CODES`].
    fn code(&self) -> &'static str;

    /// How bad it is.
    fn severity(&self) -> Severity {
        Severity::Error
    }

    /// What is wrong, in one sentence that stands alone.
    fn message(&self) -> String;

    /// A few words beside the caret; may be empty.
    fn label(&self) -> String {
        String::new()
    }

    /// What to do about it.
    fn help(&self) -> Option<String> {
        None
    }

    /// Other places that matter, each with a few words.
    fn related(&self) -> Vec<(Place, String)> {
        Vec::new()
    }
}

/// A problem at a place.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnostic {
    /// The stable code, e.g. `A006`.
    pub code: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// Where it is; none only if the file itself could not be read.
    pub place: Option<Place>,
    /// The member for which it was found first, e.g. `in node "thermal", member "Z1"`.
    pub context: Option<String>,
    /// The number of further contexts with the same mistake.
    pub repeats: usize,
    /// What is wrong.
    pub message: String,
    /// A few words beside the caret; may be empty.
    pub label: String,
    /// What to do about it.
    pub help: Option<String>,
    /// Other places that matter, each with a few words.
    pub related: Vec<(Place, String)>,
}

impl Diagnostic {
    /// The context and the number of members that share the mistake, as one phrase.
    pub fn context_phrase(&self) -> Option<String> {
        let context = self.context.as_ref()?;
        let what = if context.contains("member") {
            "member"
        } else {
            "node"
        };
        Some(match self.repeats {
            0 => context.clone(),
            1 => format!("{context}, and 1 more {what}"),
            more => format!("{context}, and {more} more {what}s"),
        })
    }
}

/// All problems found so far.
#[derive(Debug, Clone, Default)]
pub struct Diagnostics {
    found: Vec<Diagnostic>,
    known: HashMap<(&'static str, Option<Place>, String), Known>,
    /// The first mistake of each code at each place.
    first: HashMap<(&'static str, Option<Place>), Known>,
    scope: Option<String>,
    errors: usize,
    reported: usize,
}

#[derive(Debug, Clone)]
struct Known {
    index: usize,
    /// The context that was counted last, so that one member is counted once.
    context: Option<String>,
}

impl Diagnostics {
    /// Nothing found.
    pub fn new() -> Self {
        Self::default()
    }

    /// Notes a problem. `place` is a [`Place`] or `None`.
    pub fn report(&mut self, place: impl Into<Option<Place>>, problem: impl Problem) {
        let context = self.scope.clone();
        self.note(context, place.into(), &problem);
    }

    /// Notes a problem unless another has been told at its place, from which it may follow.
    pub(crate) fn report_unless_told(&mut self, place: Place, problem: impl Problem) {
        if !self.is_told(problem.code(), place) {
            self.report(place, problem);
        }
    }

    /// Whether an error of another code, or the same one of no member, stands at a place.
    pub(crate) fn is_told(&self, code: &str, place: Place) -> bool {
        let errors = self
            .found
            .iter()
            .filter(|of| of.severity == Severity::Error);
        let mut there = errors.filter(|of| of.place == Some(place));
        there.any(|of| of.code != code || of.context.is_none())
    }

    /// Notes a problem of one member, e.g. `in node "thermal", member "Z1"`.
    ///
    /// The same problem at the same place is told once, with its first context and the number of the others.
    pub fn report_in(
        &mut self,
        context: impl Into<String>,
        place: impl Into<Option<Place>>,
        problem: impl Problem,
    ) {
        self.note(Some(context.into()), place.into(), &problem);
    }

    /// Runs `work`, whose [`Diagnostics::report`]s get this context; scopes inside it replace it for their duration.
    pub fn within<T>(
        &mut self,
        context: impl Into<String>,
        work: impl FnOnce(&mut Self) -> T,
    ) -> T {
        let outer = self.scope.replace(context.into());
        let result = work(self);
        self.scope = outer;
        result
    }

    /// Sets the context of the [`Diagnostics::report`]s that follow, and gives the one before.
    pub(crate) fn scope(&mut self, context: Option<String>) -> Option<String> {
        std::mem::replace(&mut self.scope, context)
    }

    /// Takes over what another collector found.
    pub fn extend(&mut self, other: Self) {
        self.extend_where(other, |_| true);
    }

    /// Takes over those that are wanted of what another collector found.
    pub(crate) fn extend_where(&mut self, other: Self, wanted: impl Fn(&Diagnostic) -> bool) {
        for diagnostic in other.found.into_iter().filter(wanted) {
            if diagnostic.severity == Severity::Error {
                self.errors += 1;
                self.reported += 1;
            }
            self.found.push(diagnostic);
        }
    }

    /// Number of errors as they were found: one that is found again, of another member or instance, counts again.
    pub(crate) fn reported(&self) -> usize {
        self.reported
    }

    fn note(&mut self, context: Option<String>, place: Option<Place>, problem: &dyn Problem) {
        let (code, message) = (problem.code(), problem.message());
        if problem.severity() == Severity::Error {
            self.reported += 1;
        }
        if let Some(known) = self.known.get_mut(&(code, place, message.clone())) {
            if context.is_some() && known.context != context {
                known.context = context;
                self.found[known.index].repeats += 1;
            }
            return;
        }
        // The same mistake of another member may be worded with that member's names.
        if let (Some(first), Some(_)) = (self.first.get_mut(&(code, place)), &context) {
            let told = &mut self.found[first.index];
            if told.context.is_some() && told.context != context {
                if first.context != context {
                    first.context = context;
                    told.repeats += 1;
                }
                return;
            }
        }
        let known = Known {
            index: self.found.len(),
            context: context.clone(),
        };
        self.first
            .entry((code, place))
            .or_insert_with(|| known.clone());
        self.known.insert((code, place, message.clone()), known);
        if problem.severity() == Severity::Error {
            self.errors += 1;
        }
        self.found.push(Diagnostic {
            code,
            severity: problem.severity(),
            place,
            context,
            repeats: 0,
            message,
            label: problem.label(),
            help: problem.help(),
            related: problem.related(),
        });
    }

    /// True if the file cannot be used.
    pub fn has_errors(&self) -> bool {
        self.errors > 0
    }

    /// Number of errors, each mistake counted once.
    pub fn error_count(&self) -> usize {
        self.errors
    }

    /// Number of warnings, each mistake counted once.
    pub fn warning_count(&self) -> usize {
        self.found.len() - self.errors
    }

    /// True if nothing was found.
    pub fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Number of errors and warnings.
    pub fn len(&self) -> usize {
        self.found.len()
    }

    /// All of them by file and position, those without a place first; in order of discovery where they share a place.
    pub fn iter(&self) -> impl Iterator<Item = &Diagnostic> {
        let mut sorted: Vec<&Diagnostic> = self.found.iter().collect();
        sorted.sort_by_key(|diagnostic| diagnostic.place);
        sorted.into_iter()
    }

    /// The text for a terminal, in the look of rustc, `width` columns wide.
    pub fn render(&self, sources: &Sources, color: bool, width: usize) -> String {
        render::text(self, sources, color, width)
    }

    /// The same facts for programs: `{"diagnostics": [{code, severity, file, line, column, span, message, help}]}`.
    ///
    /// `file`, `line`, `column` and `span` (bytes) are null where there is no place, `help` where there is none.
    pub fn to_json(&self, sources: &Sources) -> serde_json::Value {
        render::json(self, sources)
    }
}
