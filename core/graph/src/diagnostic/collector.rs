//! Collects diagnostics in any order and reports each mistake once.

use std::collections::HashMap;
use std::fmt::Debug;

use super::{Code, Place, Sources, render};

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

/// One kind of mistake, with the data of its texts; [`problem!`](crate::problem) declares it.
pub trait Problem: Debug {
    /// The code, with how bad it is.
    fn code(&self) -> &'static Code;

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

impl<P: Problem + 'static> From<P> for Box<dyn Problem> {
    fn from(problem: P) -> Self {
        Box::new(problem)
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
    /// What is known of each place, in order of its codes' discovery.
    known: HashMap<Option<Place>, Vec<Known>>,
    scope: Option<String>,
    errors: usize,
    reported: usize,
}

/// What is known of one code at one place.
#[derive(Debug, Clone)]
struct Known {
    code: &'static str,
    first: Counted,
    /// Those of other words.
    others: HashMap<String, Counted>,
    /// One of them is an error.
    is_error: bool,
    /// One of them is an error of no member.
    is_of_none: bool,
}

/// A mistake among those found.
#[derive(Debug, Clone)]
struct Counted {
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
    pub fn report(
        &mut self,
        place: impl Into<Option<Place>>,
        problem: impl Into<Box<dyn Problem>>,
    ) {
        self.report_borrowed(place, &*problem.into());
    }

    /// As [`Diagnostics::report`], of what is kept.
    pub(crate) fn report_borrowed(
        &mut self,
        place: impl Into<Option<Place>>,
        problem: &dyn Problem,
    ) {
        let context = self.scope.clone();
        self.note(context, place.into(), problem);
    }

    /// Notes a problem unless another is known at its place, from which it may follow.
    pub fn report_unless_known(&mut self, place: Place, problem: impl Into<Box<dyn Problem>>) {
        let problem = problem.into();
        if !self.is_known(problem.code().code, place) {
            self.report(place, problem);
        }
    }

    /// Whether an error of another code, or the same one of no member, stands at a place.
    pub fn is_known(&self, code: &str, place: Place) -> bool {
        let there = self.known.get(&Some(place)).into_iter().flatten();
        let mut errors = there.filter(|known| known.is_error);
        errors.any(|known| known.code != code || known.is_of_none)
    }

    /// Notes a problem of one member, e.g. `in node "thermal", member "Z1"`.
    ///
    /// The same problem at the same place is reported once, with its first context and the number of the others.
    pub fn report_in(
        &mut self,
        context: impl Into<String>,
        place: impl Into<Option<Place>>,
        problem: impl Into<Box<dyn Problem>>,
    ) {
        self.note(Some(context.into()), place.into(), &*problem.into());
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
    pub fn scope(&mut self, context: Option<String>) -> Option<String> {
        std::mem::replace(&mut self.scope, context)
    }

    /// Takes over what another collector found; what is known here already is counted with it.
    pub fn extend(&mut self, other: Self) {
        for diagnostic in other.found {
            self.take(diagnostic);
        }
    }

    /// Number of errors as they were found: one that is found again, of another member or instance, counts again.
    pub fn reported(&self) -> usize {
        self.reported
    }

    fn note(&mut self, context: Option<String>, place: Option<Place>, problem: &dyn Problem) {
        let new = self.take(Diagnostic {
            code: problem.code().code,
            severity: problem.code().severity,
            place,
            context,
            repeats: 0,
            message: problem.message(),
            label: String::new(),
            help: None,
            related: Vec::new(),
        });
        // What stands beside a mistake is worded once, however many members make it.
        if let Some(new) = new {
            new.label = problem.label();
            new.help = problem.help();
            new.related = problem.related();
        }
    }

    /// Keeps a mistake and gives it, or counts it with the one that is known.
    fn take(&mut self, diagnostic: Diagnostic) -> Option<&mut Diagnostic> {
        let is_error = diagnostic.severity == Severity::Error;
        self.reported += usize::from(is_error);
        if self.counts(&diagnostic) {
            return None;
        }
        let counted = Counted {
            index: self.found.len(),
            context: diagnostic.context.clone(),
        };
        let is_of_none = is_error && diagnostic.context.is_none();
        let there = self.known.entry(diagnostic.place).or_default();
        match there.iter_mut().find(|known| known.code == diagnostic.code) {
            Some(known) => {
                known.others.insert(diagnostic.message.clone(), counted);
                known.is_error |= is_error;
                known.is_of_none |= is_of_none;
            }
            None => there.push(Known {
                code: diagnostic.code,
                first: counted,
                others: HashMap::new(),
                is_error,
                is_of_none,
            }),
        }
        self.errors += usize::from(is_error);
        self.found.push(diagnostic);
        self.found.last_mut()
    }

    /// Whether a mistake is known, to which its members are then counted.
    fn counts(&mut self, again: &Diagnostic) -> bool {
        let there = self.known.get_mut(&again.place).into_iter().flatten();
        let Some(known) = { there }.find(|known| known.code == again.code) else {
            return false;
        };
        let first = &self.found[known.first.index];
        // The same mistake of another member may be worded with that member's names.
        let is_reworded = || {
            let members = first.context.as_ref().zip(again.context.as_ref());
            members.is_some_and(|(first, again)| first != again)
        };
        let counted = match known.others.get_mut(&again.message) {
            _ if first.message == again.message => &mut known.first,
            Some(counted) => counted,
            None if is_reworded() => &mut known.first,
            None => return false,
        };
        if again.context.is_some() && counted.context != again.context {
            counted.context.clone_from(&again.context);
            self.found[counted.index].repeats += 1 + again.repeats;
        }
        true
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
