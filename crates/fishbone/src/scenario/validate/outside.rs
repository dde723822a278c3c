//! Conditions on supports, links and loads, which act on the board from outside.

use super::super::{LinkSpec, LoadsSpec, Place, SAME_PLACE, SupportSpec};
use super::check::{
    Check, at_most, bounded, bounded_vector, finite_vector, given, near, near_vector, require,
};
use crate::scenario::error::number;
use nalgebra::Vector4;
use std::fmt::Arguments;

/// Tolerance of a quaternion's norm against 1, dimensionless.
const QUATERNION_TOLERANCE: f64 = 1e-6;
/// Greatest angle of a rotation, in rad: beyond it, too few digits are left for the direction.
const LARGEST_ANGLE: f64 = 1e6;
/// Greatest count of links, a number: they couple all nodes between their ends, and the work grows with the square of the
/// count.
const MOST_LINKS: usize = 100;
/// Greatest count of supports, a number: the work grows with the square of the count.
const MOST_SUPPORTS: usize = 100;
/// Greatest count of point loads, a number.
const MOST_LOADS: usize = 10_000;

/// Words for the fields of an orientation, which complete "must be …".
const ORIENTATIONS: &str = "one of rotation, euler, quaternion";

/// The extent of the belt, against which places along the spine are checked.
#[derive(Clone, Copy)]
pub(super) struct Extent {
    /// Length U.
    pub(super) length: f64,
    /// Whether the belt is closed.
    pub(super) closed: bool,
}

impl Extent {
    fn check(self, field: Arguments, at: Place) -> Check {
        let u = at.arc_length(self.length);
        require((0.0..=self.length).contains(&u), field, || {
            (
                number(u),
                format!("from 0 to the belt's length {}", number(self.length)),
            )
        })?;
        require(!self.closed || u < self.length, field, || {
            (
                format!("{} of a closed belt", place(u, self.length)),
                "\"start\", which is the same place",
            )
        })
    }
}

pub(super) fn check_supports(supports: &[SupportSpec], extent: Extent) -> Check {
    let field = format_args!("supports");
    at_most(field, supports.len(), MOST_SUPPORTS, "supports")?;
    for (i, support) in supports.iter().enumerate() {
        support.check(i, extent)?;
    }
    for (i, pair) in supports.windows(2).enumerate() {
        check_order(i + 1, [&pair[0].at, &pair[1].at], extent.length)?;
    }
    Ok(())
}

pub(super) fn check_links(links: &[LinkSpec], extent: Extent) -> Check {
    at_most(format_args!("links"), links.len(), MOST_LINKS, "links")?;
    for (i, link) in links.iter().enumerate() {
        link.check(i, extent)?;
    }
    Ok(())
}

impl SupportSpec {
    pub(super) fn check(&self, i: usize, extent: Extent) -> Check {
        extent.check(format_args!("supports[{i}].at"), self.at)?;
        for (j, component) in self.position.iter().flatten().enumerate() {
            let value = component.value().unwrap_or(0.0);
            near(
                format_args!("supports[{i}].position[{j}]"),
                value,
                extent.length,
            )?;
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
        let sources = [
            ("rotation", self.rotation.is_some()),
            ("euler", self.euler.is_some()),
            ("quaternion", self.quaternion.is_some()),
        ];
        let count = sources.iter().filter(|(_, is_given)| *is_given).count();
        require(count <= 1, format_args!("supports[{i}]"), || {
            let given = given(&sources).join(" and ");
            (given, format!("given {ORIENTATIONS}"))
        })?;
        require(
            self.hinge.is_none() || count > 0,
            format_args!("supports[{i}].hinge"),
            || {
                (
                    "a hinge without an orientation",
                    format!("given with {ORIENTATIONS}"),
                )
            },
        )?;
        require(
            self.hinge.is_some() || self.moment.is_none(),
            format_args!("supports[{i}].moment"),
            || ("a moment without a hinge", "given with hinge"),
        )?;
        bounded(
            format_args!("supports[{i}].moment"),
            self.moment.unwrap_or(0.0),
        )?;
        check_angles(format_args!("supports[{i}].rotation"), self.rotation)?;
        check_angles(format_args!("supports[{i}].euler"), self.euler)?;
        self.quaternion
            .map_or(Ok(()), |quaternion| check_quaternion(i, quaternion))
    }
}

impl LinkSpec {
    fn check(&self, i: usize, extent: Extent) -> Check {
        extent.check(format_args!("links[{i}].from"), self.from)?;
        extent.check(format_args!("links[{i}].to"), self.to)?;
        let length = extent.length;
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
        near_vector(format_args!("links[{i}].offset"), &self.offset, length)
    }
}

impl LoadsSpec {
    /// Checks the loads; gravity acts only on a belt with mass.
    pub(super) fn check(&self, extent: Extent) -> Check {
        let gravity = self.gravity.unwrap_or_default();
        bounded_vector(format_args!("loads.gravity"), &gravity)?;
        let field = format_args!("loads.points");
        at_most(field, self.points.len(), MOST_LOADS, "point loads")?;
        for (i, load) in self.points.iter().enumerate() {
            extent.check(format_args!("loads.points[{i}].at"), load.at)?;
            bounded_vector(format_args!("loads.points[{i}].force"), &load.force)?;
            near_vector(
                format_args!("loads.points[{i}].lever"),
                &load.lever,
                extent.length,
            )?;
        }
        Ok(())
    }

    /// Whether there is no gravity and no force.
    pub(super) fn is_empty(&self) -> bool {
        self.points.is_empty() && self.gravity.unwrap_or_default() == [0.0; 3]
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

/// A place along the spine as printed: its arc length, and its name where it has one.
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
