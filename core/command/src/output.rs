//! Printing that does not panic: a reader that has gone away ends the program quietly, any other failure is an error. These macros
//! take the place of the standard ones.

use std::fmt;
use std::io::{ErrorKind, Write};

/// Prints, or ends the program: with 0 where nobody reads any more, with 3 where it cannot be written.
pub fn put(text: fmt::Arguments<'_>) {
    if !offer(text) {
        std::process::exit(0);
    }
}

/// Prints; false where nobody reads any more. Ends the program with 3 where it cannot be written.
pub fn offer(text: fmt::Arguments<'_>) -> bool {
    if let Err(error) = std::io::stdout().lock().write_fmt(text) {
        if error.kind() == ErrorKind::BrokenPipe {
            return false;
        }
        let _ = writeln!(
            std::io::stderr(),
            "error: cannot write to standard output: {error}"
        );
        std::process::exit(3);
    }
    true
}

/// Takes the place of the standard macro.
#[macro_export]
macro_rules! print {
    ($($text:tt)*) => { $crate::output::put(format_args!($($text)*)) };
}

/// Takes the place of the standard macro.
#[macro_export]
macro_rules! println {
    () => { $crate::output::put(format_args!("\n")) };
    ($($text:tt)*) => { $crate::output::put(format_args!("{}\n", format_args!($($text)*))) };
}
