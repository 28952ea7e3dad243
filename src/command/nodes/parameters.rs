//! The parameters of a node type as text, from their schema.

use athermal::core::node::inline_toml;
use athermal::core::registry::first_paragraph;
use serde_json::{Map, Value};

use athermal_analysis::figures::paragraph;

/// All parameters of a table, and below each the forms that its value may have.
pub fn explain(schema: &Value) -> String {
    let empty = Map::new();
    let definitions = schema["$defs"].as_object().unwrap_or(&empty);
    let mut page = Page {
        definitions,
        explained: Vec::new(),
        text: String::new(),
    };
    page.properties(schema, None, 1);
    page.text
}

struct Page<'a> {
    definitions: &'a Map<String, Value>,
    /// What has been explained already, and so is not once more.
    explained: Vec<&'a str>,
    text: String,
}

impl<'a> Page<'a> {
    fn line(&mut self, depth: usize, text: &str) {
        let indent = 2 * depth;
        self.text
            .push_str(&paragraph(&" ".repeat(indent), indent + 4, text));
    }

    /// The parameters of a table, but for the one that chooses its form.
    fn properties(&mut self, table: &'a Value, tag: Option<&str>, depth: usize) {
        let required: Vec<&str> = table["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        for (name, property) in table["properties"].as_object().into_iter().flatten() {
            if Some(name.as_str()) == tag {
                continue;
            }
            let default = match &property["default"] {
                Value::Null if required.contains(&name.as_str()) => "; required".to_owned(),
                Value::Null => String::new(),
                default => format!("; default {}", inline_toml(default)),
            };
            let description = described(property);
            self.line(depth, &format!("{name} – {description}{default}"));
            self.forms(property, depth + 1);
        }
    }

    /// The forms that a value may have, where there are several or where it is a table.
    fn forms(&mut self, value: &'a Value, depth: usize) {
        if let Some(name) = value["$ref"]
            .as_str()
            .and_then(|path| path.rsplit('/').next())
            && let Some(definition) = self.definitions.get(name)
        {
            if !self.explained.contains(&name) {
                self.explained.push(name);
                self.forms(definition, depth);
            }
            return;
        }
        let choices = [&value["oneOf"], &value["anyOf"]];
        let choices = choices.iter().filter_map(|choices| choices.as_array());
        for choice in choices.flatten().filter(|choice| choice["type"] != "null") {
            self.choice(choice, depth);
        }
        if value["items"].is_object() {
            self.forms(&value["items"], depth);
        }
        if value["type"] == "object" && value["properties"].is_object() {
            self.properties(value, None, depth);
        }
    }

    fn choice(&mut self, choice: &'a Value, depth: usize) {
        let tag = choice["properties"]
            .as_object()
            .into_iter()
            .flatten()
            .find_map(|(key, property)| Some((key.as_str(), property["const"].as_str()?)));
        let description = described(choice);
        if let Some((key, form)) = tag {
            self.line(depth, &format!("{key} = \"{form}\" – {description}"));
            self.properties(choice, Some(key), depth + 1);
        } else if let Some(name) = choice["const"].as_str() {
            self.line(depth, &format!("\"{name}\" – {description}"));
        } else {
            if !description.is_empty() {
                self.line(depth, &format!("or: {description}"));
            }
            self.forms(choice, depth + usize::from(!description.is_empty()));
        }
    }
}

fn described(value: &Value) -> String {
    let text = value["description"].as_str().unwrap_or_default();
    first_paragraph(text).trim_end_matches('.').to_owned()
}
