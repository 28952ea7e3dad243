//! Topics with names in them: what is subscribed to, and which messages are meant.

use athermal_core::document::{fill_placeholders, placeholders};

/// What a shared subscription begins with: the name of its group follows, and then the topic, under which its messages come.
const SHARED: &str = "$share/";

/// A topic as a machine file has it, with the members of sets filled in. A name in braces that is left stands for one level.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topic {
    levels: Vec<Level>,
    filter: String,
}

/// A level of a topic.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Level {
    Exact(String),
    /// Anything between these.
    Any(String, String),
    /// All that follows.
    Rest,
}

impl Topic {
    /// A topic with these members for names.
    pub fn new(text: &str, members: &[(String, String)]) -> Self {
        let pairs: Vec<_> = members
            .iter()
            .map(|(name, member)| (name.as_str(), member.as_str()))
            .collect();
        let filled = fill_placeholders(text, &pairs);
        let level = |text: &str| match (text, placeholders(text).next()) {
            ("#", _) => Level::Rest,
            ("+", _) => Level::Any(String::new(), String::new()),
            (_, None) => Level::Exact(text.to_owned()),
            (_, Some(_)) => {
                let (before, rest) = text.split_once('{').unwrap_or((text, ""));
                let after = rest.rsplit_once('}').map_or("", |(_, after)| after);
                Level::Any(before.to_owned(), after.to_owned())
            }
        };
        let topic = behind_group(&filled);
        let group = &filled[..filled.len() - topic.len()];
        let levels: Vec<_> = topic.split('/').map(level).collect();
        let filters = levels.iter().map(|level| match level {
            Level::Exact(text) => text.as_str(),
            Level::Any(..) => "+",
            Level::Rest => "#",
        });
        Self {
            filter: group.to_owned() + &filters.collect::<Vec<_>>().join("/"),
            levels,
        }
    }

    /// What is subscribed to.
    pub fn filter(&self) -> &str {
        &self.filter
    }

    /// Whether a message of this topic is meant.
    pub fn matches(&self, topic: &str) -> bool {
        let mut texts = topic.split('/');
        for level in &self.levels {
            let is_meant = match (level, texts.next()) {
                (Level::Rest, _) => return true,
                (_, None) => false,
                (Level::Exact(expected), Some(text)) => expected == text,
                (Level::Any(before, after), Some(text)) => {
                    text.len() >= before.len() + after.len()
                        && text.starts_with(before)
                        && text.ends_with(after)
                }
            };
            if !is_meant {
                return false;
            }
        }
        texts.next().is_none()
    }
}

/// The topic behind the group of a shared subscription; of any other all of it.
fn behind_group(text: &str) -> &str {
    let shared = text.strip_prefix(SHARED);
    let split = shared.and_then(|rest| rest.split_once('/'));
    split.map_or(text, |(_, topic)| topic)
}

/// Whether a topic is that of a shared subscription.
pub fn is_shared(text: &str) -> bool {
    text.starts_with(SHARED)
}

/// Why a topic of a machine file is none, if so.
pub fn mistake(text: &str) -> Option<String> {
    let is_long = text.len() > 65_535;
    if let Some(rest) = text.strip_prefix(SHARED) {
        let (group, topic) = rest.split_once('/').unwrap_or((rest, ""));
        if group.is_empty() || topic.is_empty() || group.contains(['+', '#', '{']) {
            let why =
                "a shared subscription is `$share/GROUP/TOPIC`, with a plain name as its group";
            return Some(why.to_owned());
        }
    }
    let levels: Vec<_> = behind_group(text).split('/').collect();
    let wrong = |level: &&str| level.contains(['+', '#', '\0']) && !matches!(*level, "+" | "#");
    if text.is_empty() || is_long {
        return Some(format!("a topic of {} bytes is none", text.len()));
    }
    if let Some(level) = levels.iter().find(|level| wrong(level)) {
        return Some(format!(
            "`{level}` is no level of a topic: `+` and `#` stand alone"
        ));
    }
    let last = levels.len() - 1;
    let is_early = levels[..last].contains(&"#");
    is_early.then(|| "`#` stands for all that follows, and is the last level".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn topic(text: &str) -> Topic {
        Topic::new(text, &[("sensor".to_owned(), "plate1".to_owned())])
    }

    #[test]
    fn behaviour_22_a_set_is_filled_in_and_any_other_name_is_one_level() {
        for (text, filter, meant, other) in [
            (
                "plant/{sensor}/T",
                "plant/plate1/T",
                "plant/plate1/T",
                "plant/plate2/T",
            ),
            (
                "plant/{line}/{sensor}",
                "plant/+/plate1",
                "plant/a/plate1",
                "plant/a/b/plate1",
            ),
            ("plant/l-{line}/T", "plant/+/T", "plant/l-7/T", "plant/7/T"),
            ("plant/+/T", "plant/+/T", "plant//T", "plant/T"),
            ("plant/#", "plant/#", "plant/a/b", "plants"),
            ("{line}", "+", "anything", "any/thing"),
            (
                "$share/group/plant/{sensor}",
                "$share/group/plant/plate1",
                "plant/plate1",
                "$share/group/plant/plate1",
            ),
            (
                "$share/g/plant/{line}/+",
                "$share/g/plant/+/+",
                "plant/a/b",
                "plant/a",
            ),
            ("$shared/g/a", "$shared/g/a", "$shared/g/a", "a"),
        ] {
            let of = topic(text);
            assert_eq!(of.filter(), filter);
            assert!(of.matches(meant), "{text} means {meant}");
            assert!(!of.matches(other), "{text} does not mean {other}");
        }
        assert!(
            topic("plant/#").matches("plant"),
            "the level above is meant too"
        );
    }

    #[test]
    fn what_is_no_topic_is_said_to_be_none() {
        for text in ["plant/+/{sensor}/#", "$share/group/plant/+", "$share/g//a"] {
            assert_eq!(mistake(text), None, "{text}");
        }
        for text in [
            "",
            "plant/a+",
            "plant/#/T",
            "plant/a#",
            "$share/",
            "$share/g",
            "$share/g/",
            "$share//a",
            "$share/g+/a",
            "$share/{line}/a",
            "$share/g/a+",
        ] {
            assert!(mistake(text).is_some(), "{text}");
        }
    }
}
