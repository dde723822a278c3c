//! Conditions on a scenario beyond its types.

mod belt;
mod check;
mod outside;

use super::{EnergyModel, Method, Scenario, SolverSpec, SupportSpec};
use crate::scenario::error::{ScenarioError, number};
use check::{Check, between, finite_vector, is_positive, require, span};
use nalgebra::Vector3;
use outside::{Extent, check_links, check_supports};
use std::ops::RangeInclusive;

/// Tolerances of the solver, lengths in U and energy in mean R_f/U: finer ones are below rounding, coarser ones give no
/// equilibrium.
const TOLERANCES: RangeInclusive<f64> = 1e-13..=1e-2;

/// Estimated errors that may be asked for, relative.
const ACCURACIES: RangeInclusive<f64> = 1e-6..=0.1;
/// Smallest snaps that may be asked for, in V.
const SNAP_SIZES: RangeInclusive<f64> = 0.0..=10.0;
/// Elements of the mesh, a number.
const ELEMENTS: RangeInclusive<usize> = 4..=100_000;
/// Basis functions of each unknown of the Ritz method, a number.
const RITZ_BASIS: RangeInclusive<usize> = 6..=40;
/// Collocation points of the Ritz method, a number.
const RITZ_POINTS: RangeInclusive<usize> = 2..=500;
/// Penalty factors of the Ritz method, in R_f/U.
const RITZ_PENALTIES: RangeInclusive<f64> = 1e-6..=1e12;
/// Multiplier updates of the Ritz method, a number.
const RITZ_UPDATES: RangeInclusive<usize> = 0..=1000;

impl Scenario {
    /// Checks every value.
    ///
    /// Supports that no shape of the belt can meet are no error here: that is an outcome of the solve.
    ///
    /// Errors: the first thing wrong, with its field.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        self.belt.check()?;
        self.check_energy()?;
        let extent = self.extent();
        check_supports(&self.supports, extent)?;
        check_links(&self.links, extent)?;
        self.loads.check(extent)?;
        self.solver.check()?;
        self.check_elements()?;
        match self.solver.method {
            Method::Intrinsic => Ok(()),
            Method::Ritz => self.check_ritz(extent.length),
        }
    }

    fn check_energy(&self) -> Check {
        let is_known =
            self.energy_model() != EnergyModel::Shell || self.belt.stretching().is_some();
        require(is_known, format_args!("energy"), || {
            (
                "\"shell\" of a belt without a thickness",
                "another energy, or have belt.thickness, belt.material or belt.layers given",
            )
        })
    }

    /// Checks the replacement for a support of a valid scenario, at the same place along the belt.
    ///
    /// Errors: the first thing wrong, with its field.
    pub(crate) fn check_support(&self, i: usize, support: &SupportSpec) -> Check {
        support.check(i, self.extent())
    }

    fn extent(&self) -> Extent {
        Extent {
            length: self.belt.length(),
            closed: self.belt.closed,
        }
    }

    fn check_elements(&self) -> Check {
        let Some(elements) = self.solver.elements else {
            return Ok(());
        };
        let field = format_args!("solver.elements");
        require(ELEMENTS.contains(&elements), field, || {
            (elements.to_string(), between(&ELEMENTS))
        })?;
        let least = self.break_points().len() - 1;
        require(least <= elements, field, || {
            (
                elements.to_string(),
                format!(
                    "at least {least}, one a stretch between joints, supports, links and point loads"
                ),
            )
        })
    }

    /// Checks the limits of the source's own method: straight belts with a connector at either end.
    fn check_ritz(&self, length: f64) -> Check {
        let refused = [
            (
                self.energy_model() == EnergyModel::Shell,
                "energy = \"shell\"",
                "an energy of developable belts",
            ),
            (
                !self.belt.is_straight(),
                "a belt that is not straight",
                "straight segments alone",
            ),
            (self.belt.closed, "a closed belt", "an open belt"),
            (
                self.belt.rigidity_value().is_none(),
                "a rigidity that varies",
                "one rigidity",
            ),
            (
                self.belt.has_natural_bend(),
                "a natural bend",
                "a natural bend of 0",
            ),
            (!self.links.is_empty(), "links", "no links"),
            (!self.loads.is_empty(), "loads", "no loads"),
            (
                self.supports.iter().any(|s| s.hinge.is_some()),
                "a hinge",
                "no hinges",
            ),
            (
                !self.is_clamped_at_both_ends(length),
                "other supports than two clamped ends",
                "both ends alone held in position and orientation with square ribs",
            ),
        ];
        let Some((_, found, cure)) = refused.into_iter().find(|(given, ..)| *given) else {
            return Ok(());
        };
        require(false, format_args!("solver.method"), || {
            (
                format!("\"ritz\" with {found}"),
                format!("\"intrinsic\", or have {cure}"),
            )
        })
    }

    fn is_clamped_at_both_ends(&self, length: f64) -> bool {
        let clamped = |support: &SupportSpec| {
            support.at.is_end(length)
                && support.point().is_some()
                && support.frame().is_some()
                && support.is_square_rib(length)
        };
        self.supports.len() == 2 && self.supports.iter().all(clamped)
    }
}

impl SolverSpec {
    fn check(&self) -> Check {
        let tolerance = self.tolerance;
        require(
            TOLERANCES.contains(&tolerance),
            format_args!("solver.tolerance"),
            || (number(tolerance), span(&TOLERANCES)),
        )?;
        let accuracy = self.accuracy;
        require(
            ACCURACIES.contains(&accuracy),
            format_args!("solver.accuracy"),
            || (number(accuracy), span(&ACCURACIES)),
        )?;
        let snap_size = self.snap_size;
        require(
            SNAP_SIZES.contains(&snap_size),
            format_args!("solver.snap_size"),
            || (number(snap_size), span(&SNAP_SIZES)),
        )?;
        finite_vector(format_args!("solver.bulge"), &self.bulge)?;
        let norm = Vector3::from(self.bulge).norm();
        require(is_positive(norm), format_args!("solver.bulge"), || {
            (
                format!("a vector of length {}", number(norm)),
                "of a positive finite length",
            )
        })?;
        self.check_ritz()
    }

    fn check_ritz(&self) -> Check {
        let ritz = &self.ritz;
        let fits = RITZ_BASIS.contains(&ritz.basis) && ritz.basis.is_multiple_of(2);
        require(fits, format_args!("solver.ritz.basis"), || {
            (
                ritz.basis.to_string(),
                format!("an even number {}", between(&RITZ_BASIS)),
            )
        })?;
        within("points", ritz.points, &RITZ_POINTS)?;
        require(
            RITZ_PENALTIES.contains(&ritz.penalty),
            format_args!("solver.ritz.penalty"),
            || (number(ritz.penalty), span(&RITZ_PENALTIES)),
        )?;
        within("updates", ritz.updates, &RITZ_UPDATES)
    }
}

fn within(name: &str, value: usize, range: &RangeInclusive<usize>) -> Check {
    require(
        range.contains(&value),
        format_args!("solver.ritz.{name}"),
        || (value.to_string(), between(range)),
    )
}
