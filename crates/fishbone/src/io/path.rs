//! Paths through the space of problems along which numbers change, named as in scenario files.

use crate::analysis::path::{Change, NoPath, Path};
use crate::problem::Problem;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Numbers of a scenario, each from its own value to another.
#[derive(Debug)]
pub(super) struct Numbers {
    base: Value,
    pub(super) numbers: Vec<Number>,
}

/// A number of a scenario that changes.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Number {
    /// Place in the scenario, a JSON pointer.
    pointer: String,
    from: f64,
    to: f64,
}

impl Path {
    /// Numbers of the scenario, each named as in `supports[1].position[2]`, that change together from their own values to
    /// others.
    ///
    /// # Errors
    ///
    /// [`NoPath`] if a field of the scenario holds no number, or if the scenario at the end is not valid.
    pub fn numbers(problem: &Problem, changes: &[(String, f64)]) -> Result<Self, NoPath> {
        let base = tables(problem);
        let number = |(field, to): &(String, f64)| {
            let pointer = pointer(field);
            let found = base.pointer(&pointer);
            let from = found.and_then(Value::as_f64);
            let from = from.ok_or_else(|| NoPath::NoNumber {
                field: field.clone(),
                found: found.map_or("nothing".to_owned(), shown),
                example: "supports[1].position[1]".to_owned(),
            })?;
            Ok(Number {
                pointer,
                from,
                to: *to,
            })
        };
        let numbers: Vec<_> = changes.iter().map(number).collect::<Result<_, _>>()?;
        if numbers.iter().all(|number| number.from == number.to) {
            return Err(NoPath::Nothing);
        }
        Self::new(problem, Numbers { base, numbers })
    }
}

impl Numbers {
    /// The change of numbers of a problem's scenario.
    pub(super) fn of(problem: &Problem, numbers: Vec<Number>) -> Self {
        let base = tables(problem);
        Self { base, numbers }
    }
}

/// The scenario of a problem as tables.
fn tables(problem: &Problem) -> Value {
    serde_json::to_value(problem.scenario()).expect("a scenario is plain data")
}

impl Change for Numbers {
    fn problem(&self, _: &Problem, place: f64) -> Result<Problem, NoPath> {
        let mut tables = self.base.clone();
        for number in &self.numbers {
            if let Some(value) = tables.pointer_mut(&number.pointer) {
                *value = number.at(place).into();
            }
        }
        let scenario = serde_json::from_value(tables)
            .map_err(|error| NoPath::Unreadable(error.to_string()))?;
        Problem::new(scenario).map_err(NoPath::Invalid)
    }

    /// The number that changes if there is only one, else the place itself.
    fn parameter(&self, place: f64) -> f64 {
        match self.numbers.as_slice() {
            [number] => number.at(place),
            _ => place,
        }
    }
}

impl Number {
    fn at(&self, place: f64) -> f64 {
        match place {
            1.0 => self.to,
            _ => self.from + place * (self.to - self.from),
        }
    }
}

/// A value that is no number, as text; its kind if the text is long.
fn shown(value: &Value) -> String {
    /// Length of the longest text that is shown, in bytes.
    const SHORT: usize = 40;
    let text = value.to_string();
    match value {
        Value::Object(_) if text.len() > SHORT => "a table".to_owned(),
        Value::Array(_) if text.len() > SHORT => "a list".to_owned(),
        _ => text,
    }
}

/// The JSON pointer of a field: `supports[1].position[2]` is `/supports/1/position/2`.
fn pointer(field: &str) -> String {
    let parts = field.split(['.', '[', ']']).filter(|part| !part.is_empty());
    parts.flat_map(|part| ["/", part]).collect()
}
