//! The macro [`problem!`](crate::problem): all that is shown of a mistake stands in one place.

/// Declares one mistake: a struct of the data of its texts, whose fields the texts name, and how it is shown.
///
/// A message and a label are `&str` or `String`, help one of them, or an `Option<String>`.
///
/// The first mistake of a code declares the code too: its title as an `error` or a `warning`, and with `explanation` why it is a mistake
/// and what to do about it. The code is then a constant of its name and one of [`codes()`](crate::diagnostic::codes). Beside the file,
/// in `pages`, stand two whole graphs: `A000-wrong.toml` with the mistake, and no other, and `A000-right.toml`.
#[macro_export]
macro_rules! problem {
    (@code $code:ident $severity:ident $title:literal $explanation:literal) => {
        #[doc = $title]
        pub const $code: $crate::diagnostic::Code = $crate::diagnostic::Code {
            code: stringify!($code),
            severity: $crate::diagnostic::Severity::$severity,
            title: $title,
            explanation: $explanation,
            wrong: include_str!(concat!("pages/", stringify!($code), "-wrong.toml")),
            right: include_str!(concat!("pages/", stringify!($code), "-right.toml")),
        };

        $crate::diagnostic::inventory::submit! { $code }
    };
    ($(#[$about:meta])* $code:ident $name:ident $data:tt error: $title:literal, explanation: $explanation:literal, $($shown:tt)*) => {
        $crate::problem!(@code $code Error $title $explanation);
        $crate::problem! { $(#[$about])* $code $name $data $($shown)* }
    };
    ($(#[$about:meta])* $code:ident $name:ident $data:tt warning: $title:literal, explanation: $explanation:literal, $($shown:tt)*) => {
        $crate::problem!(@code $code Warning $title $explanation);
        $crate::problem! { $(#[$about])* $code $name $data $($shown)* }
    };
    (@or, $default:expr) => {
        $default
    };
    (@or $given:expr, $default:expr) => {
        $given
    };
    (
        $(#[$about:meta])*
        $code:ident $name:ident { $($(#[$of:meta])* $field:ident: $type:ty),* $(,)? }
        message: $message:expr,
        label: $label:expr,
        help: $help:expr,
        $(related: $related:expr,)?
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, PartialEq)]
        #[allow(missing_docs)] // the fields are the data of the message
        pub struct $name {
            $($(#[$of])* pub $field: $type),*
        }

        #[allow(unused_variables)]
        impl $crate::diagnostic::Problem for $name {
            fn code(&self) -> &'static $crate::diagnostic::Code {
                &$code
            }

            fn message(&self) -> String {
                let Self { $($field),* } = self;
                String::from($message)
            }

            fn label(&self) -> String {
                let Self { $($field),* } = self;
                String::from($label)
            }

            fn help(&self) -> Option<String> {
                let Self { $($field),* } = self;
                $crate::diagnostic::Help::text($help)
            }

            fn related(&self) -> Vec<($crate::diagnostic::Place, String)> {
                let Self { $($field),* } = self;
                $crate::problem!(@or $($related)?, Vec::new())
            }
        }
    };
}

/// What help may be written as.
pub trait Help {
    /// The text, where there is help.
    fn text(self) -> Option<String>;
}

impl Help for &str {
    fn text(self) -> Option<String> {
        Some(self.to_owned())
    }
}

impl Help for String {
    fn text(self) -> Option<String> {
        Some(self)
    }
}

impl Help for Option<String> {
    fn text(self) -> Option<String> {
        self
    }
}
