//! Events: what can happen, declared once with its name, how grave it is, what is known of it, its words, and what counts it. Logs, the
//! control interface, metrics and the guide read that.

use std::fmt::Debug;

use schemars::{Schema, SchemaGenerator};

use crate::message::Message;

/// What happened: [`events!`](crate::events) makes it of a declaration.
pub trait Event: Debug + Send {
    /// Whether it is a fault, and what is reported. What befell several things at once is one message if it is to be `together`, for
    /// people, and one for each for programs.
    fn messages(&self, together: bool) -> Vec<(bool, Message)>;
}

/// A key of what is known of an event, and the schema of what stands there.
pub type FactKind = (&'static str, fn(&mut SchemaGenerator) -> Schema);

/// What is declared of an event.
#[derive(Debug)]
pub struct EventKind {
    /// Its name, as programs know it.
    pub name: &'static str,
    /// What it is.
    pub help: &'static str,
    /// How grave it is: `note`, `fault`, or either.
    pub level: &'static str,
    /// What is known of it: keys, and what stands there.
    pub facts: &'static [FactKind],
    /// The metric that counts it, and what that is, where it has one of its own.
    pub counter: Option<(&'static str, &'static str)>,
}

/// Declares events: `/// What it is` `Variant { fields } => "name", note or fault (if …), { key: type = value }, words, counts "metric"
/// "help" (by so many);`. Behind `and together` stand those that report by others. It makes the enum, its [`Event`], and `KINDS`.
#[macro_export]
macro_rules! events {
    (@is fault) => { true };
    (@is note) => { false };
    (@is $level:ident $when:expr) => { $when };
    (@level $level:ident) => { stringify!($level) };
    (@level $level:ident $when:expr) => { "note or fault" };
    (@counter) => { None };
    (@counter $counter:literal $counted:literal) => { Some(($counter, $counted)) };
    (@by) => { 1 };
    (@by $by:expr) => { $by };
    (@kinds $({
        $event:literal [$($help:literal)+] [$($level:tt)+]
        {$($key:ident: $key_of:ty),*} $(($counter:literal $counted:literal))?
    })*) => {
        &[$($crate::event::EventKind {
            name: $event,
            help: concat!($($help),+),
            level: $crate::events!(@level $($level)+),
            facts: &[$((stringify!($key), |of| of.subschema_for::<$key_of>())),*],
            counter: $crate::events!(@counter $($counter $counted)?),
        }),*]
    };
    (kinds {$(
        $(#[doc = $help:literal])+
        $event:literal, $level:ident, {$($key:ident: $key_of:ty),* $(,)?};
    )*}) => {
        $crate::events!(@kinds $({ $event [$($help)+] [$level] {$($key: $key_of),*} })*)
    };
    (
        $(#[$about:meta])*
        $vis:vis enum $name:ident {$(
            $(#[doc = $help:literal])+
            $variant:ident
                $({$($(#[$field_about:meta])* $field:ident: $of:ty),* $(,)?})?
                $(($($part:ident: $part_of:ty),*))?
            => $event:literal, $level:ident $(if $when:expr)?,
            {$($key:ident: $key_of:ty = $value:expr),* $(,)?}, $words:expr
            $(, counts $counter:literal $counted:literal $(by $by:expr)?)?;
        )*}
        $(and $together:ident {$(
            $(#[$more_about:meta])*
            $more:ident($($more_part:ident: $more_of:ty),*) => $report:expr;
        )*})?
    ) => {
        $(#[$about])*
        $vis enum $name {
            $($(#[doc = $help])+ $variant $({$($(#[$field_about])* $field: $of),*})? $(($($part_of),*))?,)*
            $($($(#[$more_about])* $more($($more_of),*),)*)?
        }

        impl $name {
            /// What is declared of each, by name.
            pub const KINDS: &'static [$crate::event::EventKind] = $crate::events!(@kinds $({
                $event [$($help)+] [$level $($when)?] {$($key: $key_of),*} $(($counter $counted))?
            })*);
        }

        impl $crate::event::Event for $name {
            #[allow(unused_variables)]
            fn messages(&self, together: bool) -> Vec<(bool, $crate::message::Message)> {
                $(let $together = together;)?
                match self {
                    $(Self::$variant $({$($field),*})? $(($($part),*))? => {
                        let facts = vec![$((stringify!($key), $crate::__private::serde_json::json!($value))),*];
                        let message = $crate::message::Message::of($event, facts, $words);
                        let message = message.counting($crate::events!(@by $($($by)?)?));
                        vec![($crate::events!(@is $level $($when)?), message)]
                    })*
                    $($(Self::$more($($more_part),*) => $report,)*)?
                }
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::*;

    events! {
        /// What happens here.
        #[derive(Debug)]
        enum Happening {
            /// It began.
            Began => "began", note, {}, "it begins";
            /// A pipe leaks.
            Leaks { pipe: u8, litres: u64 } => "leaks", fault if *litres > 0, { pipe: u8 = pipe },
                format!("pipe {pipe}: {litres} l"), counts "litres_total" "Litres that leaked." by *litres;
        }
        and together {
            /// Several.
            Several(all: Vec<Happening>) => all.iter().flat_map(|of| of.messages(together)).collect();
        }
    }

    #[test]
    fn an_event_is_declared_with_its_name_facts_words_and_what_counts_it() {
        let all = vec![Happening::Began, Happening::Leaks { pipe: 3, litres: 2 }];
        let all = Happening::Several(all).messages(false);
        let of = |(fault, of): &(bool, Message)| (*fault, of.line("x"), of.count());
        let began = r#"{"event":"began","level":"x","message":"it begins"}"#;
        let leaks = r#"{"event":"leaks","level":"x","pipe":3,"message":"pipe 3: 2 l"}"#;
        assert_eq!(of(&all[0]), (false, began.to_owned(), 1));
        assert_eq!(of(&all[1]), (true, leaks.to_owned(), 2));
        let kinds = Happening::KINDS
            .iter()
            .map(|of| (of.name, of.level, of.help.trim()));
        let wanted = [
            ("began", "note", "It began."),
            ("leaks", "note or fault", "A pipe leaks."),
        ];
        assert!(kinds.eq(wanted));
        assert_eq!(
            Happening::KINDS[1].counter,
            Some(("litres_total", "Litres that leaked."))
        );
        assert_eq!(Happening::KINDS[1].facts[0].0, "pipe");
    }
}
