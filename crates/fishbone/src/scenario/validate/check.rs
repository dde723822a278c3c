//! Checks shared by all parts of a scenario, and the wording of a refusal.

use crate::scenario::error::{ScenarioError, number};
use std::fmt::{Arguments, Display};
use std::ops::RangeInclusive;

/// Magnitudes of lengths, rigidities and forces, in the scenario's units: outside this range, results would overflow or
/// vanish.
pub(super) const MAGNITUDES: RangeInclusive<f64> = 1e-100..=1e100;

/// Greatest distance of positions, in U: farther away, too few digits are left for the shape.
const FARTHEST: f64 = 1e6;

pub(super) type Check = Result<(), ScenarioError>;

/// Refuses with (found, allowed) unless the condition holds; texts are made only for an error, as arrays may be long.
pub(super) fn require<F: Display, A: Display>(
    holds: bool,
    field: Arguments,
    texts: impl FnOnce() -> (F, A),
) -> Check {
    if holds {
        return Ok(());
    }
    let (found, allowed) = texts();
    Err(ScenarioError::invalid(
        field.to_string(),
        found.to_string(),
        allowed.to_string(),
    ))
}

/// The names of the given fields.
pub(super) fn given<'a>(fields: &[(&'a str, bool)]) -> Vec<&'a str> {
    let given = fields.iter().filter(|(_, is_given)| *is_given);
    given.map(|(name, _)| *name).collect()
}

pub(super) fn between<T: Display>(range: &RangeInclusive<T>) -> String {
    format!("from {} to {}", range.start(), range.end())
}

pub(super) fn span(range: &RangeInclusive<f64>) -> String {
    let bound = |value: f64| match value == 0.0 || (1.0..1e6).contains(&value) {
        true => format!("{value}"),
        false => format!("{value:e}"),
    };
    format!("from {} to {}", bound(*range.start()), bound(*range.end()))
}

pub(super) fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

pub(super) fn positive(field: Arguments, value: f64) -> Check {
    require(is_positive(value), field, || {
        (number(value), "a positive finite number")
    })
}

/// A positive number from which energies and forces can be computed.
pub(super) fn measurable(field: Arguments, value: f64) -> Check {
    positive(field, value)?;
    require(MAGNITUDES.contains(&value), field, || {
        (number(value), span(&MAGNITUDES))
    })
}

/// A number from which energies and forces can be computed, 0 and negative ones among them.
pub(super) fn bounded(field: Arguments, value: f64) -> Check {
    finite(field, value)?;
    let most = MAGNITUDES.end();
    require(value.abs() <= *most, field, || {
        (number(value), format!("at most {most:e} in magnitude"))
    })
}

pub(super) fn not_negative(field: Arguments, value: f64) -> Check {
    require(value >= 0.0 && value.is_finite(), field, || {
        (number(value), "a finite number, not negative")
    })?;
    bounded(field, value)
}

pub(super) fn finite(field: Arguments, value: f64) -> Check {
    require(value.is_finite(), field, || {
        (number(value), "a finite number")
    })
}

pub(super) fn bounded_vector(field: Arguments, vector: &[f64]) -> Check {
    for (j, value) in vector.iter().enumerate() {
        bounded(format_args!("{field}[{j}]"), *value)?;
    }
    Ok(())
}

pub(super) fn finite_vector(field: Arguments, vector: &[f64]) -> Check {
    for (j, value) in vector.iter().enumerate() {
        finite(format_args!("{field}[{j}]"), *value)?;
    }
    Ok(())
}

/// A coordinate that leaves digits for the shape of a belt of this length.
pub(super) fn near(field: Arguments, value: f64, length: f64) -> Check {
    finite(field, value)?;
    require(value.abs() <= FARTHEST * length, field, || {
        (
            number(value),
            format!("within {FARTHEST:e} lengths of the belt"),
        )
    })
}

pub(super) fn near_vector(field: Arguments, vector: &[f64], length: f64) -> Check {
    for (j, value) in vector.iter().enumerate() {
        near(format_args!("{field}[{j}]"), *value, length)?;
    }
    Ok(())
}

/// An array short enough that the work stays bounded.
pub(super) fn at_most(field: Arguments, count: usize, most: usize, what: &str) -> Check {
    require(count <= most, field, || {
        (format!("{count} {what}"), format!("at most {most}"))
    })
}
