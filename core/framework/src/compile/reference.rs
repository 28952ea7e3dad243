//! What a reference such as `gradients:stderr.plate?@150s` means as text.

use std::borrow::Cow;

use super::problem;
use crate::diagnostic::Problem;

/// A reference, taken apart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reference<'a> {
    /// The node or signal.
    pub node: &'a str,
    /// The output port, where one is named.
    pub port: Option<&'a str>,
    /// The pattern of channel names, where there is one.
    pub channel: Option<&'a str>,
}

impl<'a> Reference<'a> {
    /// Takes a reference apart: the first `.` or `:` ends the node's name, after a port the next `.` ends the port's.
    #[must_use]
    pub fn parse(text: &'a str) -> Self {
        let Some(end) = text.find(['.', ':']) else {
            return Self {
                node: text,
                port: None,
                channel: None,
            };
        };
        let (node, rest) = (&text[..end], &text[end + 1..]);
        if text.as_bytes()[end] == b'.' {
            return Self {
                node,
                port: None,
                channel: Some(rest),
            };
        }
        match rest.split_once('.') {
            Some((port, channel)) => Self {
                node,
                port: Some(port),
                channel: Some(channel),
            },
            None => Self {
                node,
                port: Some(rest),
                channel: None,
            },
        }
    }
}

impl<'a> Reference<'a> {
    /// The mistake where the node has no such port; none are known of a signal.
    pub fn no_port(&self, known: Vec<&'static str>) -> Box<dyn Problem> {
        let node = self.node.to_owned();
        match self.port {
            Some("") => Box::new(problem::EmptyPort {
                node,
                channel: self.channel.map(str::to_owned),
                known,
            }),
            // A node of which something could not be read may have no port that could be meant.
            port => Box::new(problem::UnknownPort {
                node,
                port: port.unwrap_or_default().to_owned(),
                known,
            }),
        }
    }

    /// The node without the members that are picked out of the modules around it: `axis[Z1]/thermal` is `axis/thermal`.
    pub fn whole_node(&self) -> Cow<'a, str> {
        if !self.is_member() {
            return Cow::Borrowed(self.node);
        }
        let mut whole = String::with_capacity(self.node.len());
        let mut rest = self.node;
        while let Some((before, after)) = rest.split_once('[') {
            whole.push_str(before);
            rest = after.split_once(']').map_or("", |(_, after)| after);
        }
        whole.push_str(rest);
        Cow::Owned(whole)
    }

    /// Whether members are picked out of the modules around the node.
    pub(crate) fn is_member(&self) -> bool {
        self.node.contains('[')
    }
}

/// Whether a pattern has anything to expand, so that it may name several channels.
#[must_use]
pub(crate) fn is_pattern(text: &str) -> bool {
    text.contains(['*', '?', '{'])
}

/// For each alternative of a choice the pattern with that alternative in its place.
pub(crate) fn alternatives(pattern: &str) -> impl Iterator<Item = String> + '_ {
    let starts = pattern.match_indices('{').map(|(start, _)| start);
    let groups = starts.filter_map(|start| Some((start, start + pattern[start..].find('}')?)));
    groups.flat_map(move |(start, end)| {
        let inside = pattern[start + 1..end].split(',');
        inside.map(move |of| format!("{}{of}{}", &pattern[..start], &pattern[end + 1..]))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::document::Pattern;

    fn matches(pattern: &str, name: &str) -> bool {
        Pattern::new(pattern).matches(name)
    }

    #[test]
    fn the_first_dot_or_colon_ends_the_node_and_the_next_dot_ends_the_port() {
        let whole = Reference::parse("gradients:stderr.room@429.089s");
        assert_eq!(
            (whole.node, whole.port, whole.channel),
            ("gradients", Some("stderr"), Some("room@429.089s"))
        );
        let channel = Reference::parse("gradients.room@429.089s");
        assert_eq!(
            (channel.node, channel.port, channel.channel),
            ("gradients", None, Some("room@429.089s"))
        );
        assert_eq!(Reference::parse("vote").channel, None);
        assert_eq!(Reference::parse("vote:weights").port, Some("weights"));
    }

    #[test]
    fn stars_question_marks_and_choices_match_channel_names() {
        assert!(matches("*", "room"));
        assert!(matches("plate?@*", "plate1@150s"));
        assert!(!matches("plate?@*", "plate12@150s"));
        assert!(matches("{plate,holder}1@150s", "holder1@150s"));
        assert!(!matches("{plate,holder}1", "room"));
        assert!(matches("*a*b*", "xxaxxbxx") && !matches("*a*b*", "xxbxxaxx"));
    }

    #[test]
    fn each_alternative_is_a_pattern_with_the_other_choices_left_open() {
        let of = |pattern| alternatives(pattern).collect::<Vec<_>>();
        assert_eq!(
            of("{plate,holder}{1,2}@*"),
            [
                "plate{1,2}@*",
                "holder{1,2}@*",
                "{plate,holder}1@*",
                "{plate,holder}2@*"
            ]
        );
        assert!(of("plate?@*").is_empty() && of("{plate").is_empty());
    }

    #[test]
    fn a_choice_inside_a_choice_or_left_open_ends_and_matches_as_it_is() {
        assert!(!matches("{a,{b", "b"));
        assert!(!matches(&"{a,b}".repeat(40), "x"));
    }
}
