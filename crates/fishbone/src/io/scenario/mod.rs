//! Reading of text into a validated scenario, and writing.

mod node;
#[cfg(test)]
mod tests;
mod untagged;

use crate::scenario::Scenario;
use crate::scenario::error::ScenarioError;
use node::{Node, nearest};
use serde::Deserialize;

/// Length of the longest TOML text read, in bytes. Its reader takes up to 240 bytes of memory for each byte of text, so that
/// the length bounds the memory by half a gigabyte.
pub(crate) const LONGEST_TOML: usize = 2_000_000;

/// Length of the longest JSON text read, in bytes. Its reader takes some tens of bytes of memory for each byte of text.
pub(crate) const LONGEST_JSON: usize = 16_000_000;

/// Words for the least scenario in TOML, which complete "must be …".
const LEAST_TOML: &str = r#"at least belt = { width = 0.1, rigidity = 1.0, segments = [{ kind = "straight", length = 1.0 }] }"#;
/// Words for the least scenario in JSON, which complete "must be …".
const LEAST_JSON: &str = r#"at least {"belt": {"width": 0.1, "rigidity": 1.0, "segments": [{"kind": "straight", "length": 1.0}]}}"#;

impl Scenario {
    /// Reads and validates a scenario from TOML.
    ///
    /// Errors: the first thing wrong, with its field or its line.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        let text = checked_text(text, LONGEST_TOML, LEAST_TOML)?;
        let node = toml::from_str(text).map_err(|error| toml_syntax(text, &error))?;
        from_node(node, LEAST_TOML).map_err(with_nearest)
    }

    /// Reads and validates a scenario from JSON of the same structure; `null` stands for a field left out.
    ///
    /// Errors: the first thing wrong, with its field or its line.
    pub fn from_json(text: &str) -> Result<Self, ScenarioError> {
        let text = checked_text(text, LONGEST_JSON, LEAST_JSON)?;
        let node = serde_json::from_str(text).map_err(|error| json_syntax(&error))?;
        from_node(node, LEAST_JSON).map_err(with_nearest)
    }

    /// The scenario as JSON, with every default written out; a valid scenario reads back equal.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(self).expect("a scenario is plain data")
    }
}

/// The JSON Schema of [`Scenario`], as committed in `scenarios/scenario.schema.json`.
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(Scenario);
    let mut text = serde_json::to_string_pretty(&schema).expect("a schema is plain JSON");
    text.push('\n');
    text
}

/// The text without a byte order mark, refused where it is too long or blank.
fn checked_text<'a>(text: &'a str, longest: usize, least: &str) -> Result<&'a str, ScenarioError> {
    if text.len() > longest {
        return Err(ScenarioError::invalid(
            "scenario",
            format!("{} bytes", text.len()),
            format!("a text of at most {longest} bytes"),
        ));
    }
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    if text.trim().is_empty() {
        Err(empty(least))
    } else {
        Ok(text)
    }
}

fn empty(least: &str) -> ScenarioError {
    ScenarioError::invalid("scenario", "an empty text", least)
}

fn from_node(node: Node, least: &str) -> Result<Scenario, ScenarioError> {
    if node == Node::Table(Vec::new()) {
        return Err(empty(least));
    }
    let scenario = Scenario::deserialize(node).map_err(|error| {
        error.0.map_field(|field| {
            if field.is_empty() {
                "scenario".into()
            } else {
                field.into()
            }
        })
    })?;
    scenario.validate()?;
    Ok(scenario)
}

/// An error with the word that was probably meant.
fn with_nearest(mut error: ScenarioError) -> ScenarioError {
    if let ScenarioError::UnknownChoice {
        found,
        nearest: meant,
        allowed,
        ..
    } = &mut error
    {
        *meant = nearest(found, allowed);
    }
    error
}

fn toml_syntax(text: &str, error: &toml::de::Error) -> ScenarioError {
    let start = error.span().map_or(0, |span| span.start.min(text.len()));
    // Bytes, not text: a span may end inside a character.
    let before = &text.as_bytes()[..start];
    let line_start = before
        .iter()
        .rposition(|byte| *byte == b'\n')
        .map_or(0, |at| at + 1);
    ScenarioError::Syntax {
        line: 1 + before.iter().filter(|byte| **byte == b'\n').count(),
        column: 1 + String::from_utf8_lossy(&before[line_start..])
            .chars()
            .count(),
        message: one_line(error.message()),
    }
}

fn json_syntax(error: &serde_json::Error) -> ScenarioError {
    let text = error.to_string();
    let place = format!(" at line {} column {}", error.line(), error.column());
    ScenarioError::Syntax {
        line: error.line(),
        column: error.column(),
        message: one_line(text.strip_suffix(&place).unwrap_or(&text)),
    }
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}
