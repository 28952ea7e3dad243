//! The options of a job as data: what a program gives that calls it. They are those of the command line, by the same structs: `keep_blocks`
//! is `--keep-blocks`.

use std::fmt::Display;
use std::str::FromStr;
use std::sync::OnceLock;

use athermal_core::diagnostic::{Diagnostics, Sources, names, nearest};
use athermal_core::failure::Failure;
use athermal_core::message::Message;
use athermal_core::watch::{Progress, Watch};
use athermal_files::Tables;
use schemars::JsonSchema;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::compare::Compare;
use crate::diagnose::Diagnose;
use crate::evaluate::Evaluate;
use crate::fit::Fit;
use crate::init::Init;
use crate::predict::Predict;
use crate::report::Report;
use crate::simulate::Simulate;

/// What a program asks for.
#[derive(Debug, Clone, Default)]
pub struct Asked {
    /// The options by their names, with `_` for `-`.
    pub options: Map<String, Value>,
    /// What stands for files of these names.
    pub tables: Tables,
}

/// The options of a job.
pub trait Job: DeserializeOwned + JsonSchema {
    /// From now on tables in memory stand for files of their names.
    fn lend(&mut self, _: &Tables) {}
}

macro_rules! jobs {
    ($($name:literal $job:ty, $($part:ident).*;)*) => {
        $(impl Job for $job {
            fn lend(&mut self, tables: &Tables) {
                self.$($part.)*lend(tables);
            }
        })*

        /// The options of each job, as a JSON Schema by its name.
        #[must_use]
        pub fn schemas() -> Vec<(&'static str, Value)> {
            vec![$(($name, schema_of::<$job>()),)* ("simulate", schema_of::<Simulate>())]
        }
    };
}

jobs! {
    "fit" Fit, data;
    "predict" Predict, data;
    "evaluate" Evaluate, data;
    "report" Report, data;
    "diagnose" Diagnose, data;
    "compare" Compare, data;
    "init" Init, ;
}

impl Job for Simulate {}

fn schema_of<T: JsonSchema>() -> Value {
    schemars::schema_for!(T).into()
}

/// The options of a job.
///
/// # Errors
/// When there is no such option, or a value does not fit one.
fn options<T: DeserializeOwned>(asked: &Map<String, Value>, schema: &Value) -> Result<T, Failure> {
    let known: Vec<&String> = schema["properties"]
        .as_object()
        .into_iter()
        .flat_map(Map::keys)
        .collect();
    if let Some(unknown) = asked.keys().find(|key| !known.contains(key)) {
        let near = nearest(unknown, known.iter().map(|of| of.as_str()));
        let advice = match near {
            Some(near) => format!("did you mean `{near}`?"),
            None => format!("there are {}", names(known)),
        };
        return Err(Failure::Request(format!(
            "there is no option `{unknown}`; {advice}"
        )));
    }
    // One stands for a list of one, a number for its text, and what has no form of its own in JSON goes by its text.
    let fitting = |(key, value): (&String, &Value)| {
        let of = schema["properties"][key]["type"].to_string();
        let value = match value {
            Value::Array(_) => value.clone(),
            one if of.contains("array") => Value::from(vec![one.clone()]),
            Value::Number(number) if of.contains("string") => number.to_string().into(),
            Value::String(text) if of.contains("integer") || of.contains("number") => {
                serde_json::from_str(text).unwrap_or_else(|_| value.clone())
            }
            one => one.clone(),
        };
        (key.clone(), value)
    };
    let given: Map<String, Value> = asked.iter().map(fitting).collect();
    let read =
        |given: &Map<String, Value>| serde_json::from_value::<T>(Value::Object(given.clone()));
    read(&given).map_err(|error| {
        let without = |key: &&String| {
            let others = given.iter().filter(|(other, _)| other != key);
            read(
                &others
                    .map(|(key, value)| (key.clone(), value.clone()))
                    .collect(),
            )
            .is_ok()
        };
        Failure::Request(match given.keys().find(without) {
            Some(key) => format!("{key}={}: {error}", given[key]),
            None => error.to_string(),
        })
    })
}

/// Does a job as it is asked for. What is remarked on the way, and why it is not done, names options as whoever asks knows them.
///
/// # Errors
/// When there is no such option, or a value does not fit one; and as of the job.
pub fn done<T: Job, R>(
    asked: &Asked,
    host: &dyn Watch,
    job: impl FnOnce(&T, &dyn Watch) -> Result<R, Failure>,
) -> Result<R, Failure> {
    let schema = schema_of::<T>();
    let words = Words::of(&schema);
    let worded = Worded {
        host,
        words: &words,
    };
    let done = options::<T>(&asked.options, &schema).and_then(|mut options| {
        options.lend(&asked.tables);
        job(&options, &worded)
    });
    done.map_err(|failure| match failure {
        Failure::Request(text) => Failure::Request(words.put(&text)),
        Failure::Outside(text) => Failure::Outside(words.put(&text)),
        other => other,
    })
}

/// Options as a program knows them: `lenient=True` is `--lenient`. One that the job lacks is that of another. Looked up when a text first
/// needs it.
struct Words {
    own: Value,
    known: OnceLock<Known>,
}

/// The options, as flags, by their keys and whether they are switches; and the names of the jobs.
type Known = (Vec<(String, String, bool)>, Vec<&'static str>);

impl Words {
    fn of(schema: &Value) -> Self {
        Self {
            own: schema.clone(),
            known: OnceLock::new(),
        }
    }

    fn known(&self) -> &Known {
        self.known.get_or_init(|| {
            let all = schemas();
            let schemas = std::iter::once(&self.own).chain(all.iter().map(|(_, schema)| schema));
            let keys = schemas
                .flat_map(|schema| schema["properties"].as_object())
                .flatten();
            let option = |(key, of): (&String, &Value)| {
                let flag = format!("--{}", key.replace('_', "-"));
                (flag, key.clone(), of["type"] == "boolean")
            };
            (
                keys.map(option).collect(),
                all.iter().map(|(name, _)| *name).collect(),
            )
        })
    }

    /// A text in which options of the command line, and its calls, are as a program writes them.
    fn put(&self, text: &str) -> String {
        let parts = text.split('`').enumerate();
        let parts = parts.map(|(nth, part)| match part.strip_prefix("athermal ") {
            Some(call) if nth % 2 == 1 => self.call(call).unwrap_or_else(|| part.to_owned()),
            _ => part.to_owned(),
        });
        self.options(&parts.collect::<Vec<_>>().join("`"))
    }

    /// A call of the command line as one of a function, where there is one and options say which; `athermal init` alone names the command.
    fn call(&self, call: &str) -> Option<String> {
        let (name, rest) = call.split_once(' ').unwrap_or((call, ""));
        let (options, jobs) = self.known();
        jobs.iter().find(|known| **known == name)?;
        let mut words = rest.split(' ');
        let mut given = Vec::new();
        while let Some(word) = words.next() {
            if let Some((_, key, is_switch)) = options.iter().find(|(flag, ..)| flag == word) {
                let value = match is_switch {
                    true => "True",
                    false => words.next().unwrap_or("…"),
                };
                given.push(format!("{key}={value}"));
            }
        }
        (!given.is_empty()).then(|| format!("{name}({})", given.join(", ")))
    }

    fn options(&self, text: &str) -> String {
        let (mut made, mut rest) = (String::new(), text);
        while let Some(at) = rest.find("--") {
            let (before, from) = rest.split_at(at);
            let is_flag = |c: char| c.is_ascii_lowercase() || c == '-';
            let end = from.find(|c: char| !is_flag(c)).unwrap_or(from.len());
            let (flag, mut after) = from.split_at(end);
            made += before;
            match self.known().0.iter().find(|(known, ..)| known == flag) {
                None => made += flag,
                Some((_, key, true)) => made += &format!("{key}=True"),
                Some((_, key, false)) => {
                    made += key;
                    if let Some(value) = after.strip_prefix(' ').filter(|_| before.ends_with('`')) {
                        made.push('=');
                        after = value;
                    }
                }
            }
            rest = after;
        }
        made + rest
    }
}

/// A host who calls options otherwise than the command line.
struct Worded<'a> {
    host: &'a dyn Watch,
    words: &'a Words,
}

impl Watch for Worded<'_> {
    fn remark(&self, level: &'static str, message: Message) {
        self.host
            .remark(level, message.reworded(|text| self.words.put(text)));
    }

    fn begin(&self, what: &str, total: Option<u64>) -> Box<dyn Progress> {
        self.host.begin(what, total)
    }

    fn doubts(&self, diagnostics: &Diagnostics, sources: &Sources) {
        self.host.doubts(diagnostics, sources);
    }
}

/// Reads what has a form of its own in a text.
pub fn by_text<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    from: D,
) -> Result<T, D::Error> {
    String::deserialize(from)?.parse().map_err(D::Error::custom)
}

/// The same of one that may be left out.
pub fn some_by_text<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    from: D,
) -> Result<Option<T>, D::Error> {
    let text = Option::<String>::deserialize(from)?;
    text.map(|text| text.parse().map_err(D::Error::custom))
        .transpose()
}

/// The same of several.
pub fn all_by_text<'de, D: Deserializer<'de>, T: FromStr<Err: Display>>(
    from: D,
) -> Result<Vec<T>, D::Error> {
    let texts = Vec::<String>::deserialize(from)?.into_iter();
    texts
        .map(|text| text.parse().map_err(D::Error::custom))
        .collect()
}

#[cfg(test)]
mod tests {
    use athermal_core::watch::Kept;
    use clap::Args;
    use serde_json::json;

    use super::*;

    fn asked(options: &Value) -> Asked {
        Asked {
            options: options.as_object().unwrap().clone(),
            ..Asked::default()
        }
    }

    /// What the command line makes of words.
    fn of_words<T: Args + clap::FromArgMatches>(words: &[&str]) -> T {
        let command = T::augment_args(clap::Command::new("job"));
        let matches = command.try_get_matches_from([&["job"], words].concat());
        T::from_arg_matches(&matches.unwrap()).unwrap()
    }

    fn refused<T: Job>(options: &Value) -> String {
        let failure = done::<T, ()>(&asked(options), &Kept::default(), |_, _| Ok(())).unwrap_err();
        failure.to_string()
    }

    #[test]
    fn options_as_data_are_those_of_the_command_line() {
        let all = json!({
            "data": ["a.csv", "b.csv"], "lenient": true, "offset": "b.csv=1.5s", "memory": 7, "threads": 2, "blocks": "day",
            "keep_blocks": "kept", "candidates": true,
        });
        let words = [
            "--data",
            "a.csv",
            "b.csv",
            "--lenient",
            "--offset=b.csv=1.5s",
            "--memory=7",
            "--threads=2",
            "--blocks=day",
            "--keep-blocks=kept",
            "--candidates",
        ];
        let of_words: Fit = of_words(&words);
        let of_data: Fit = options(all.as_object().unwrap(), &schema_of::<Fit>()).unwrap();
        assert_eq!(format!("{of_data:?}"), format!("{of_words:?}"));
        // What is left out is the same, too.
        let of_words: Simulate = self::of_words(&["die-tester"]);
        let asked = json!({ "machine": "die-tester" });
        let schema = schema_of::<Simulate>();
        let of_data: Simulate = options(asked.as_object().unwrap(), &schema).unwrap();
        assert_eq!(format!("{of_data:?}"), format!("{of_words:?}"));
    }

    #[test]
    fn what_is_no_option_or_does_not_fit_one_is_refused_by_its_name() {
        let data = json!(["a.csv"]);
        for (asked, words) in [
            (
                json!({ "data": data, "lenien": true }),
                "there is no option `lenien`; did you mean `lenient`?",
            ),
            (
                json!({ "data": data, "threads": "many" }),
                "threads=\"many\": invalid type",
            ),
            (
                json!({ "data": data, "offset": "b.csv" }),
                "expected a file and a time",
            ),
            (json!({}), "missing field `data`"),
        ] {
            let refused = refused::<Fit>(&asked);
            assert!(refused.contains(words), "{refused}");
        }
        let asked = json!({ "data": data, "abs_truth_below": "250 apples" });
        assert!(refused::<Evaluate>(&asked).contains("abs_truth_below=\"250 apples\": "));
    }

    #[test]
    fn remarks_name_options_as_whoever_asks_knows_them() {
        let words = Words::of(&schema_of::<Evaluate>());
        for (text, own) in [
            (
                "read it leniently (`--lenient`)",
                "read it leniently (`lenient=True`)",
            ),
            (
                "the number of steps: `--steps 3`",
                "the number of steps: `steps=3`",
            ),
            ("--abs-truth-below 1 nm: none", "abs_truth_below 1 nm: none"),
            (
                "build with `--features parquet`",
                "build with `--features parquet`",
            ),
            ("no option", "no option"),
            (
                "score it alone by `athermal evaluate --each-on-its-own`",
                "score it alone by `evaluate(each_on_its_own=True)`",
            ),
            (
                "run `athermal fit g.toml --data FILE -o MODEL` and use MODEL",
                "run `fit(data=FILE)` and use MODEL",
            ),
            ("raise `--memory`", "raise `memory`"),
            (
                "`athermal simulate` lists them",
                "`athermal simulate` lists them",
            ),
            ("see `athermal nodes slope`", "see `athermal nodes slope`"),
        ] {
            assert_eq!(words.put(text), own);
        }
        let kept = Kept::default();
        let asked = asked(&json!({ "data": "a.csv" }));
        let job = |_: &Evaluate, host: &dyn Watch| {
            host.warning("try fewer `--steps`");
            Err::<(), _>(Failure::Request("--merge joins".to_owned()))
        };
        let failure = done(&asked, &kept, job).unwrap_err();
        assert_eq!(failure.to_string(), "merge=True joins");
        assert_eq!(kept.remarks()[0].message.to_string(), "try fewer `steps`");
    }
}
