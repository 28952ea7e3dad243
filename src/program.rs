//! The command line as a whole; each command stands in a file of its own.

use std::env::consts::{ARCH, OS};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::panic::{self, AssertUnwindSafe, PanicHookInfo};
use std::process::ExitCode;
use std::sync::LazyLock;

use athermal::core::diagnostic::{panic_message, panic_text};
use athermal::core::registry::{Registered, all, find};
use athermal_analysis::figures::paragraph;
use athermal_command::{CommandKind, Group};
use clap::{ArgMatches, Args, FromArgMatches};

use crate::terminal::{Answer, Failure, Format, Options, Terminal};
use crate::{invocation, meant};

const EXAMPLES: &str = "\
Start here:
  athermal demo                         all of it, on a simulated machine
  athermal init LOG.csv -o graph.toml   a starter graph for a log of yours
  athermal fit graph.toml --data LOG.csv -o model.json
  athermal evaluate model.json --data OTHER.csv
  athermal run model.json --input - --output -

`athermal COMMAND --help` says more, with examples.
Exit status: 0 fine, 1 the answer is no, 2 the request was wrong, 3 something
outside failed, such as reading a file.";

/// What `--version` says: the version, how the program was built, and from which commit where a release says so.
static BUILT: LazyLock<String> = LazyLock::new(|| {
    let features = [
        ("mqtt", cfg!(feature = "mqtt")),
        ("tls", cfg!(feature = "tls")),
        ("opcua", cfg!(feature = "opcua")),
        ("sparkplug", cfg!(feature = "sparkplug")),
        ("influx", cfg!(feature = "influx")),
        ("postgres", cfg!(feature = "postgres")),
        ("parquet", cfg!(feature = "parquet")),
    ];
    let features = features.iter().filter(|(_, is_in)| *is_in);
    let features: Vec<&str> = features.map(|(name, _)| *name).collect();
    let libc = match () {
        () if cfg!(target_env = "gnu") => "-gnu",
        () if cfg!(target_env = "musl") => "-musl",
        () if cfg!(target_env = "msvc") => "-msvc",
        () => "",
    };
    let commit = option_env!("ATHERMAL_COMMIT").unwrap_or("not of a release");
    format!(
        "{}\nfeatures: {}\ntarget: {ARCH}-{OS}{libc}\ncommit: {commit}",
        env!("CARGO_PKG_VERSION"),
        features.join(" ")
    )
});

/// The command line of athermal, with every plugin that the program links: all that its `main` has to do.
#[must_use]
pub fn command_line() -> ExitCode {
    command_line_of(std::env::args_os()).into()
}

/// The same with these words, of which the first is the name of the program: its exit status.
pub fn command_line_of(words: impl IntoIterator<Item = OsString>) -> u8 {
    let words: Vec<OsString> = words.into_iter().collect();
    let name = words.first().map(|name| name.to_string_lossy());
    invocation::called(name.unwrap_or_default().into_owned());
    let arguments = whole()
        .try_get_matches_from(&words)
        .unwrap_or_else(|error| meant::exit(error, &words));
    let options = Options::from_arg_matches(&arguments);
    let options = options.unwrap_or_else(|error| error.exit());
    let mut terminal = Terminal::new(&options);
    report_panics_in_a_line();
    match caught(|| run(&arguments, &mut terminal)) {
        Ok(answer) => answer.status(),
        Err(failure) => {
            terminal.error(&failure);
            failure.status()
        }
    }
}

/// Does what the command says that stands first.
fn run(arguments: &ArgMatches, terminal: &mut Terminal) -> Result<Answer, Failure> {
    let (name, inside) = arguments.subcommand().unwrap_or(("", arguments));
    let kind = find::<CommandKind>(name).map_err(|why| Failure::Request(why.to_string()))?;
    terminal.events = terminal.format == Format::Json && kind.writes_events;
    (kind.run)(inside, terminal)
}

/// The commands that stand in a group, by name.
pub fn commands(of: Group) -> Vec<&'static Registered<CommandKind>> {
    let mut commands: Vec<_> = all::<CommandKind>()
        .filter(|kind| kind.group == of)
        .collect();
    commands.dedup_by_key(|kind| kind.name);
    commands
}

/// The command line, as a shell completes it.
#[must_use]
pub fn whole() -> clap::Command {
    let whole = clap::Command::new("athermal")
        .version(env!("CARGO_PKG_VERSION"))
        .long_version(BUILT.as_str())
        .subcommand_required(true)
        .arg_required_else_help(true)
        .max_term_width(80)
        .after_help(EXAMPLES);
    let head = *whole.get_styles().get_header();
    let literal = *whole.get_styles().get_literal();
    let mut whole = Options::augment_args(whole)
        .about("Predicts and corrects the thermal drift of precision machines");
    let mut listed = String::new();
    for group in Group::ALL {
        let commands = commands(group);
        if !commands.is_empty() {
            let _ = writeln!(listed, "\n{head}{}:{head:#}", group.title());
        }
        for kind in commands {
            let command = (kind.declare)();
            let about = command
                .get_about()
                .map_or_else(String::new, ToString::to_string);
            let name = format!("  {:<11}", kind.name);
            let line = paragraph(&format!("{name}  "), 15, &about);
            listed += &line.replacen(&name, &format!("{literal}{name}{literal:#}"), 1);
            whole = whole.subcommand(command);
        }
    }
    whole.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n{listed}\n{head}Options:{head:#}\n{{options}}{{after-help}}"
    ))
}

/// What a command answers, or that code of the program or of a plugin panicked in it.
fn caught(command: impl FnOnce() -> Result<Answer, Failure>) -> Result<Answer, Failure> {
    panic::catch_unwind(AssertUnwindSafe(command)).unwrap_or_else(|panic| {
        Err(Failure::Outside(format!(
            "the program cannot go on: {}; `RUST_BACKTRACE=1` shows the way to it",
            panic_text(&*panic)
        )))
    })
}

/// Reports a panic in one line, unless `RUST_BACKTRACE` asks for the way to it.
fn report_panics_in_a_line() {
    let in_full = panic::take_hook();
    panic::set_hook(Box::new(move |panic| {
        if std::env::var_os("RUST_BACKTRACE").is_some_and(|wanted| wanted != "0") {
            in_full(panic);
        } else {
            eprintln!("{}", in_a_line(panic));
        }
    }));
}

fn in_a_line(panic: &PanicHookInfo<'_>) -> String {
    let message = panic_message(panic.payload());
    match panic.location() {
        Some(place) => format!("panic at {place}: {message}"),
        None => format!("panic: {message}"),
    }
}

#[cfg(test)]
mod tests {
    use clap::{Args, Command, FromArgMatches};

    use athermal_command::Group;

    use super::{run, whole};
    use crate::terminal::{Answer, Failure, Format, Options, Terminal};

    /// Say the number
    #[derive(Debug, Args)]
    struct Say {
        /// Any number
        number: u8,
    }

    impl athermal_command::Command for Say {
        const GROUP: Group = Group::Look;

        fn run(&self, terminal: &Terminal) -> Result<Answer, Failure> {
            assert_eq!((self.number, terminal.format), (7, Format::Json));
            Ok(Answer::No)
        }
    }

    athermal_command::register_command!(Say, "say-for-a-test");

    #[test]
    fn a_command_that_a_crate_brings_stands_in_the_group_that_it_says() {
        let help = whole().render_help().to_string();
        let lines: Vec<&str> = help.lines().collect();
        assert!(
            help.starts_with("Predicts and corrects the thermal drift"),
            "{help}"
        );
        let at = |line: &str| lines.iter().position(|of| of.starts_with(line));
        assert!(at("Look:") < at("  say-for-a-test"), "{help}");
        assert!(at("  say-for-a-test") < at("Run:"), "{help}");
        assert!(
            lines.iter().all(|line| line.chars().count() <= 80),
            "{help}"
        );
        for group in Group::ALL {
            assert_eq!(
                help.matches(&format!("\n{}:\n", group.title())).count(),
                1,
                "{help}"
            );
        }
        let words = ["athermal", "say-for-a-test", "7", "--format", "json"];
        let arguments = whole().get_matches_from(words);
        let options = Options::from_arg_matches(&arguments).expect("they were checked");
        let answer = run(&arguments, &mut Terminal::new(&options));
        assert!(matches!(answer, Ok(Answer::No)), "{answer:?}");
    }

    /// The error of each argument of a command, and of those inside it, that is given a text instead of what it takes.
    fn refusals(command: &Command, words: &[String]) -> Vec<String> {
        let mut all = Vec::new();
        for argument in command
            .get_arguments()
            .filter_map(|argument| argument.get_long())
        {
            let call = words.iter().cloned().chain([format!("--{argument}=x")]);
            let refused = whole().try_get_matches_from(call).err();
            all.extend(refused.map(|error| error.to_string()));
        }
        for inner in command.get_subcommands() {
            let words = [words, &[inner.get_name().to_owned()]].concat();
            all.extend(refusals(inner, &words));
        }
        all
    }

    #[test]
    fn a_panic_in_a_command_ends_it_with_a_status_of_its_own() {
        let failed = super::caught(|| panic!("within a plugin"));
        let Err(Failure::Outside(message)) = failed else {
            panic!("{failed:?}")
        };
        assert!(message.contains("RUST_BACKTRACE=1"), "{message}");
        let fine = super::caught(|| Ok(Answer::Fine));
        assert!(matches!(fine, Ok(Answer::Fine)));
    }

    #[test]
    fn what_is_no_number_is_told_in_words_of_the_program() {
        let refusals = refusals(&whole(), &["athermal".to_owned()]);
        let ours = refusals
            .iter()
            .filter(|message| message.contains("expected ") && message.contains("number"));
        assert!(ours.count() >= 6, "{refusals:#?}");
        for words in [
            "invalid digit",
            "invalid float",
            "non-zero type",
            "from empty string",
        ] {
            let foreign = refusals.iter().find(|message| message.contains(words));
            assert_eq!(foreign, None);
        }
    }
}
