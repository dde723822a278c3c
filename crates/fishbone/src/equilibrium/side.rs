//! The side to which a belt bulges, and the search on the other side, which begins at its mirror images.

use super::active_set::settle;
use super::intrinsic::solve;
use super::refinement::widened;
use super::search::{Search, fields_at, prolong};
use super::{Equilibrium, Solved, Start, is_slender_on_graded_mesh};
use crate::geometry::Pose;
use crate::problem::program::{BeltPoint, BeltProgram, NodeSupport, Piece};
use crate::problem::{Mesh, Problem};
use crate::scenario::{SAME_PLACE, Scenario};
use nalgebra::{Matrix3, Vector2, Vector3};
use stagewise::{Distance, Program};
use std::f64::consts::PI;
use std::ops::ControlFlow;

/// Mean distance from the chords along the bulge up to which a belt lies on neither side, in U.
const NEITHER: f64 = 1e-4;
/// Mean distance from the chords from which a belt bulges to some side, in U.
const BULGES: f64 = 1e-2;
/// Loads along the bulge that push a belt over to its side, per unit length, in mean R_f/U².
const PUSHES: [f64; 3] = [30.0, 100.0, 300.0];
/// Miss of the supports up to which a mirror image meets them, lengths in U and angles in rad.
const MET: f64 = 1e-6;

impl Equilibrium {
    /// The side to which the belt bulges: 1 along `solver.bulge`, −1 against it, 0 where it lies on neither side.
    ///
    /// It is the sign of the mean distance of the spine, along the bulge, from the straight lines between the places where
    /// supports hold a position. With fewer than two such places the line is the tangent at that place, or at the start. A
    /// mean distance within 1e-4 U is 0, and a belt that no support holds has no side.
    pub fn side(&self) -> i8 {
        match self.scenario().supports.is_empty() {
            true => 0,
            false => side(self.mean_distance().dot(&self.problem.bulge().normalize())),
        }
    }

    /// Mean distance of the spine from its chords, in U.
    fn mean_distance(&self) -> Vector3<f64> {
        let (scenario, spine) = (self.scenario(), &self.spine);
        let length = spine.length();
        let held = scenario.supports.iter().filter(|s| s.position.is_some());
        let held = held.map(|support| {
            let at = support.at.arc_length(length) - SAME_PLACE * length;
            spine.u.partition_point(|u| *u < at)
        });
        mean_distance(&spine.u, &spine.pose, &held.collect::<Vec<_>>()) / length
    }
}

/// The side of a mean distance along the bulge, in U.
fn side(distance: f64) -> i8 {
    match distance.abs() > NEITHER {
        true => distance.signum() as i8,
        false => 0,
    }
}

/// Mean distance of the spine from its chords between held nodes, square to them; of a belt held at fewer than two nodes, from
/// the tangent at that node, or at the start. The belt beyond the held nodes does not count.
///
/// Shapes: `u` and `poses` one a node; `held` rising.
fn mean_distance(u: &[f64], poses: &[Pose], held: &[usize]) -> Vector3<f64> {
    // Twice the integral of the distance from a line through a node.
    let area = |ends: [usize; 2], node: usize, along: &Vector3<f64>| -> Vector3<f64> {
        let off = |k: usize| poses[k].position - poses[node].position;
        let trapezium = |k: usize| (off(k) + off(k + 1)) * (u[k + 1] - u[k]);
        let area: Vector3<f64> = (ends[0]..ends[1]).map(trapezium).sum();
        let along = along.try_normalize(f64::EPSILON).unwrap_or_default();
        area - along * along.dot(&area)
    };
    let (area, span) = match held {
        [first, .., last] => {
            let chords = held.windows(2).map(|ends| {
                let along = poses[ends[1]].position - poses[ends[0]].position;
                area([ends[0], ends[1]], ends[0], &along)
            });
            (chords.sum::<Vector3<f64>>(), u[*last] - u[*first])
        }
        _ => {
            let node = held.first().copied().unwrap_or(0);
            let last = u.len() - 1;
            let tangent = poses[node].frame.column(1).into_owned();
            (area([0, last], node, &tangent), u[last])
        }
    };
    0.5 * area / span
}

/// A minimum, or one on the side of the bulge if that one lies on the other side: a mirror image that is a minimum too. Of a
/// belt between held places also a minimum that a search from a mirror image finds, or one that the belt keeps after a load
/// has pushed it over; a warning if none is found. Elsewhere loads and clamps draw the belt to their side.
///
/// A belt between held places that bulges square to `solver.bulge`, as its mirror image does to the opposite side, gets a
/// warning too.
pub(super) fn on_side_of_bulge(
    mut found: Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let Some((solved, is_between)) = solved_minimum(&found) else {
        return found;
    };
    if found.side() >= 0 {
        let is_open = is_between && found.side() == 0;
        if is_open && Image::has_opposite_twin(&found, solved) {
            let warning =
                "solver.bulge chooses neither of two mirror images: the belt bulges square to it";
            found.warnings.push(warning.to_owned());
        }
        return found;
    }
    let problem = &found.problem;
    let images = Image::all(problem, solved, |_| true);
    let [symmetric, others]: [Vec<_>; 2] =
        [true, false].map(|is_twin| images.iter().filter(|i| i.is_twin == is_twin).collect());
    let mut iterations = found.iterations;
    let mut is_on_side = |other: Result<Equilibrium, usize>| {
        iterations += match &other {
            Ok(other) => other.iterations,
            Err(in_vain) => *in_vain,
        };
        let other = other.ok()?;
        (other.is_minimum() && other.side() > 0).then_some(Equilibrium {
            iterations,
            ..other
        })
    };
    for image in symmetric {
        if let Some(other) = is_on_side(Ok(image.twin(&found, solved, proceed))) {
            return other;
        }
    }
    if is_between {
        let nearest = others
            .first()
            .map(|image| image.search(problem, solved, proceed));
        if let Some(other) = nearest.and_then(&mut is_on_side) {
            return other;
        }
        for push in PUSHES {
            if let Some(other) = is_on_side(pushed_over(problem, solved, push, proceed)) {
                return other;
            }
        }
        let warning = "no minimum was found on the side of solver.bulge: this one lies on the other side; a search for all \
                       equilibria, solve --all or branches, looks farther";
        found.warnings.push(warning.to_owned());
    }
    found.iterations = iterations;
    found
}

/// A wound belt, or its symmetry image on the side of the bulge that is wound by the same turns; without one a warning that the
/// belt lies on the other side.
pub(super) fn wound_on_side_of_bulge(
    mut found: Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Equilibrium {
    let Some((solved, is_between)) = solved_minimum(&found).filter(|_| found.side() < 0) else {
        return found;
    };
    let keeps_turns = |mirror: &Mirror| mirror.keeps_turns(found.scenario());
    for image in Image::all(&found.problem, solved, keeps_turns) {
        if image.is_twin {
            let mut twin = image.twin(&found, solved, proceed);
            if twin.is_minimum() && twin.side() > 0 {
                twin.iterations += found.iterations;
                return twin;
            }
        }
    }
    if is_between {
        let warning = "the belt was followed through the turns of its supports, and lies on the other side than solver.bulge";
        found.warnings.push(warning.to_owned());
    }
    found
}

/// The solution of a minimum, and whether the belt is open and held at two places or more.
fn solved_minimum(found: &Equilibrium) -> Option<(&Solved, bool)> {
    let solved = found.developable().filter(|_| found.is_minimum())?;
    let is_open = solved.program.half_turns.is_none();
    Some((solved, is_open && held_nodes(&solved.program).len() > 1))
}

/// The minimum that a search from a shape of a programme finds; the count of iterations if a first one, on the programme's own
/// mesh with a first barrier, ends in a minimum on another side: finer meshes would only lead there, too.
fn minimum_on_side(
    problem: &Problem,
    (program, shape): (&BeltProgram, &BeltPoint),
    barrier: f64,
    start: Start,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Equilibrium, usize> {
    let (search, mut program) = (Search::of(problem), program.clone());
    let near = search.only_from(&program, shape.clone(), barrier, proceed);
    let (near, misfit) = settle(problem, &search, &mut program, near, proceed);
    let distance = mean_distance_of(&program, &near.at.point);
    let is_elsewhere = side(distance.dot(&problem.bulge().normalize())) <= 0;
    if is_elsewhere && near.is_minimum() && misfit.is_none() {
        return Err(near.iterations);
    }
    let mut found = solve(problem, start, proceed);
    found.iterations += near.iterations;
    Ok(found)
}

/// The minimum next to the shape into which a load per unit length pushes a minimum along the bulge, as
/// [`minimum_on_side`] gives it.
fn pushed_over(
    problem: &Problem,
    solved: &Solved,
    push: f64,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Equilibrium, usize> {
    let search = Search::of(problem);
    let is_widened = is_slender_on_graded_mesh(problem);
    let (known, point) = (&solved.program, &solved.at.point);
    let mut program = if is_widened {
        widened(problem)
    } else {
        known.clone()
    };
    let point = if is_widened {
        prolong(known, point, &program)
    } else {
        point.clone()
    };
    let [_, across] = along_and_across(&program, &point, &problem.bulge());
    let weight = program.weight;
    program.weight += push * across;
    let pushed = search.only_from(&program, point, search.settings.warm_barrier, proceed);
    program.weight = weight;
    let (mesh, pushed_to) = (Mesh::of(problem, &program), &pushed.at.point);
    let start = match is_widened {
        true => Start::Widened(&program, pushed_to),
        false => Start::Minimum(&mesh, pushed_to),
    };
    let barrier = search
        .settings
        .beside(program.size(pushed_to))
        .close_barrier;
    let found = minimum_on_side(problem, (&program, pushed_to), barrier, start, proceed);
    found.map_err(|in_vain| in_vain + pushed.iterations)
}

/// A mirror that takes a belt to a belt: the frames, as columns, from R to Q R S. Q is the mirror of space, S the mirror of
/// the belt, diag(±1, ±1, ±1), which keeps the spine and may exchange its ends.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Mirror {
    /// Sign of the normal.
    normal: f64,
    /// Sign of the width direction.
    across: f64,
    /// Whether start and end are exchanged.
    backwards: bool,
}

impl Mirror {
    /// All mirrors of an open or a closed belt but the identity. The seam of a closed belt stays where it is.
    fn all(is_closed: bool) -> impl Iterator<Item = Self> {
        let signs = [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
        let mirrors = signs.into_iter().chain([[1.0, 1.0]]);
        let forwards = signs.into_iter().map(|signs| (signs, false));
        let backwards = mirrors.map(|signs| (signs, true));
        let all = forwards.chain(backwards.filter(move |_| !is_closed));
        all.map(|([normal, across], backwards)| Self {
            normal,
            across,
            backwards,
        })
    }

    /// Whether left-handed belts become right-handed.
    fn changes_hand(&self) -> bool {
        (self.normal * self.across < 0.0) != self.backwards
    }

    /// Whether the image of a belt that its supports have wound is wound by the same rotation vectors, and not by others to the
    /// same frames.
    fn keeps_turns(&self, scenario: &Scenario) -> bool {
        /// Difference of rotation vectors that are the same, and sine of the angle between axes that are, in rad.
        const SAME: f64 = 1e-6;
        let supports = scenario.supports.iter().filter(|s| s.frame().is_some());
        let vectors: Option<Vec<_>> = supports.map(|s| Some(Vector3::from(s.rotation?))).collect();
        let vectors = vectors.unwrap_or_default();
        let about_one_axis = |vector: &Vector3<f64>| {
            vectors[0].cross(vector).norm() <= SAME * vectors[0].norm() * vector.norm()
        };
        if vectors.is_empty()
            || !vectors.iter().all(about_one_axis)
            || (self.backwards && vectors.len() != 2)
        {
            return !self.changes_hand();
        }
        // Rotation vectors are axial, and those from the end to the start are opposite.
        let sense = if self.backwards { -1.0 } else { 1.0 };
        let image = self.of_frame() * (sense * self.of_frame().determinant());
        let mut turns = vectors.iter().map(|vector| vector - vectors[0]);
        turns.all(|turn| (image * turn - turn).norm() <= SAME || turn.norm() <= PI)
    }

    /// The mirror of the belt's frame, S.
    fn of_frame(&self) -> Matrix3<f64> {
        let along = if self.backwards { -1.0 } else { 1.0 };
        Matrix3::from_diagonal(&Vector3::new(self.normal, along, self.across))
    }

    /// The mirror image of a shape on the same mesh, where supports hold it.
    fn image(&self, program: &BeltProgram, point: &BeltPoint, bulge: &Vector3<f64>) -> BeltPoint {
        let nodes = program.nodes();
        let along = if self.backwards { -1.0 } else { 1.0 };
        let field = |k: usize| {
            let fields = match self.backwards {
                false => point.fields[k],
                true => {
                    let is_before_joint =
                        matches!(program.pieces.get(k), Some(Piece::Joint { .. }));
                    fields_at(program, &nodes, point, 1.0 - nodes[k], is_before_joint)
                }
            };
            Vector2::new(self.normal * fields[0], along * self.across * fields[1])
        };
        let start = if self.backwards { nodes.len() - 1 } else { 0 };
        let space = self.of_space(program, point, bulge);
        let mut image = BeltPoint {
            fields: (0..nodes.len()).map(field).collect(),
            poses: point.poses.clone(),
        };
        image.poses[0].frame = space * point.poses[start].frame * self.of_frame();
        program.settle(&mut image);
        place(program, &mut image, point);
        program.settle(&mut image);
        image
    }

    /// The mirror of space, Q: the one that takes a held frame to itself or to the frame held at the place with which it is
    /// exchanged; without a held frame, the one that turns the bulge round and keeps the chord.
    fn of_space(
        &self,
        program: &BeltProgram,
        point: &BeltPoint,
        bulge: &Vector3<f64>,
    ) -> Matrix3<f64> {
        let frame = |support: &NodeSupport| {
            let frame = support.hold.frame()?.to_rotation_matrix().into_inner();
            Some((support.node, frame))
        };
        let Some((node, held)) = program.supports.iter().find_map(frame) else {
            return self.about_chord(program, point, bulge);
        };
        let from = if self.backwards {
            opposite(program, node)
        } else {
            node
        };
        let supports = program.supports.iter();
        let other = supports.filter(|s| s.node == from).find_map(frame);
        let other = other.map_or(point.poses[from].frame, |(_, other)| other);
        held * self.of_frame() * other.transpose()
    }

    /// The mirror of space that turns the bulge round and keeps the chord between the held places, but for its sense.
    fn about_chord(
        &self,
        program: &BeltProgram,
        point: &BeltPoint,
        bulge: &Vector3<f64>,
    ) -> Matrix3<f64> {
        let [along, square] = along_and_across(program, point, bulge);
        let third = along.cross(&square);
        let determinant = self.of_frame().determinant();
        let sense = if self.backwards { -1.0 } else { 1.0 };
        sense * along * along.transpose()
            - square * square.transpose()
            - sense * determinant * third * third.transpose()
    }
}

/// The unit vectors along the chord between the held places, and along the bulge square to it.
fn along_and_across(
    program: &BeltProgram,
    point: &BeltPoint,
    bulge: &Vector3<f64>,
) -> [Vector3<f64>; 2] {
    let held = held_nodes(program);
    let [from, to] = [held.first(), held.last()].map(|node| *node.unwrap_or(&0));
    let chord = point.poses[to].position - point.poses[from].position;
    let tangent = || point.poses[from].frame.column(1).into_owned();
    let along = chord.try_normalize(f64::EPSILON).unwrap_or_else(tangent);
    let square = (bulge - along * along.dot(bulge)).normalize();
    [along, square]
}

/// The node nearest to the place with which a node's place is exchanged if start and end are.
fn opposite(program: &BeltProgram, node: usize) -> usize {
    let nodes = program.nodes();
    let place = 1.0 - nodes[node];
    let away = |k: &usize| (nodes[*k] - place).abs();
    let nearest = (0..nodes.len()).min_by(|a, b| away(a).total_cmp(&away(b)));
    nearest.unwrap_or(0)
}

/// The nodes at which supports hold a position, rising.
fn held_nodes(program: &BeltProgram) -> Vec<usize> {
    let supports = program.supports.iter();
    let held = supports.filter(|s| s.position.iter().any(Option::is_some));
    held.map(|support| support.node).collect()
}

/// Mean distance of a shape of a programme from its chords, in U.
fn mean_distance_of(program: &BeltProgram, shape: &BeltPoint) -> Vector3<f64> {
    mean_distance(&program.nodes(), &shape.poses, &held_nodes(program))
}

/// Moves a shape by the mean distance to the places at which supports hold it; along an axis on which none does, to where
/// another shape is.
fn place(program: &BeltProgram, shape: &mut BeltPoint, other: &BeltPoint) {
    for axis in 0..3 {
        let away = |support: &NodeSupport| {
            Some(support.position[axis]? - shape.poses[support.node].position[axis])
        };
        let away: Vec<f64> = program.supports.iter().filter_map(away).collect();
        shape.poses[0].position[axis] += match away.len() {
            0 => other.poses[0].position[axis] - shape.poses[0].position[axis],
            held => away.iter().sum::<f64>() / held as f64,
        };
    }
}

/// A mirror image on the side of the bulge.
struct Image {
    mirror: Mirror,
    shape: BeltPoint,
    /// Its miss of the supports, lengths in U and angles in rad.
    miss: f64,
    /// Whether it meets the supports, and has the energy of its original.
    is_twin: bool,
}

impl Image {
    /// The mirror images of a shape on the side of the bulge, by the mirrors that pass a test: symmetry images first, then by
    /// rising miss of the supports.
    fn all(problem: &Problem, solved: &Solved, passes: impl Fn(&Mirror) -> bool) -> Vec<Self> {
        let bulge = problem.bulge().normalize();
        let is_right = |image: &Self| side(image.mean_distance(&solved.program).dot(&bulge)) > 0;
        let images = Self::of_mirrors(solved, &bulge).filter(|image| passes(&image.mirror));
        let mut images: Vec<_> = images.filter(is_right).collect();
        // Rounding must not choose between symmetry images.
        let rank = |image: &Self| if image.is_twin { 0.0 } else { image.miss };
        images.sort_by(|a, b| rank(a).total_cmp(&rank(b)));
        images.dedup_by(|b, a| a.shape.distance(&b.shape) <= MET);
        images
    }

    /// Whether a belt bulges to some side, and has a twin that bulges to the opposite one.
    fn has_opposite_twin(found: &Equilibrium, solved: &Solved) -> bool {
        let own = found.mean_distance();
        let is_opposite = |image: &Self| {
            image.is_twin && image.mean_distance(&solved.program).dot(&own) < -BULGES * own.norm()
        };
        own.norm() > BULGES && Self::of_mirrors(solved, &own).any(|image| is_opposite(&image))
    }

    /// The images of a shape by all mirrors that keep the half turns of a closed belt.
    fn of_mirrors(solved: &Solved, bulge: &Vector3<f64>) -> impl Iterator<Item = Self> {
        /// Relative difference of the energies of mirror images, by rounding and by a mesh that is not symmetric.
        const LEVEL: f64 = 1e-3;
        let Solved { program, at, .. } = solved;
        let energy = |shape: &BeltPoint| {
            program.elastic_energy(&shape.fields) + program.load_potential(&shape.poses)
        };
        let own = energy(&at.point);
        let is_twisted = program.half_turns.is_some_and(|half_turns| half_turns != 0);
        let mirrors = Mirror::all(program.half_turns.is_some());
        let mirrors = mirrors.filter(move |mirror| !(is_twisted && mirror.changes_hand()));
        mirrors.map(move |mirror| {
            let shape = mirror.image(program, &at.point, bulge);
            let miss = program.miss_of_supports(&shape);
            let is_level = (energy(&shape) - own).abs() <= LEVEL * own.abs();
            Self {
                mirror,
                is_twin: miss <= MET && is_level,
                shape,
                miss,
            }
        })
    }

    /// Mean distance from the chords, in U.
    fn mean_distance(&self, program: &BeltProgram) -> Vector3<f64> {
        mean_distance_of(program, &self.shape)
    }

    /// The minimum at the image of a minimum.
    fn twin(
        &self,
        original: &Equilibrium,
        solved: &Solved,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Equilibrium {
        let problem = &original.problem;
        let mesh = Mesh::of(problem, &solved.program);
        let twin = solve(problem, Start::Close(&mesh, &self.shape), proceed);
        let refined = twin
            .refined_for(problem, proceed)
            .filter(|_| self.mirror.backwards);
        let right = |refined: &Equilibrium| refined.side() > 0;
        refined.filter(right).unwrap_or(twin)
    }

    /// The minimum that a search from the image finds, as [`minimum_on_side`] gives it.
    fn search(
        &self,
        problem: &Problem,
        solved: &Solved,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Equilibrium, usize> {
        if is_slender_on_graded_mesh(problem) {
            let start = Start::Widened(&solved.program, &self.shape);
            return Ok(solve(problem, start, proceed));
        }
        let program = problem.program(problem.elements());
        let shape = prolong(&solved.program, &self.shape, &program);
        let barrier = Search::of(problem).settings.cold_barrier;
        let start = Start::Shape(&shape);
        minimum_on_side(problem, (&program, &shape), barrier, start, proceed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scenario::{BeltSpec, Component, Place, SegmentSpec, SupportSpec};

    /// A belt between parallel clamps, or between pins.
    fn problem(end: [f64; 3], is_clamped: bool, bulge: [f64; 3]) -> Problem {
        let mut scenario = Scenario::new(BeltSpec::new(0.1, 1.0, vec![SegmentSpec::straight(1.0)]));
        let held = |at, position: [f64; 3]| SupportSpec {
            position: Some(position.map(Component::Held)),
            rotation: is_clamped.then_some([0.0; 3]),
            ..SupportSpec::new(at)
        };
        scenario.supports = vec![held(Place::Start, [0.0; 3]), held(Place::End, end)];
        scenario.solver.elements = Some(80);
        scenario.solver.bulge = bulge;
        Problem::new(scenario).unwrap()
    }

    /// The minimum on the side of +x, then that to which a bulge along −x leads from there.
    fn both_sides(end: [f64; 3], is_clamped: bool) -> [Equilibrium; 2] {
        let proceed = &mut || ControlFlow::Continue(());
        let first = solve(
            &problem(end, is_clamped, [1.0, 0.0, 0.0]),
            Start::Guess,
            proceed,
        );
        let turned = Equilibrium {
            problem: problem(end, is_clamped, [-1.0, 0.0, 0.0]),
            ..first.clone()
        };
        assert_eq!((first.side(), turned.side()), (1, -1));
        let other = on_side_of_bulge(turned, proceed);
        assert_eq!(other.side(), 1);
        assert!(other.warnings.is_empty());
        assert!((other.energy - first.energy).abs() < 1e-8 * first.energy);
        assert!(
            other.iterations < first.iterations + 15,
            "a few Newton steps"
        );
        [first, other]
    }

    /// Largest distance of the nodes from those of the other shape's mirror image.
    fn distance(
        [one, other]: &[Equilibrium; 2],
        image: impl Fn(usize, &[Pose]) -> Vector3<f64>,
    ) -> f64 {
        let poses = one.spine.pose.iter().enumerate();
        let off = poses.map(|(k, pose)| (pose.position - image(k, &other.spine.pose)).norm());
        off.fold(0.0, f64::max)
    }

    #[test]
    fn test_twin_across_a_plane_is_found() {
        for is_clamped in [true, false] {
            let found = both_sides([0.0, 0.6, 0.0], is_clamped);
            let image = |k: usize, poses: &[Pose]| {
                let [x, y, z] = poses[k].position.into();
                Vector3::new(-x, y, z)
            };
            assert!(distance(&found, image) < 1e-6);
        }
    }

    #[test]
    fn test_twin_that_exchanges_the_ends_is_found() {
        let end = [0.15, 0.5, 0.0];
        let found = both_sides(end, true);
        let image =
            |k: usize, poses: &[Pose]| Vector3::from(end) - poses[poses.len() - 1 - k].position;
        assert!(distance(&found, image) < 1e-6);
    }
}
