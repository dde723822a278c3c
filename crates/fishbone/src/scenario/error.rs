//! Faults of a scenario, as data and as one line for people.

use crate::names::named;
use thiserror::Error;

/// The reason why a scenario is refused. Its text is one line: the field, the value found, the values allowed.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ScenarioError {
    /// The text is neither TOML nor JSON, or names one key twice.
    #[error("line {line}, column {column}: {message}")]
    Syntax {
        /// Line of the text, from 1.
        line: usize,
        /// Column in that line in characters, from 1.
        column: usize,
        /// The parser's message.
        message: String,
    },
    /// A field that the schema does not have.
    #[error("{field}: unknown field, {}allowed: {}", hint(nearest), allowed.join(", "))]
    UnknownField {
        /// Path of the field, as in `supports[1].positon`.
        field: String,
        /// The field that was probably meant.
        nearest: Option<String>,
        /// The fields that may stand there.
        allowed: Vec<String>,
    },
    /// A word outside a closed list of words.
    #[error("{field}: found \"{found}\", allowed: {}{}", allowed.join(", "), question(nearest))]
    UnknownChoice {
        /// Path of the field.
        field: String,
        /// The word found.
        found: String,
        /// The word that was probably meant.
        nearest: Option<String>,
        /// The words that may stand there.
        allowed: Vec<String>,
    },
    /// A value of the wrong type, outside its range, or in contradiction to another.
    #[error("{field}: found {found}, must be {allowed}")]
    Invalid {
        /// Path of the field.
        field: String,
        /// The value found.
        found: String,
        /// The values allowed; completes "must be …".
        allowed: String,
    },
}

named!(impl ScenarioError {
    Syntax = "syntax",
    UnknownField = "unknown_field",
    UnknownChoice = "unknown_choice",
    Invalid = "invalid",
});

/// Length of the longest piece of the input that an error repeats, in characters.
pub(crate) const LONGEST_QUOTE: usize = 60;

impl ScenarioError {
    /// The error of a word outside a list of words, at no field yet.
    pub(crate) fn choice(found: &str, words: &[&str]) -> Self {
        Self::UnknownChoice {
            field: String::new(),
            found: cut(found),
            nearest: None,
            allowed: words.iter().map(|word| (*word).to_owned()).collect(),
        }
    }

    /// An [`ScenarioError::Invalid`] of these parts.
    pub(crate) fn invalid(
        field: impl Into<String>,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> Self {
        Self::Invalid {
            field: field.into(),
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// Path of the field at fault; `None` for a syntax error.
    pub fn field(&self) -> Option<&str> {
        match self {
            Self::Syntax { .. } => None,
            Self::UnknownField { field, .. }
            | Self::UnknownChoice { field, .. }
            | Self::Invalid { field, .. } => Some(field),
        }
    }

    /// The same error at another path.
    pub(crate) fn map_field(mut self, map: impl FnOnce(&str) -> String) -> Self {
        match &mut self {
            Self::Syntax { .. } => {}
            Self::UnknownField { field, .. }
            | Self::UnknownChoice { field, .. }
            | Self::Invalid { field, .. } => *field = map(field),
        }
        self
    }
}

/// A number as TOML writes it.
pub(crate) fn number(value: f64) -> String {
    if value.is_nan() {
        "nan".into()
    } else {
        format!("{value:?}")
    }
}

/// A text on one line, cut to a readable length.
pub(crate) fn cut(text: &str) -> String {
    let mut characters = text.chars();
    let head: String = characters.by_ref().take(LONGEST_QUOTE).collect();
    let tail = if characters.next().is_some() {
        "…"
    } else {
        ""
    };
    head.escape_debug().to_string() + tail
}

fn hint(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or_else(String::new, |word| format!("did you mean \"{word}\"? "))
}

fn question(nearest: &Option<String>) -> String {
    nearest
        .as_ref()
        .map_or_else(String::new, |word| format!(" (did you mean \"{word}\"?)"))
}
