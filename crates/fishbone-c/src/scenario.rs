//! Scenarios: the input of a solve.

use crate::boundary::{Refusal, call, free, text, write_handle};
use crate::status::FishboneStatus;
use fishbone::problem::Problem;
use fishbone::scenario::Scenario;
use fishbone::scenario::error::ScenarioError;
use std::ffi::c_char;
use std::fs;
use std::mem::MaybeUninit;

/// A checked scenario: a belt, its supports, its loads.
pub struct FishboneScenario(pub(crate) Problem);

/// Reads a scenario file. Its name is UTF-8 and ends with .toml or .json.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_scenario_load(
    path: *const c_char,
    scenario: Option<&mut MaybeUninit<*mut FishboneScenario>>,
) -> FishboneStatus {
    call(|| {
        // SAFETY: the head of the header has the rule for texts.
        let path = unsafe { text(path) }?;
        let named = |problem: Refusal| problem.of(path);
        write_handle(scenario, loaded(path).map_err(named)?)
    })
}

/// Reads a scenario of a text in TOML.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_scenario_from_toml(
    toml: *const c_char,
    scenario: Option<&mut MaybeUninit<*mut FishboneScenario>>,
) -> FishboneStatus {
    call(|| {
        // SAFETY: the head of the header has the rule for texts.
        let toml = unsafe { text(toml) }?;
        write_handle(scenario, checked(Scenario::from_toml(toml))?)
    })
}

/// Reads a scenario of a text in JSON, of the same structure.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fishbone_scenario_from_json(
    json: *const c_char,
    scenario: Option<&mut MaybeUninit<*mut FishboneScenario>>,
) -> FishboneStatus {
    call(|| {
        // SAFETY: the head of the header has the rule for texts.
        let json = unsafe { text(json) }?;
        write_handle(scenario, checked(Scenario::from_json(json))?)
    })
}

/// Frees a scenario; a null pointer is left alone.
#[unsafe(no_mangle)]
pub extern "C" fn fishbone_scenario_free(scenario: Option<Box<FishboneScenario>>) {
    free(scenario);
}

/// The scenario of a file, read as the suffix of its name says.
fn loaded(path: &str) -> Result<FishboneScenario, Refusal> {
    let read = match path.rsplit_once('.') {
        Some((_, "toml")) => Scenario::from_toml,
        Some((_, "json")) => Scenario::from_json,
        _ => {
            let found = "found another suffix, allowed .toml or .json";
            return Err(Refusal::new(FishboneStatus::FishboneUnreadable, found));
        }
    };
    let unreadable = |error| Refusal::new(FishboneStatus::FishboneUnreadable, error);
    let text = fs::read_to_string(path).map_err(unreadable)?;
    checked(read(&text))
}

fn checked(scenario: Result<Scenario, ScenarioError>) -> Result<FishboneScenario, Refusal> {
    let problem = scenario.and_then(Problem::new)?;
    Ok(FishboneScenario(problem))
}
