//! The error that the mesh makes, estimated by the equilibrium of the mesh of elements half as long.

use super::refinement::{PER_WIDTH, ribs_turn};
use super::search::{Search, prolonged, prolonged_with_multipliers};
use crate::problem::program::{BeltPoint, BeltProgram, Piece, Undetermined};
use crate::problem::{Mesh, Problem};
use crate::scenario::SAME_PLACE;
use crate::strip::density::Density;
use crate::strip::element::Element;
use crate::strip::spine::Spine;
use crate::surface::least_spine_radius;
use nalgebra::Vector3;
use stagewise::{Distance, Outcome, Solution, Stationary};
use std::ops::ControlFlow;

/// Estimated errors of a result by its mesh, relative and not negative; NaN where a quantity is not determined, or so small
/// that its error is not known, and 0 where it is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "io", derive(serde::Serialize, serde::Deserialize))]
pub struct MeshError {
    /// Error of the energy over the energy, with the zero of potentials at the belt's start, or over the elastic energy where
    /// that is larger.
    pub energy: f64,
    /// Largest error of a position on the spine over U; NaN of a belt that may slide along itself.
    pub position: f64,
    /// Largest error of a reaction or link force over the largest of them, forces in R_f/U² and moments in R_f/U.
    pub force: f64,
    /// Error of the tightest bend on the spine over this bend.
    pub radius: f64,
}

impl MeshError {
    /// The largest of the errors, 0 where none is known.
    pub(super) fn largest(&self) -> f64 {
        self.largest_known().unwrap_or(0.0)
    }

    /// The largest of the errors; `None` where none is known.
    pub(crate) fn largest_known(&self) -> Option<f64> {
        self.worst().map(|worst| worst.1)
    }

    /// The largest of the errors, with the name of its quantity; `None` where none is known.
    pub(super) fn worst(&self) -> Option<(&'static str, f64)> {
        let errors = [
            ("energy", self.energy),
            ("position", self.position),
            ("force", self.force),
            ("radius", self.radius),
        ];
        let known = errors.into_iter().filter(|(_, error)| !error.is_nan());
        known.reduce(|worst, error| if error.1 > worst.1 { error } else { worst })
    }

    /// The largest of the errors to which all elements contribute: all but that of the radius.
    pub(super) fn of_the_whole(&self) -> f64 {
        self.energy.max(self.position).max(self.force)
    }

    /// Whether no error is infinite.
    pub(super) fn is_finite(&self) -> bool {
        let errors = [self.energy, self.position, self.force, self.radius];
        !errors.into_iter().any(f64::is_infinite)
    }

    pub(super) fn times(&self, factor: f64) -> Self {
        Self {
            energy: factor * self.energy,
            position: factor * self.position,
            force: factor * self.force,
            radius: factor * self.radius,
        }
    }
}

/// The estimated error of a solution, and what its elements contribute.
#[derive(Debug, Clone)]
pub(super) struct Estimate {
    pub(super) error: MeshError,
    /// By how much splitting each element alone would lower the energy, in mean R_f/U; positive.
    pub(super) gains: Vec<f64>,
    /// Curvature |κ₁| in each element on the finer mesh, the largest, and its largest change from this mesh, in 1/U.
    pub(super) curvatures: Vec<[f64; 2]>,
}

impl Estimate {
    /// Error from which one Newton step tells no more than that the error is large, relative.
    const WILD: f64 = 0.02;
    /// Error over its change on halving all elements, dimensionless.
    const OVER_CHANGE: f64 = 1.2;

    /// The estimate for a solution of a problem's programme; `None` where the finer mesh has no solution next to it. One Newton
    /// step tells whether the mesh has to be finer. Where it need not, and for an estimate that is the last, Newton's method
    /// goes on to the equilibrium of the finer mesh: if that fails, the step has to do, unless it is wild.
    ///
    /// The error of a quantity that converges with the square of the length of elements is 4/3 of its change on halving
    /// them, and nearer to the change itself of one that converges faster.
    pub(super) fn new(
        problem: &Problem,
        program: &BeltProgram,
        at: &Stationary<BeltPoint>,
        objective: f64,
        is_last: bool,
        proceed: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Option<Self> {
        let mesh = Mesh::of(problem, program);
        let halved = Halved::of(problem, program, at, objective)?;
        if halved.fine.is_at_rest(&halved.near.point) {
            let error = halved.error_at_rest(problem);
            return Some(Self::at_rest(error, program.elements().count()));
        }
        let Step {
            mut better,
            mut error,
            gains,
        } = halved.step(problem)?;
        let Halved {
            fine,
            here,
            near,
            own,
        } = halved;
        // On an arc, ribs that nearly meet in an element meet in one of its halves.
        let ribs_meet = fine.least_slack(&here) <= 0.0;
        // A density that does not know the width lets ribs turn over anywhere at no cost, and elements much longer than the
        // width hold ribs wherever they turn: one step does not move the place from element to element.
        let is_accurate = error.largest() <= problem.accuracy();
        let is_wild = is_last && error.largest() > Self::WILD;
        let may_turn_elsewhere = match turns_coarsely(program, &at.point) {
            true => is_accurate || is_last,
            false => is_accurate && !program.model.knows_width(),
        };
        if may_turn_elsewhere {
            let finest = problem.program_on(&mesh.split(&parts(program, &at.point)))?;
            let here = prolonged(program, &at.point, &finest);
            let solution = searched_near(problem, &finest, &here, proceed);
            if let Some(solution) = solution.filter(|found| is_next_to(found, &here)) {
                let Stationary { point, multipliers } = solution.at;
                let best = (point, multipliers.equalities, solution.values.objective);
                error = own.off_on(problem, &finest, &best);
            }
        } else if ribs_meet || is_accurate || is_last {
            let found = stagewise::settle(&fine, tolerance(problem), near.clone());
            let solution = match ribs_meet || is_wild {
                true => found.or_else(|| searched_near(problem, &fine, &near.point, proceed)),
                false => found,
            };
            if let Some(solution) = solution.filter(|found| is_next_to(found, &here)) {
                let Stationary { point, multipliers } = solution.at;
                better = (point, multipliers.equalities, solution.values.objective);
                error = own.off_on(problem, &fine, &better);
            }
        }
        let strips = fine.pieces.iter().enumerate();
        let strips = strips.filter(|(_, piece)| matches!(piece, Piece::Strip(_)));
        let middles = strips.step_by(2).map(|(k, _)| k + 1);
        let curvature = |point: &BeltPoint, node: usize| {
            let [bend, slope] = point.fields[node].into();
            (bend * (1.0 + slope * slope)).abs()
        };
        let in_element = |middle: usize| {
            let nodes = [middle - 1, middle, middle + 1];
            let curvatures =
                nodes.map(|node| [&better.0, &near.point].map(|point| curvature(point, node)));
            let most = curvatures.iter().map(|[better, _]| *better);
            let change = curvatures.iter().map(|[better, own]| (better - own).abs());
            [most.fold(0.0, f64::max), change.fold(0.0, f64::max)]
        };
        error.is_finite().then(|| Self {
            error: error.times(Self::OVER_CHANGE),
            gains: middles
                .clone()
                .map(|middle| gains[middle].max(f64::MIN_POSITIVE))
                .collect(),
            curvatures: middles.map(in_element).collect(),
        })
    }

    /// The estimate of a belt that lies without load and energy: no element contributes to its error.
    fn at_rest(error: MeshError, elements: usize) -> Self {
        Self {
            error: error.times(Self::OVER_CHANGE),
            gains: vec![f64::MIN_POSITIVE; elements],
            curvatures: vec![[0.0; 2]; elements],
        }
    }
}

/// The largest error of a stationary point of a problem's programme by one Newton step on the finer mesh; infinite
/// where there is no such step.
pub(super) fn largest_error_by_a_step(
    problem: &Problem,
    program: &BeltProgram,
    at: &Stationary<BeltPoint>,
    objective: f64,
) -> f64 {
    let step = || Halved::of(problem, program, at, objective)?.step(problem);
    step().map_or(f64::INFINITY, |step| {
        step.error.times(Estimate::OVER_CHANGE).largest()
    })
}

/// A stationary point of a programme, prolonged to the mesh of elements half as long.
struct Halved {
    /// The programme on that mesh.
    fine: BeltProgram,
    /// The point as it is, perhaps with ribs that meet.
    here: BeltPoint,
    /// The point with its ribs apart, and its multipliers.
    near: Stationary<BeltPoint>,
    /// The quantities of the point on its own mesh.
    own: Quantities,
}

/// A Newton step from a point on its own mesh towards the equilibrium of the finer one.
struct Step {
    /// Point, multipliers of its equations and objective after the step.
    better: (BeltPoint, Vec<f64>, f64),
    /// By how much the point before the step is off.
    error: MeshError,
    /// By how much the step lowers the energy at each node of the finer mesh, in mean R_f/U.
    gains: Vec<f64>,
}

impl Halved {
    fn of(
        problem: &Problem,
        program: &BeltProgram,
        at: &Stationary<BeltPoint>,
        objective: f64,
    ) -> Option<Self> {
        let fine = problem.program_on(&Mesh::of(problem, program).halved())?;
        let equalities = &at.multipliers.equalities;
        Some(Self {
            here: prolonged(program, &at.point, &fine),
            near: prolonged_with_multipliers(program, at, &fine),
            own: Quantities::of(problem, program, &at.point, equalities, objective),
            fine,
        })
    }

    fn error_at_rest(&self, problem: &Problem) -> MeshError {
        let Stationary { point, multipliers } = self.near.clone();
        let same = (point, multipliers.equalities, 0.0);
        self.own.off_on(problem, &self.fine, &same)
    }

    fn step(&self, problem: &Problem) -> Option<Step> {
        let step = stagewise::correct(&self.fine, tolerance(problem), self.near.clone())?;
        let better = (step.point, step.equalities, step.objective);
        Some(Step {
            error: self.own.off_on(problem, &self.fine, &better),
            better,
            gains: step.gains,
        })
    }
}

/// Whether ribs turn in an element that is longer than the belt is wide.
fn turns_coarsely(program: &BeltProgram, at: &BeltPoint) -> bool {
    let mut elements = program.elements();
    elements.any(|element| ribs_turn(at, element) && element.1.length > 2.0 * element.1.half_width)
}

/// Parts of every element of a mesh on which ribs would turn elsewhere, if that had less energy: where they turn at least
/// four, as elements half as long may hold them in the same place, and so many that they are short beside the width; two
/// elsewhere.
fn parts(program: &BeltProgram, at: &BeltPoint) -> Vec<usize> {
    /// Parts where ribs turn, at least and at most.
    const TURNING: [usize; 2] = [4, 64];
    let parts = |(k, element): (usize, &Element)| match ribs_turn(at, (k, element)) {
        true => {
            let wanted = PER_WIDTH * element.length / (2.0 * element.half_width);
            (wanted.ceil() as usize).clamp(TURNING[0], TURNING[1])
        }
        false => 2,
    };
    program.elements().map(parts).collect()
}

/// Tolerance of an equilibrium that another is only compared with: a lower one of the problem may be below rounding.
fn tolerance(problem: &Problem) -> f64 {
    /// Residual that hardly changes an estimate, lengths in U and energy in mean R_f/U.
    const CLOSE: f64 = 1e-8;
    problem.tolerance().max(CLOSE)
}

/// The minimum of a programme that a search from a point finds.
fn searched_near(
    problem: &Problem,
    program: &BeltProgram,
    near: &BeltPoint,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Solution<BeltPoint>> {
    let search = Search {
        tolerance: tolerance(problem),
        ..Search::of(problem)
    };
    let barrier = search.settings.warm_barrier;
    let found = search.only_from(program, near.clone(), barrier, proceed);
    (found.outcome == Outcome::Converged).then_some(found)
}

/// Whether a solution is not another equilibrium than the one that a point is close to.
fn is_next_to(found: &Solution<BeltPoint>, point: &BeltPoint) -> bool {
    /// Displacement of a node beyond which an equilibrium is another one, in U.
    const ANOTHER: f64 = 0.05;
    found.at.point.distance(point) <= ANOTHER
}

/// Force and moment, world axes.
type Wrench = (Vector3<f64>, Vector3<f64>);

/// The quantities of which the error is estimated.
pub(super) struct Quantities {
    /// Total potential with its zero at the programme's origin, in mean R_f/U.
    energy: f64,
    /// Difference between the total potential with its zero at the belt's start and the energy, in mean R_f/U.
    potential_of_start: f64,
    elastic_energy: f64,
    spine: Spine,
    /// Whether the belt may slide along itself, so that no position is determined.
    may_slide: bool,
    /// Forces and moments of supports, in R_f/U² and R_f/U.
    reactions: Vec<Wrench>,
    /// Forces of links, in R_f/U².
    links: Vec<Vector3<f64>>,
    /// Forces and moments along the belt; 0 where undetermined.
    internal: Vec<Vector3<f64>>,
    /// The undetermined components of all forces and moments.
    undetermined: Option<Undetermined>,
    /// The largest curvature on the spine.
    curvature: f64,
}

impl Quantities {
    pub(super) fn of<D: Density<F>, const F: usize, const N: usize>(
        problem: &Problem,
        program: &BeltProgram<D, F, N>,
        point: &BeltPoint<F>,
        equalities: &[f64],
        objective: f64,
    ) -> Self {
        let spine = problem.spine(program, point);
        let undetermined = program.undetermined(point);
        let mut internal = program.internal(point, equalities);
        if let Some(undetermined) = &undetermined {
            undetermined.set(0.0, &mut [], &mut [], &mut internal);
        }
        Self {
            energy: objective,
            potential_of_start: program.total_force().dot(&point.poses[0].position),
            elastic_energy: program.elastic_energy(&point.fields),
            reactions: program.reactions(point, equalities),
            links: program.link_forces(equalities),
            internal: vectors(internal),
            undetermined,
            curvature: least_spine_radius(&spine).map_or(0.0, |least| least.value.recip()),
            spine,
            may_slide: problem.is_left_alone(),
        }
    }

    /// Forces and moments of supports, and forces of links; 0 where they are undetermined in this shape or another.
    fn determined_with(&self, other: &Self) -> Vec<Vector3<f64>> {
        let (mut reactions, mut links) = (self.reactions.clone(), self.links.clone());
        for undetermined in [&self.undetermined, &other.undetermined]
            .into_iter()
            .flatten()
        {
            undetermined.set(0.0, &mut reactions, &mut links, &mut []);
        }
        vectors(reactions).into_iter().chain(links).collect()
    }

    /// By how much these are off those of a better point, with its multipliers and objective, of a programme.
    fn off_on(
        &self,
        problem: &Problem,
        program: &BeltProgram,
        (point, equalities, objective): &(BeltPoint, Vec<f64>, f64),
    ) -> MeshError {
        self.off(&Self::of(problem, program, point, equalities, *objective))
    }

    /// By how much these are off better ones on a mesh that has all their nodes, relative.
    pub(super) fn off(&self, better: &Self) -> MeshError {
        let same = SAME_PLACE * self.spine.length();
        let mut there = better.spine.u.iter().zip(&better.spine.pose);
        let nodes = self.spine.u.iter().zip(&self.spine.pose);
        let moves = nodes.map(|(u, pose)| match there.find(|(at, _)| **at >= u - same) {
            Some((_, better)) => (better.position - pose.position).norm(),
            None => f64::NAN,
        });
        let largest = |forces: &[Vector3<f64>]| forces.iter().map(|f| f.norm()).fold(0.0, f64::max);
        let forces = better.determined_with(self);
        let own = self.determined_with(better).into_iter();
        let changes = own.zip(&forces).map(|(own, better)| (own - better).norm());
        let from_start = better.energy + better.potential_of_start;
        MeshError {
            energy: share_above(
                SMALL * SMALL,
                self.energy - better.energy,
                from_start.abs().max(better.elastic_energy),
            ),
            position: match self.may_slide {
                true => f64::NAN,
                false => wrong_if_nan(moves.fold(0.0, larger) / self.spine.length()),
            },
            force: share(
                changes.fold(0.0, larger),
                largest(&forces).max(largest(&better.internal)),
            ),
            radius: share(self.curvature - better.curvature, better.curvature),
        }
    }
}

/// Forces and moments, one after the other.
fn vectors(wrenches: Vec<Wrench>) -> Vec<Vector3<f64>> {
    let both = |(force, moment): Wrench| [force, moment];
    wrenches.into_iter().flat_map(both).collect()
}

/// Force in R_f/U², moment in R_f/U, or curvature in 1/U, below which its error is not known; the energy of such is its square.
const SMALL: f64 = 1e-7;

/// A change of a force or a curvature as a share of the whole.
fn share(change: f64, whole: f64) -> f64 {
    share_above(SMALL, change, whole)
}

/// A change as a share of the whole: NaN of a whole that is small, 0 of one that is nothing but rounding beside a small one.
fn share_above(small: f64, change: f64, whole: f64) -> f64 {
    /// What is nothing but rounding, as a share of what is small.
    const NOTHING: f64 = 1e-7;
    match whole {
        whole if whole <= NOTHING * small => 0.0,
        whole if whole <= small => f64::NAN,
        _ => wrong_if_nan((change / whole).abs()),
    }
}

/// An error, infinite where it is NaN, so that it is no small one.
fn wrong_if_nan(error: f64) -> f64 {
    if error.is_nan() { f64::INFINITY } else { error }
}

/// The larger of two numbers; NaN where either is NaN, so that no NaN is lost.
fn larger(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn test_number_that_is_none_is_no_small_error_and_a_small_whole_has_none() {
        let small = MeshError {
            energy: 1e-6,
            position: 1e-6,
            force: 1e-6,
            radius: 1e-6,
        };
        let not_known = MeshError {
            position: f64::NAN,
            ..small
        };
        assert!(small.is_finite() && not_known.is_finite() && not_known.largest() == 1e-6);
        for energy in [
            share(f64::NAN, 1.0),
            share(1.0, f64::NAN),
            share(f64::MAX, 1e-6),
        ] {
            assert!(!MeshError { energy, ..small }.is_finite());
        }
        assert!(share(1e-8, 1e-8).is_nan() && share(1e-15, 1e-15) == 0.0);
        assert!([1.0, f64::NAN, 2.0].into_iter().fold(0.0, larger).is_nan());
    }
}
