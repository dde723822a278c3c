//! Conditions on the board: its segments and their materials.

use super::super::{
    BeltSpec, LayerSpec, MaterialSpec, Rigidity, RigidityTable, SAME_PLACE, SegmentSpec,
};
use super::check::{
    Check, MAGNITUDES, at_most, between, finite, given, measurable, not_negative, positive,
    require, span,
};
use crate::board::material::{Material, PRESETS};
use crate::scenario::error::{ScenarioError, number};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, TAU};
use std::fmt::Arguments;
use std::ops::RangeInclusive;

/// Greatest angle of a bend of the board at one point, in rad: beyond it ribs have no room beside each other.
const SHARPEST: f64 = 2.0 * FRAC_PI_3;
/// Tolerance of [`SHARPEST`] for angles of four decimals, in rad.
const ANGLE_TOLERANCE: f64 = 1e-4;
/// Greatest turn of a flat or an unloaded board, in full turns: more of them need more elements than are allowed.
const MOST_TURNS: f64 = 1000.0;
/// Half turns of a closed belt, a number.
const HALF_TURNS: RangeInclusive<i32> = -20..=20;
/// Greatest count of layers, a number.
const MOST_LAYERS: usize = 1000;
/// Greatest count of segments, a number.
const MOST_SEGMENTS: usize = 10_000;
/// Greatest count of a table's entries, a number.
const MOST_ENTRIES: usize = 10_000;

impl BeltSpec {
    pub(super) fn check(&self) -> Check {
        measurable(format_args!("belt.width"), self.width)?;
        if let Some(poisson) = self.poisson {
            check_poisson(format_args!("belt.poisson"), poisson)?;
        }
        if let Some(thickness) = self.thickness {
            positive(format_args!("belt.thickness"), thickness)?;
        }
        finite(format_args!("belt.natural_bend"), self.natural_bend)?;
        not_negative(format_args!("belt.density"), self.density)?;
        self.check_half_turns()?;
        self.check_segments()?;
        self.check_rigidity()
    }

    fn check_half_turns(&self) -> Check {
        let half_turns = self.half_turns.unwrap_or(0);
        let field = format_args!("belt.half_turns");
        require(self.closed || half_turns == 0, field, || {
            (half_turns, "0 or left out where belt.closed is false")
        })?;
        require(HALF_TURNS.contains(&half_turns), field, || {
            (half_turns, between(&HALF_TURNS))
        })
    }

    fn check_segments(&self) -> Check {
        let field = format_args!("belt.segments");
        require(!self.segments.is_empty(), field, || {
            ("an empty array", "at least one segment")
        })?;
        at_most(field, self.segments.len(), MOST_SEGMENTS, "segments")?;
        for (i, segment) in self.segments.iter().enumerate() {
            segment.check(i)?;
        }
        self.check_lengths()?;
        require(self.flexible().next().is_some(), field, || {
            ("nothing that bends", "given a straight segment or an arc")
        })?;
        self.check_corners()?;
        self.check_turns()
    }

    fn check_lengths(&self) -> Check {
        let length = self.length();
        let measurable = MAGNITUDES.contains(&length);
        require(measurable, format_args!("belt.segments"), || {
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

    /// Checks corners in a row together: they bend the board at one point.
    fn check_corners(&self) -> Check {
        let is_corner = |segment: &SegmentSpec| matches!(segment, SegmentSpec::Corner { .. });
        let mut next = 0;
        for run in self.segments.chunk_by(|a, b| is_corner(a) && is_corner(b)) {
            let first = next;
            next += run.len();
            if is_corner(&run[0]) {
                self.check_bend(first, run)?;
            }
        }
        Ok(())
    }

    fn check_bend(&self, first: usize, corners: &[SegmentSpec]) -> Check {
        let next = first + corners.len();
        let inside = first > 0 && next < self.segments.len();
        require(inside, format_args!("belt.segments[{first}]"), || {
            (
                "a corner at an end of the belt",
                "between two segments that have a length",
            )
        })?;
        let angle: f64 = corners.iter().map(SegmentSpec::angle).sum();
        let field = format_args!("belt.segments[{}].angle", next - 1);
        require(is_open(angle), field, || {
            (
                format!("{} in all with the corners before it", number(angle)),
                SHARPEST_ALLOWED,
            )
        })?;
        let joins_alike =
            self.segments[first - 1].is_flexible() == self.segments[next].is_flexible();
        require(joins_alike || angle.abs() < FRAC_PI_2, field, || {
            (
                format!("{} between a rigid and a flexible segment", number(angle)),
                "below π/2 (90°) in magnitude",
            )
        })
    }

    fn check_turns(&self) -> Check {
        let turns = |rate: fn(&Self, &SegmentSpec) -> f64| -> f64 {
            let turn = |segment| rate(self, segment).abs() * segment.length() / TAU;
            self.segments.iter().map(turn).sum()
        };
        let check = |turns: f64, what: &str| {
            require(turns <= MOST_TURNS, format_args!("belt.segments"), || {
                (
                    format!("{what} of {} full turns in all", number(turns)),
                    format!("at most {MOST_TURNS}"),
                )
            })
        };
        check(turns(|_, segment| segment.curvature()), "arcs")?;
        check(turns(Self::natural_bend_of), "natural bends")
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
        let own = self.material.is_some() || self.layers.is_some();
        require(
            self.thickness.is_none() || !own,
            format_args!("belt.thickness"),
            || {
                (
                    "a thickness beside a material or layers",
                    "left out, as they have their own",
                )
            },
        )?;
        if self.material.is_some() {
            self.check_derived(format_args!("belt.material"))?;
        }
        if self.layers.is_some() {
            self.check_derived(format_args!("belt.layers"))?;
        }
        Ok(())
    }

    fn check_layers(&self) -> Check {
        let Some(layers) = &self.layers else {
            return Ok(());
        };
        let field = format_args!("belt.layers");
        require(!layers.is_empty(), field, || {
            ("an empty array", "at least one layer, or left out")
        })?;
        at_most(field, layers.len(), MOST_LAYERS, "layers")?;
        for (i, layer) in layers.iter().enumerate() {
            layer.check(i)?;
        }
        Ok(())
    }

    fn check_rigidity_sources(&self) -> Check {
        let sources = given(&[
            ("rigidity", self.rigidity.is_some()),
            ("material", self.material.is_some()),
            ("layers", self.layers.is_some()),
        ]);
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

    /// Checks the rigidity and mass that follow from a material or layers.
    fn check_derived(&self, field: Arguments) -> Check {
        let rigidity = self.own_rigidity().unwrap_or_default();
        require(MAGNITUDES.contains(&rigidity), field, || {
            (
                format!("a rigidity of {} that follows", number(rigidity)),
                format!("such that it is {}", span(&MAGNITUDES)),
            )
        })?;
        let (density, most) = (self.density_value(), MAGNITUDES.end());
        require(density <= *most, field, || {
            (
                format!("a mass per length of {} that follows", number(density)),
                format!("such that it is at most {most:e}"),
            )
        })
    }
}

impl MaterialSpec {
    fn check(&self) -> Check {
        if let Some(preset) = &self.preset {
            check_preset(format_args!("belt.material.preset"), preset)?;
        }
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

impl LayerSpec {
    fn check(&self, i: usize) -> Check {
        check_preset(format_args!("belt.layers[{i}].material"), &self.material)?;
        positive(format_args!("belt.layers[{i}].thickness"), self.thickness)
    }
}

impl SegmentSpec {
    fn check(&self, i: usize) -> Check {
        match self {
            Self::Straight { length, .. } | Self::Rigid { length } => {
                positive(format_args!("belt.segments[{i}].length"), *length)?;
            }
            Self::Arc {
                length, curvature, ..
            } => {
                positive(format_args!("belt.segments[{i}].length"), *length)?;
                finite(format_args!("belt.segments[{i}].curvature"), *curvature)?;
            }
            Self::Corner { angle } => check_angle(i, *angle)?,
        }
        if let Some(bend) = self.natural_bend() {
            finite(format_args!("belt.segments[{i}].natural_bend"), bend)?;
        }
        match self.rigidity() {
            Some(Rigidity::Constant(value)) => {
                measurable(format_args!("belt.segments[{i}].rigidity"), *value)
            }
            Some(Rigidity::Table(table)) => table.check(i, self.length()),
            None => Ok(()),
        }
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
        at_most(field, points, MOST_ENTRIES, "entries")?;
        for (j, value) in self.value.iter().enumerate() {
            measurable(
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

/// Words for [`SHARPEST`] that complete "must be …", in rad and degrees.
const SHARPEST_ALLOWED: &str = "at most 2π/3 (120°) in magnitude";

fn is_open(angle: f64) -> bool {
    angle.abs() <= SHARPEST + ANGLE_TOLERANCE
}

fn check_angle(i: usize, angle: f64) -> Check {
    let field = format_args!("belt.segments[{i}].angle");
    finite(field, angle)?;
    require(is_open(angle), field, || (number(angle), SHARPEST_ALLOWED))
}

/// Refuses an unknown material, with the known names.
fn check_preset(field: Arguments, name: &str) -> Check {
    if Material::named(name).is_some() {
        return Ok(());
    }
    let names = PRESETS.map(|(known, _)| known);
    Err(ScenarioError::choice(name, &names).map_field(|_| field.to_string()))
}

fn check_poisson(field: Arguments, value: f64) -> Check {
    require(value > -1.0 && value < 0.5, field, || {
        (number(value), "between -1 and 0.5, both excluded")
    })
}
