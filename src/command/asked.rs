//! The options of a job as data: what a program gives that calls it. They are those of the command line, by the same structs.

use std::fmt::Display;
use std::path::PathBuf;
use std::str::FromStr;

use athermal::core::diagnostic::{Diagnostics, Sources, names, nearest};
use athermal::core::watch::{Progress, Watch};
use schemars::JsonSchema;
use serde::de::{DeserializeOwned, Error as _};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use crate::message::Message;
use crate::terminal::Failure;

/// What a program asks for, by the names of the options with `_` for `-`.
pub type Asked = Map<String, Value>;

/// What stands for the file of a graph or a model that is in memory.
pub const IN_MEMORY: &str = "model";

/// The path of what is in memory.
pub fn in_memory() -> PathBuf {
    PathBuf::from(IN_MEMORY)
}

/// The options of a job as JSON Schema.
pub fn schema_of<T: JsonSchema>() -> Value {
    schemars::schema_for!(T).into()
}

/// The options of a job.
///
/// # Errors
/// When there is no such option, or a value does not fit one.
fn options<T: DeserializeOwned>(asked: &Asked, schema: &Value) -> Result<T, Failure> {
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
    let given: Asked = asked.iter().map(fitting).collect();
    let read = |given: &Asked| serde_json::from_value::<T>(Value::Object(given.clone()));
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
pub fn done<T: DeserializeOwned + JsonSchema, R>(
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
    let done = options::<T>(asked, &schema).and_then(|options| job(&options, &worded));
    done.map_err(|failure| match failure {
        Failure::Request(text) => Failure::Request(words.put(&text)),
        Failure::Outside(text) => Failure::Outside(words.put(&text)),
        other => other,
    })
}

/// The options of a job as a program knows them: `lenient=True` is `--lenient`.
struct Words(Vec<(String, String, bool)>);

impl Words {
    fn of(schema: &Value) -> Self {
        let properties = schema["properties"].as_object().into_iter().flatten();
        let option = |(key, of): (&String, &Value)| {
            let flag = format!("--{}", key.replace('_', "-"));
            (flag, key.clone(), of["type"] == "boolean")
        };
        Self(properties.map(option).collect())
    }

    /// A text with the options of the command line that these are as they are called here.
    fn put(&self, text: &str) -> String {
        let (mut made, mut rest) = (String::new(), text);
        while let Some(at) = rest.find("--") {
            let (before, from) = rest.split_at(at);
            let is_flag = |c: char| c.is_ascii_lowercase() || c == '-';
            let end = from.find(|c: char| !is_flag(c)).unwrap_or(from.len());
            let (flag, mut after) = from.split_at(end);
            made += before;
            match self.0.iter().find(|(known, ..)| known == flag) {
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
    use athermal::core::watch::Kept;
    use clap::FromArgMatches as _;
    use serde_json::json;

    use super::*;
    use crate::command::evaluate::Evaluate;
    use crate::command::fit::Fit;
    use crate::command::simulate::Simulate;

    fn refused<T: DeserializeOwned + JsonSchema>(asked: &Value) -> String {
        let asked = asked.as_object().unwrap();
        let failure = done::<T, ()>(asked, &Kept::default(), |_, _| Ok(())).unwrap_err();
        failure.to_string()
    }

    #[test]
    fn options_as_data_are_those_of_the_command_line() {
        let all = json!({
            "data": ["a.csv", "b.csv"], "lenient": true, "offset": "b.csv=1.5s", "memory": 7, "threads": 2, "blocks": "day",
            "keep_blocks": "kept", "candidates": true,
        });
        let words = [
            "athermal",
            "fit",
            IN_MEMORY,
            "--output=x",
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
        let of_words = crate::program::whole().try_get_matches_from(words).unwrap();
        let of_words = Fit::from_arg_matches(of_words.subcommand().unwrap().1).unwrap();
        let of_data: Fit = options(all.as_object().unwrap(), &schema_of::<Fit>()).unwrap();
        let of_words = format!("{of_words:?}").replace("output: \"x\"", "output: \"\"");
        assert_eq!(format!("{of_data:?}"), of_words);
        // What is left out is the same, too.
        let of_words = crate::program::whole()
            .try_get_matches_from(["athermal", "simulate", "die-tester"])
            .unwrap();
        let of_words = Simulate::from_arg_matches(of_words.subcommand().unwrap().1).unwrap();
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
        ] {
            assert_eq!(words.put(text), own);
        }
        let kept = Kept::default();
        let asked = json!({ "data": "a.csv" });
        let job = |_: &Evaluate, host: &dyn Watch| {
            host.warning("try fewer `--steps`");
            Err::<(), _>(Failure::Request("--merge joins".to_owned()))
        };
        let failure = done(asked.as_object().unwrap(), &kept, job).unwrap_err();
        assert_eq!(failure.to_string(), "merge=True joins");
        assert_eq!(kept.remarks()[0].message.to_string(), "try fewer `steps`");
    }
}
