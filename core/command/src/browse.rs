//! `athermal browse ADDRESS`: which crate looks there goes by the scheme of the address.

use std::path::PathBuf;
use std::time::Duration as Wait;

use athermal_core::registry::{Registered, Sort, all, find};
use athermal_core::time::Duration;
use clap::parser::ValueSource;
use clap::{ArgMatches, Args, FromArgMatches};

use crate::{Answer, CommandKind, Failure, Group, Terminal};

/// What a crate looks for at an address: options of its own, beside those of [`Browsed`]. An option that two schemes have is one.
pub trait Browse: Args {
    /// Looks there, and writes the source that takes what it finds.
    ///
    /// # Errors
    /// When it cannot be reached, or asked so.
    fn run(&self, at: &Browsed, terminal: &Terminal) -> Result<Answer, Failure>;
}

/// Where is looked, and how.
#[derive(Debug)]
pub struct Browsed {
    /// The address, with its scheme.
    pub address: String,
    /// How long it may take.
    pub patience: Duration,
    /// User and password.
    pub login: Option<(String, String)>,
}

impl Browsed {
    /// How long it may take, a tenth of a second at least.
    #[must_use]
    pub fn wait(&self) -> Wait {
        Wait::from_secs_f64(self.patience.secs().max(0.1))
    }
}

/// A scheme of addresses, by its name before `://`.
#[derive(Debug)]
pub struct Scheme {
    /// The options of its own.
    pub declare: fn() -> clap::Command,
    /// Looks there.
    #[allow(clippy::type_complexity)] // it is this once
    pub run: fn(&Browsed, &ArgMatches, &Terminal) -> Result<Answer, Failure>,
}

impl Sort for Scheme {
    const ONE: &'static str = "scheme";
    const MANY: &'static str = "schemes";
}

/// Looks there; [`register_scheme!`](crate::register_scheme) makes use of it.
#[doc(hidden)]
pub fn browse<B: Browse>(
    at: &Browsed,
    matches: &ArgMatches,
    terminal: &Terminal,
) -> Result<Answer, Failure> {
    let browse = B::from_arg_matches(matches);
    let browse = browse.map_err(|error| Failure::Request(error.to_string()))?;
    browse.run(at, terminal)
}

/// Makes schemes known that `athermal browse` can look at: the type of the options, which implements [`Browse`](crate::Browse), and their
/// names.
#[macro_export]
macro_rules! register_scheme {
    ($browse:ty, $($name:literal),+) => {
        $($crate::__private::list!(
            $crate::Scheme,
            $name,
            $crate::__private::no_schema,
            $crate::Scheme {
                declare: || <$browse as clap::Args>::augment_args(clap::Command::new($name)),
                run: $crate::browse::<$browse>,
            }
        );)+
    };
}

/// Look at a broker or server, and write the source that takes what it has
///
/// Goes by the scheme of the address, and prints a `[sources.NAME]` table: where each value stands, and units as far as they are known.
/// Rename its channels, and leave out what you do not need. Nothing there is changed.
#[derive(Debug, Args)]
#[command(
    after_help = "Examples:\n  athermal browse mqtt://localhost\n  athermal browse mqtt://plant:1883 --topic 'line7/#' --for 1min"
)]
struct Common {
    /// Where to look: SCHEME://HOST, with :PORT where it is not the usual one
    address: String,
    /// How long to listen, or to look
    #[arg(long = "for", value_name = "DURATION", default_value = "10s")]
    patience: Duration,
    /// The user to log in as
    #[arg(long, value_name = "NAME", requires = "password_file")]
    user: Option<String>,
    /// A file with the password
    #[arg(long, value_name = "FILE", requires = "user")]
    password_file: Option<PathBuf>,
}

crate::__private::list!(
    CommandKind,
    "browse",
    crate::__private::no_schema,
    CommandKind {
        declare,
        group: Group::Service,
        run,
        writes_events: false,
    }
);

/// All schemes, by their names.
fn schemes() -> Vec<&'static Registered<Scheme>> {
    let mut all: Vec<_> = all::<Scheme>().collect();
    all.dedup_by_key(|of| of.name);
    all
}

fn declare() -> clap::Command {
    let mut whole = Common::augment_args(clap::Command::new("browse"));
    for scheme in schemes() {
        for argument in (scheme.declare)().get_arguments() {
            if whole
                .get_arguments()
                .all(|of| of.get_id() != argument.get_id())
            {
                whole = whole.arg(argument.clone().help_heading("Of some schemes alone"));
            }
        }
    }
    whole
}

fn run(matches: &ArgMatches, terminal: &Terminal) -> Result<Answer, Failure> {
    let common = Common::from_arg_matches(matches);
    let common = common.map_err(|error| Failure::Request(error.to_string()))?;
    let request = |words: String| Failure::Request(words);
    let (name, _) = common.address.split_once("://").ok_or_else(|| {
        let known: Vec<_> = schemes()
            .iter()
            .map(|of| format!("{}://", of.name))
            .collect();
        request(format!(
            "`{}` says no scheme: write one of {} before it",
            common.address,
            known.join(", ")
        ))
    })?;
    let scheme = find::<Scheme>(name).map_err(|why| request(why.to_string()))?;
    let (own, usual) = (
        (scheme.declare)(),
        Common::augment_args(clap::Command::new("")),
    );
    let is_its = |id: &clap::Id| {
        let mut known = own.get_arguments().chain(usual.get_arguments());
        known.any(|of| of.get_id() == id)
    };
    for of in schemes() {
        for argument in (of.declare)().get_arguments() {
            let id = argument.get_id();
            let is_given = matches.value_source(id.as_str()) == Some(ValueSource::CommandLine);
            if is_given && !is_its(id) {
                return Err(request(format!(
                    "`--{}` is of {}://, and says nothing of {name}://: leave it out",
                    argument.get_long().unwrap_or_default(),
                    of.name
                )));
            }
        }
    }
    let login = match (&common.user, &common.password_file) {
        (Some(user), Some(path)) => {
            let read = std::fs::read_to_string(path);
            let failed =
                |error| Failure::Outside(format!("cannot read {}: {error}", path.display()));
            Some((user.clone(), read.map_err(failed)?.trim().to_owned()))
        }
        _ => None,
    };
    let at = Browsed {
        address: common.address,
        patience: common.patience,
        login,
    };
    (scheme.run)(&at, matches, terminal)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::terminal::Options;

    /// The options of one scheme.
    #[derive(Debug, Args)]
    struct Shelves {
        /// Which
        #[arg(long, default_value = "all")]
        shelf: String,
    }

    impl Browse for Shelves {
        fn run(&self, at: &Browsed, _: &Terminal) -> Result<Answer, Failure> {
            assert_eq!(
                (at.address.as_str(), at.wait()),
                ("shelf://a", Wait::from_secs(2))
            );
            Ok(if self.shelf == "7" {
                Answer::Fine
            } else {
                Answer::No
            })
        }
    }

    /// Those of another one.
    #[derive(Debug, Args)]
    struct Boxes {
        /// Which
        #[arg(long)]
        label: Option<String>,
    }

    impl Browse for Boxes {
        fn run(&self, _: &Browsed, _: &Terminal) -> Result<Answer, Failure> {
            Ok(Answer::Fine)
        }
    }

    register_scheme!(Shelves, "shelf");
    register_scheme!(Boxes, "box", "crate");
    athermal_core::lacks!(Scheme, "cellar", "bottle");

    #[test]
    fn who_looks_goes_by_the_scheme_and_options_of_another_one_are_refused() {
        let command = Options::augment_args(clap::Command::new(""));
        let options = Options::from_arg_matches(&command.get_matches_from([""]));
        let terminal = Terminal::new(&options.unwrap());
        let of = |words: &str| {
            let words = ["browse"].into_iter().chain(words.split(' '));
            run(&declare().get_matches_from(words), &terminal)
        };
        assert!(matches!(
            of("shelf://a --shelf 7 --for 2s"),
            Ok(Answer::Fine)
        ));
        assert!(matches!(of("shelf://a --for 2s"), Ok(Answer::No)));
        for scheme in ["box", "crate"] {
            assert!(matches!(
                of(&format!("{scheme}://a --label x")),
                Ok(Answer::Fine)
            ));
        }
        for (words, why) in [
            ("shelf://a --label x", "`--label` is of box://"),
            (
                "a",
                "says no scheme: write one of box://, crate://, shelf://",
            ),
            ("bottle://a", "cellar"),
            ("house://a", "house"),
        ] {
            let Err(Failure::Request(found)) = of(words) else {
                panic!("{words} is taken")
            };
            assert!(found.contains(why), "{found}");
        }
    }
}
