//! What a scenario must satisfy beyond its types: first that it makes sense, then that this release can solve it.

use super::node::number;
use super::{
    BeltSpec, LinkSpec, LoadsSpec, Material, Method, Place, Rigidity, RigidityTable, SAME_PLACE,
    Scenario, SegmentSpec, SolverSpec, SupportSpec,
};
use crate::error::ScenarioError;
use nalgebra::{Vector3, Vector4};
use std::f64::consts::PI;
use std::fmt::{Arguments, Display};
use std::ops::RangeInclusive;

/// How far the norm of a quaternion may be off 1.
const QUATERNION_TOLERANCE: f64 = 1e-6;

/// Lengths, rigidities and forces outside this range would overflow or vanish in what is computed from them.
const MAGNITUDES: RangeInclusive<f64> = 1e-100..=1e100;
/// Positions farther away than this, in U, leave too few digits for the shape.
const FARTHEST: f64 = 1e6;
/// Rotations by more than this, in rad, leave too few digits for the direction.
const LARGEST_ANGLE: f64 = 1e6;
/// Finer tolerances are below rounding, coarser ones no equilibrium.
const TOLERANCES: RangeInclusive<f64> = 1e-13..=1e-2;

const ELEMENTS: RangeInclusive<usize> = 4..=100_000;
const RITZ_BASIS: RangeInclusive<usize> = 6..=40;
const RITZ_POINTS: RangeInclusive<usize> = 2..=500;
const RITZ_PENALTIES: RangeInclusive<f64> = 1e-6..=1e12;
const RITZ_UPDATES: RangeInclusive<usize> = 0..=1000;

const ORIENTATIONS: &str = "one of rotation, euler, quaternion";

type Check = Result<(), ScenarioError>;

impl Scenario {
    /// Checks every value, then that this release can solve the scenario.
    ///
    /// Supports that no shape of the belt can meet are no error here: that is an outcome of the solve.
    ///
    /// Errors: [`ScenarioError::Invalid`] or [`ScenarioError::Unsupported`], whichever is met first.
    pub fn validate(&self) -> Result<(), ScenarioError> {
        self.belt.check()?;
        let length = self.belt.length();
        self.check_supports(length)?;
        for (i, link) in self.links.iter().enumerate() {
            link.check(i, length)?;
        }
        self.loads.check(length)?;
        self.solver.check()?;
        self.check_elements()?;
        self.check_solvable(length)?;
        self.check_method(length)
    }

    /// The source's own method knows belts with a connector at either end and no others.
    fn check_method(&self, length: f64) -> Check {
        let clamp = |support: &SupportSpec| {
            support.point().is_some() && support.frame().is_some() && support.is_square_rib(length)
        };
        let clamped = self.supports.len() == 2 && self.supports.iter().all(clamp);
        let fits = self.solver.method == Method::Intrinsic || clamped;
        require(fits, format_args!("solver.method"), || {
            (
                "\"ritz\" with an end that is not clamped",
                "\"intrinsic\", or both ends held in position and orientation with square ribs",
            )
        })
    }

    fn check_supports(&self, length: f64) -> Check {
        for (i, support) in self.supports.iter().enumerate() {
            support.check(i, length)?;
        }
        for (i, pair) in self.supports.windows(2).enumerate() {
            check_order(i + 1, [&pair[0].at, &pair[1].at], length)?;
        }
        Ok(())
    }

    fn check_elements(&self) -> Check {
        let elements = self.elements();
        let source = if self.solver.elements.is_some() {
            ""
        } else {
            " by default (8 U/V)"
        };
        require(
            ELEMENTS.contains(&elements),
            format_args!("solver.elements"),
            || (format!("{elements}{source}"), between(&ELEMENTS)),
        )?;
        let segments = self.belt.segments.len();
        require(
            segments <= elements,
            format_args!("solver.elements"),
            || {
                (
                    format!("{elements}{source} for {segments} segments"),
                    "at least one a segment",
                )
            },
        )
    }

    fn check_solvable(&self, length: f64) -> Check {
        self.belt.check_solvable()?;
        for (i, support) in self.supports.iter().enumerate() {
            support.check_solvable(i, length)?;
        }
        refuse(
            !self.links.is_empty(),
            format_args!("links"),
            "links, leave them out",
        )?;
        self.loads.check_solvable()
    }
}

impl BeltSpec {
    fn check(&self) -> Check {
        measurable(format_args!("belt.width"), self.width)?;
        if let Some(poisson) = self.poisson {
            check_poisson(format_args!("belt.poisson"), poisson)?;
        }
        finite(format_args!("belt.natural_bend"), self.natural_bend)?;
        not_negative(format_args!("belt.density"), self.density)?;
        self.check_half_turns()?;
        self.check_segments()?;
        self.check_rigidity()
    }

    fn check_half_turns(&self) -> Check {
        let half_turns = self.half_turns.unwrap_or(0);
        require(
            self.closed || half_turns == 0,
            format_args!("belt.half_turns"),
            || {
                (
                    half_turns.to_string(),
                    "0 or left out where belt.closed is false",
                )
            },
        )
    }

    fn check_segments(&self) -> Check {
        let field = format_args!("belt.segments");
        require(!self.segments.is_empty(), field, || {
            ("an empty array", "at least one segment")
        })?;
        for (i, segment) in self.segments.iter().enumerate() {
            segment.check(i, self.width)?;
        }
        let length = self.length();
        require(MAGNITUDES.contains(&length), field, || {
            (
                format!("a total length of {}", number(length)),
                format!("of a length {}", span(&MAGNITUDES)),
            )
        })?;
        for (i, segment) in self.segments.iter().enumerate() {
            let share = segment.length() / length;
            let long = share == 0.0 || share > SAME_PLACE;
            require(long, format_args!("belt.segments[{i}].length"), || {
                (
                    number(segment.length()),
                    format!("more than {SAME_PLACE:e} of the belt's length"),
                )
            })?;
        }
        Ok(())
    }

    fn check_rigidity(&self) -> Check {
        if let Some(rigidity) = self.rigidity {
            measurable(format_args!("belt.rigidity"), rigidity)?;
        }
        if let Some(material) = &self.material {
            material.check()?;
        }
        self.check_layers()?;
        self.check_rigidity_sources()?;
        let derived = self.own_rigidity().unwrap_or(1.0);
        require(
            MAGNITUDES.contains(&derived),
            format_args!("belt.material"),
            || {
                (
                    format!("a rigidity E t³ V / (12 (1 − ν²)) of {}", number(derived)),
                    format!("such that it is {}", span(&MAGNITUDES)),
                )
            },
        )
    }

    fn check_layers(&self) -> Check {
        let Some(layers) = &self.layers else {
            return Ok(());
        };
        require(!layers.is_empty(), format_args!("belt.layers"), || {
            ("an empty array", "at least one layer, or left out")
        })?;
        for (i, layer) in layers.iter().enumerate() {
            positive(format_args!("belt.layers[{i}].thickness"), layer.thickness)?;
        }
        Ok(())
    }

    fn check_rigidity_sources(&self) -> Check {
        let sources: Vec<&str> = [
            ("rigidity", self.rigidity.is_some()),
            ("material", self.material.is_some()),
            ("layers", self.layers.is_some()),
        ]
        .iter()
        .filter_map(|(name, given)| given.then_some(*name))
        .collect();
        let needed = self
            .segments
            .iter()
            .any(|s| s.is_flexible() && s.rigidity().is_none());
        let field = format_args!("belt");
        let allowed = "given one of rigidity, material, layers";
        require(!needed || !sources.is_empty(), field, || {
            ("no rigidity", allowed)
        })?;
        require(sources.len() <= 1, field, || {
            (sources.join(" and "), allowed)
        })
    }

    fn check_solvable(&self) -> Check {
        let preset = self
            .material
            .as_ref()
            .is_some_and(|material| material.preset.is_some());
        refuse(
            preset,
            format_args!("belt.material.preset"),
            "named materials, give young, poisson and thickness",
        )?;
        refuse(
            self.layers.is_some(),
            format_args!("belt.layers"),
            "laminates, give rigidity or material",
        )?;
        refuse(
            self.natural_bend != 0.0,
            format_args!("belt.natural_bend"),
            "a natural bend other than 0",
        )?;
        refuse(
            self.closed,
            format_args!("belt.closed"),
            "closed belts, only false",
        )?;
        for (i, segment) in self.segments.iter().enumerate() {
            segment.check_solvable(i)?;
        }
        self.check_one_rigidity()
    }

    fn check_one_rigidity(&self) -> Check {
        let first = self.segment_rigidity(&self.segments[0]);
        let other = self
            .segments
            .iter()
            .position(|segment| self.segment_rigidity(segment) != first);
        other.map_or(Ok(()), |i| {
            refuse(
                true,
                format_args!("belt.segments[{i}].rigidity"),
                "segments of different rigidity, one for all",
            )
        })
    }
}

impl Material {
    fn check(&self) -> Check {
        positive(format_args!("belt.material.thickness"), self.thickness)?;
        if let Some(density) = self.density {
            not_negative(format_args!("belt.material.density"), density)?;
        }
        self.check_constant("young", self.young)?;
        self.check_constant("poisson", self.poisson)?;
        if let Some(young) = self.young {
            positive(format_args!("belt.material.young"), young)?;
        }
        self.poisson.map_or(Ok(()), |poisson| {
            check_poisson(format_args!("belt.material.poisson"), poisson)
        })
    }

    fn check_constant(&self, name: &str, value: Option<f64>) -> Check {
        require(
            value.is_some() || self.preset.is_some(),
            format_args!("belt.material.{name}"),
            || ("nothing", "given where there is no preset"),
        )
    }
}

impl SegmentSpec {
    fn check(&self, i: usize, width: f64) -> Check {
        match self {
            Self::Straight { length, .. } | Self::Rigid { length } => {
                positive(format_args!("belt.segments[{i}].length"), *length)?;
            }
            Self::Arc {
                length, curvature, ..
            } => {
                positive(format_args!("belt.segments[{i}].length"), *length)?;
                check_curvature(i, *curvature, width)?;
            }
            Self::Corner { angle } => check_corner(i, *angle)?,
        }
        if let Some(bend) = self.natural_bend() {
            finite(format_args!("belt.segments[{i}].natural_bend"), bend)?;
        }
        match self.rigidity() {
            Some(Rigidity::Constant(value)) => {
                positive(format_args!("belt.segments[{i}].rigidity"), *value)
            }
            Some(Rigidity::Table(table)) => table.check(i, self.length()),
            None => Ok(()),
        }
    }

    fn check_solvable(&self, i: usize) -> Check {
        let kind = match self {
            Self::Straight { .. } => None,
            Self::Arc { .. } => Some("arc segments, only straight ones"),
            Self::Corner { .. } => Some("corners, only straight segments"),
            Self::Rigid { .. } => Some("rigid segments, only straight ones"),
        };
        refuse(
            kind.is_some(),
            format_args!("belt.segments[{i}].kind"),
            kind.unwrap_or_default(),
        )?;
        refuse(
            self.natural_bend().is_some_and(|bend| bend != 0.0),
            format_args!("belt.segments[{i}].natural_bend"),
            "a natural bend other than 0",
        )?;
        refuse(
            matches!(self.rigidity(), Some(Rigidity::Table(_))),
            format_args!("belt.segments[{i}].rigidity"),
            "tables of rigidity, only one number",
        )
    }
}

impl RigidityTable {
    fn check(&self, i: usize, length: f64) -> Check {
        let field = format_args!("belt.segments[{i}].rigidity");
        let (points, values) = (self.u.len(), self.value.len());
        require(points == values && points >= 2, field, || {
            (
                format!("{points} of u and {values} of value"),
                "as many of each, at least 2",
            )
        })?;
        for (j, value) in self.value.iter().enumerate() {
            positive(
                format_args!("belt.segments[{i}].rigidity.value[{j}]"),
                *value,
            )?;
        }
        for (j, u) in self.u.iter().enumerate() {
            let inside = *u >= 0.0 && *u <= length * (1.0 + SAME_PLACE);
            let rising = j == 0 || self.u[j - 1] < *u;
            require(
                inside && rising,
                format_args!("belt.segments[{i}].rigidity.u[{j}]"),
                || {
                    (
                        number(*u),
                        format!("rising from 0 to the segment's length {}", number(length)),
                    )
                },
            )?;
        }
        Ok(())
    }
}

impl SupportSpec {
    fn check(&self, i: usize, length: f64) -> Check {
        self.at.check(format_args!("supports[{i}].at"), length)?;
        for (j, component) in self.position.iter().flatten().enumerate() {
            let (field, value) = (
                format_args!("supports[{i}].position[{j}]"),
                component.value().unwrap_or(0.0),
            );
            finite(field, value)?;
            require(value.abs() <= FARTHEST * length, field, || {
                (
                    number(value),
                    format!("within {FARTHEST:e} lengths of the belt from the origin"),
                )
            })?;
        }
        self.check_orientation(i)?;
        let holds =
            self.position.is_some() || self.has_orientation() || self.square_rib == Some(true);
        require(holds, format_args!("supports[{i}]"), || {
            (
                "nothing held",
                "given a position, an orientation or a square rib",
            )
        })
    }

    fn check_orientation(&self, i: usize) -> Check {
        let given: Vec<&str> = [
            ("rotation", self.rotation.is_some()),
            ("euler", self.euler.is_some()),
            ("quaternion", self.quaternion.is_some()),
        ]
        .iter()
        .filter_map(|(name, given)| given.then_some(*name))
        .collect();
        require(given.len() <= 1, format_args!("supports[{i}]"), || {
            (given.join(" and "), format!("given {ORIENTATIONS}"))
        })?;
        require(
            self.hinge.is_none() || !given.is_empty(),
            format_args!("supports[{i}].hinge"),
            || {
                (
                    "a hinge without an orientation",
                    format!("given with {ORIENTATIONS}"),
                )
            },
        )?;
        check_angles(format_args!("supports[{i}].rotation"), self.rotation)?;
        check_angles(format_args!("supports[{i}].euler"), self.euler)?;
        self.quaternion
            .map_or(Ok(()), |quaternion| check_quaternion(i, quaternion))
    }

    fn check_solvable(&self, i: usize, length: f64) -> Check {
        refuse(
            !self.at.is_end(length),
            format_args!("supports[{i}].at"),
            "supports inside the span, only at the start and the end",
        )?;
        refuse(
            self.hinge.is_some(),
            format_args!("supports[{i}].hinge"),
            "hinges, leave it out",
        )
    }
}

impl Place {
    fn check(&self, field: Arguments, length: f64) -> Check {
        let u = self.arc_length(length);
        require((0.0..=length).contains(&u), field, || {
            (
                number(u),
                format!("from 0 to the belt's length {}", number(length)),
            )
        })
    }
}

impl LinkSpec {
    fn check(&self, i: usize, length: f64) -> Check {
        self.from.check(format_args!("links[{i}].from"), length)?;
        self.to.check(format_args!("links[{i}].to"), length)?;
        let [from, to] = [self.from.arc_length(length), self.to.arc_length(length)];
        require(
            (from - to).abs() > SAME_PLACE * length,
            format_args!("links[{i}].to"),
            || {
                (
                    format!("{}, the place of from", number(to)),
                    "another place",
                )
            },
        )?;
        finite_vector(format_args!("links[{i}].offset"), &self.offset)
    }
}

impl LoadsSpec {
    fn check(&self, length: f64) -> Check {
        finite_vector(
            format_args!("loads.gravity"),
            &self.gravity.unwrap_or_default(),
        )?;
        for (i, load) in self.points.iter().enumerate() {
            load.at
                .check(format_args!("loads.points[{i}].at"), length)?;
            finite_vector(format_args!("loads.points[{i}].force"), &load.force)?;
            finite_vector(format_args!("loads.points[{i}].lever"), &load.lever)?;
        }
        Ok(())
    }

    fn check_solvable(&self) -> Check {
        let weightless = self.gravity.unwrap_or_default() == [0.0; 3];
        refuse(
            !weightless,
            format_args!("loads.gravity"),
            "gravity, leave it out",
        )?;
        refuse(
            !self.points.is_empty(),
            format_args!("loads.points"),
            "point loads, leave them out",
        )
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

fn check_order(i: usize, [before, this]: [&Place; 2], length: f64) -> Check {
    let [before, this] = [before.arc_length(length), this.arc_length(length)];
    let field = format_args!("supports[{i}].at");
    require((this - before).abs() > SAME_PLACE * length, field, || {
        (
            format!("{}, the place of supports[{}]", place(this, length), i - 1),
            "another place",
        )
    })?;
    require(this > before, field, || {
        (
            format!("{} after {}", number(this), number(before)),
            "in order along the belt",
        )
    })
}

/// A place along the spine by its number, and by its name where it has one.
fn place(u: f64, length: f64) -> String {
    let named = [(0.0, " (start)"), (length, " (end)")]
        .into_iter()
        .find(|(end, _)| (u - end).abs() <= SAME_PLACE * length);
    number(u) + named.map_or("", |(_, name)| name)
}

fn check_angles(field: Arguments, angles: Option<[f64; 3]>) -> Check {
    let angles = angles.unwrap_or_default();
    finite_vector(field, &angles)?;
    let largest = angles
        .iter()
        .fold(0.0, |most: f64, angle| most.max(angle.abs()));
    require(largest <= LARGEST_ANGLE, field, || {
        (
            number(largest),
            format!("angles of at most {LARGEST_ANGLE:e} rad"),
        )
    })
}

fn check_quaternion(i: usize, quaternion: [f64; 4]) -> Check {
    let field = format_args!("supports[{i}].quaternion");
    finite_vector(field, &quaternion)?;
    let norm = Vector4::from(quaternion).norm();
    require((norm - 1.0).abs() <= QUATERNION_TOLERANCE, field, || {
        // Seven decimals show a deviation of 1e-6 and hide the noise of the square root.
        let shown = number((norm * 1e7).round() / 1e7);
        (format!("norm {shown}"), "1 within 1e-6")
    })
}

fn check_curvature(i: usize, curvature: f64, width: f64) -> Check {
    let field = format_args!("belt.segments[{i}].curvature");
    finite(field, curvature)?;
    require(curvature.abs() * width < 2.0, field, || {
        (
            number(curvature),
            "below 2/V in magnitude, or the inner edge runs backwards",
        )
    })
}

fn check_corner(i: usize, angle: f64) -> Check {
    require(
        angle.abs() < PI,
        format_args!("belt.segments[{i}].angle"),
        || (number(angle), "between −π and π, both excluded"),
    )
}

fn check_poisson(field: Arguments, value: f64) -> Check {
    require(value > -1.0 && value < 0.5, field, || {
        (number(value), "between -1 and 0.5, both excluded")
    })
}

fn within(name: &str, value: usize, range: &RangeInclusive<usize>) -> Check {
    require(
        range.contains(&value),
        format_args!("solver.ritz.{name}"),
        || (value.to_string(), between(range)),
    )
}

fn between(range: &RangeInclusive<usize>) -> String {
    format!("from {} to {}", range.start(), range.end())
}

fn span(range: &RangeInclusive<f64>) -> String {
    format!("from {:e} to {:e}", range.start(), range.end())
}

fn is_positive(value: f64) -> bool {
    value > 0.0 && value.is_finite()
}

fn positive(field: Arguments, value: f64) -> Check {
    require(is_positive(value), field, || {
        (number(value), "a positive finite number")
    })
}

/// A positive number from which energies and forces can be computed.
fn measurable(field: Arguments, value: f64) -> Check {
    positive(field, value)?;
    require(MAGNITUDES.contains(&value), field, || {
        (number(value), span(&MAGNITUDES))
    })
}

fn not_negative(field: Arguments, value: f64) -> Check {
    require(value >= 0.0 && value.is_finite(), field, || {
        (number(value), "a finite number, not negative")
    })
}

fn finite(field: Arguments, value: f64) -> Check {
    require(value.is_finite(), field, || {
        (number(value), "a finite number")
    })
}

fn finite_vector(field: Arguments, vector: &[f64]) -> Check {
    for (j, value) in vector.iter().enumerate() {
        finite(format_args!("{field}[{j}]"), *value)?;
    }
    Ok(())
}

/// Refuses with (found, allowed) unless the condition holds; texts are made only for an error, as arrays may be long.
fn require<F: Display, A: Display>(
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

/// Refuses what a later release shall solve.
fn refuse(given: bool, field: Arguments, what: &str) -> Check {
    if given {
        Err(ScenarioError::unsupported(field.to_string(), what))
    } else {
        Ok(())
    }
}
