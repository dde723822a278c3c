//! Slender belts: their ribs turn within a length of the width, at places that no mesh can know before.

use super::{FIRST, LONGEST, Level, TURN};
use crate::equilibrium::guess::inside;
use crate::equilibrium::search::{Search, prolonged_by};
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::problem::{Mesh, Problem};
use crate::scenario::SAME_PLACE;
use crate::strip::element::Element;
use std::ops::ControlFlow;

/// Elements for each width V where ribs turn, a number: longer ones may settle on a false level.
pub(in crate::equilibrium) const PER_WIDTH: f64 = 8.0;

/// A stretch along which ribs turn.
#[derive(Debug, Clone, Copy)]
struct Turn {
    /// Its ends, in U.
    ends: [f64; 2],
    /// The place about which they turn, in U.
    at: f64,
}

/// The minimum of a belt some times as wide as the problem's own.
struct Widened {
    /// Width over the belt's own.
    width: f64,
    level: Level,
    /// Where its ribs turn.
    turns: Vec<Turn>,
}

/// The minimum of a wider belt made narrower step by step, down to the belt itself; `None` of a belt that is not slender or may
/// slide along itself, which has no place on a graded mesh, and where this leads nowhere. The search for the wider belt begins
/// at a shape of another programme, or at the guess.
///
/// The ribs of a slender belt turn within a length of its width. Those of a wider belt turn at nearly the same places, and
/// less suddenly. The places move in proportion to the width, and what is within a width of them keeps its shape in units of
/// the width: so is the start for a narrower belt made.
pub(super) fn narrowed(
    problem: &Problem,
    search: &Search,
    mesh: &Mesh,
    near: Option<(&BeltProgram, &BeltPoint)>,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Level> {
    /// Factor by which the belt is made narrower at first and at most, dimensionless.
    const NARROWER: [f64; 2] = [4.0, 16.0];
    /// Factor below which making it narrower leads nowhere, dimensionless.
    const LEAST: f64 = 1.2;
    /// Greatest number of meshes for a width, on which the places where ribs turn come to rest.
    const MESHES: usize = 3;
    let barrier = search.settings.warm_barrier;
    let breaks = problem.break_points();
    let mut width = first_width(problem);
    if width == 1.0 || problem.is_left_alone() {
        return None;
    }
    let program = problem.program_on(mesh)?.widened(width);
    let level = Level::on(problem, search, program, near, barrier, proceed);
    let mut iterations = level.solution.iterations;
    let mut best = Widened::at(width, level, &breaks)?;
    let mut settled: Vec<Widened> = Vec::new();
    let mut factor = NARROWER[0];
    loop {
        let mut found = None;
        for _ in 0..MESHES {
            let from = found.as_ref().unwrap_or(&best);
            let moved = from.turns_at(width, settled.last());
            let program = problem.program_on(&from.mesh_at(problem, width, &moved))?;
            let program = program.widened(width);
            let start = from.shape_at(&breaks, &moved, &program);
            let level = Level::near(problem, search, program, start, barrier, proceed);
            iterations += level.solution.iterations;
            found = Widened::at(width, level, &breaks);
            if found.as_ref().is_none_or(|found| found.is_at(&moved)) {
                break;
            }
        }
        match found {
            Some(mut found) if width == 1.0 => {
                found.level.solution.iterations = iterations;
                return Some(found.level);
            }
            Some(found) => {
                settled.push(std::mem::replace(&mut best, found));
                width = (best.width / factor).max(1.0);
                factor = (factor * factor).min(NARROWER[1]);
            }
            None => {
                factor = factor.sqrt();
                width = (best.width / factor).max(1.0);
            }
        }
        if factor < LEAST {
            return None;
        }
    }
}

impl Widened {
    /// A level at a width; `None` of one that has not converged.
    fn at(width: f64, level: Level, breaks: &[f64]) -> Option<Self> {
        level.has_converged().then(|| Self {
            width,
            turns: turns(breaks, &level.program, &level.solution.at.point),
            level,
        })
    }

    /// Where ribs turn at another width: their places move in proportion to the width, if it is known from a wider belt how
    /// they do.
    fn turns_at(&self, width: f64, wider: Option<&Self>) -> Vec<Turn> {
        let wider = wider.filter(|wider| wider.turns.len() == self.turns.len());
        let wider = wider.filter(|wider| wider.width > self.width);
        let rate = |k: usize| {
            wider.map_or(0.0, |wider| {
                (self.turns[k].at - wider.turns[k].at) / (self.width - wider.width)
            })
        };
        let turns = self.turns.iter().enumerate();
        turns
            .map(|(k, turn)| {
                let at = turn.at + rate(k) * (width - self.width);
                let share = width / self.width;
                Turn {
                    at,
                    ends: turn.ends.map(|end| at + share * (end - turn.at)),
                }
            })
            .collect()
    }

    /// Whether ribs turn about where they were expected to, so that the mesh is fine all about.
    fn is_at(&self, expected: &[Turn]) -> bool {
        /// Distance from where they were expected over that to the end of the fine mesh, dimensionless.
        const NEAR: f64 = 0.5;
        self.turns.len() == expected.len()
            && self.turns.iter().zip(expected).all(|(turn, expected)| {
                let way = turn.at - expected.at;
                let room = expected.ends.map(|end| end - expected.at);
                way >= NEAR * room[0] && way <= NEAR * room[1]
            })
    }

    /// The mesh for another width, fine where ribs will turn.
    fn mesh_at(&self, problem: &Problem, width: f64, turns: &[Turn]) -> Mesh {
        /// Elements for each width where ribs will turn, a number: more than are needed where they are known to.
        const PER_WIDTH: f64 = 12.0;
        let short = width * own_width(problem) / PER_WIDTH;
        let lengths = self.level.program.elements().map(|(k, element)| {
            let longest = if width > 1.0 {
                element.length.max(LONGEST)
            } else {
                LONGEST
            };
            longest.min(element.length * TURN / self.level.turn_of((k, element)))
        });
        let places = turns.iter().flat_map(|turn| {
            let [from, to] = turn.ends;
            let count = ((to - from) / (4.0 * short)).ceil() as usize + 1;
            (0..=count).map(move |k| [from + (to - from) * k as f64 / count as f64, short])
        });
        let (lengths, places): (Vec<_>, Vec<_>) = (lengths.collect(), places.collect());
        Mesh::of(problem, &self.level.program).graded(problem, &lengths, &places)
    }

    /// The shape for another width, with ribs that turn elsewhere, on the nodes of a programme.
    fn shape_at(&self, breaks: &[f64], turns: &[Turn], to: &BeltProgram) -> BeltPoint {
        let anchors = self.anchors(breaks, turns);
        let own = |u: f64| {
            let next = anchors.partition_point(|[there, _]| *there < u);
            let next = next.clamp(1, anchors.len() - 1);
            let [[a, from], [b, to]] = [anchors[next - 1], anchors[next]];
            from + (to - from) * (u - a) / (b - a)
        };
        let (program, point) = (&self.level.program, &self.level.solution.at.point);
        inside(to, prolonged_by(program, point, to, &own))
    }

    /// Pairs of places, of the belt with ribs that turn elsewhere and of this one, between which places go in proportion.
    fn anchors(&self, breaks: &[f64], turns: &[Turn]) -> Vec<[f64; 2]> {
        /// Distance from where ribs turn beyond which no place moves, over the distance of their end.
        const FAR: f64 = 4.0;
        let mut anchors: Vec<[f64; 2]> = breaks.iter().map(|at| [*at; 2]).collect();
        for (new, own) in turns.iter().zip(&self.turns) {
            let next = anchors.partition_point(|[_, at]| *at < own.at);
            let next = next.clamp(1, anchors.len() - 1);
            let [before, after] = [anchors[next - 1], anchors[next]];
            let [left, right] = own.ends.map(|end| own.at + FAR * (end - own.at));
            let ends = [0, 1].map(|side| [new.ends[side], own.ends[side]]);
            let within = |pair: &[f64; 2]| {
                (0..2).all(|i| pair[i] > before[i] + SAME_PLACE && pair[i] < after[i] - SAME_PLACE)
            };
            let of_turn = [[left; 2], ends[0], ends[1], [right; 2]];
            let of_turn: Vec<_> = of_turn.into_iter().filter(within).collect();
            let rises = |pairs: &[[f64; 2]]| (0..2).all(|i| pairs[0][i] + SAME_PLACE < pairs[1][i]);
            if of_turn.windows(2).all(rises) {
                anchors.splice(next..next, of_turn);
            }
        }
        anchors
    }
}

/// The stretches along which the ribs of a shape turn; those that end where elements must meet turn about that place.
fn turns(breaks: &[f64], program: &BeltProgram, point: &BeltPoint) -> Vec<Turn> {
    let nodes = program.nodes();
    let mut turns: Vec<(Turn, f64)> = Vec::new();
    let turning = program.elements();
    for (k, element) in turning.filter(|element| ribs_turn(point, *element)) {
        let [from, to] = [nodes[k], nodes[k + 1]];
        let change = (point.fields[k + 1][1] - point.fields[k][1]).abs();
        let middle = 0.5 * (from + to);
        match turns.last_mut() {
            Some((turn, whole)) if from - turn.ends[1] <= 2.0 * element.half_width => {
                turn.at = (turn.at * *whole + middle * change) / (*whole + change);
                turn.ends[1] = to;
                *whole += change;
            }
            _ => turns.push((
                Turn {
                    ends: [from, to],
                    at: middle,
                },
                change,
            )),
        }
    }
    let is_break = |place: f64| breaks.iter().any(|at| (at - place).abs() <= SAME_PLACE);
    let held = |(turn, _): (Turn, f64)| match turn.ends.into_iter().find(|end| is_break(*end)) {
        Some(end) => Turn { at: end, ..turn },
        None => turn,
    };
    turns.into_iter().map(held).collect()
}

/// Width of the belt that is solved first, over the belt's own; 1 of a belt that is not slender.
fn first_width(problem: &Problem) -> f64 {
    /// Width of a belt that is not slender, in U.
    const WIDE: f64 = 0.05;
    /// Greatest width over the length of a stretch, and over the radius of an arc, dimensionless.
    const SHARE: f64 = 0.5;
    let breaks = problem.break_points();
    let stretches = breaks.windows(2).map(|ends| ends[1] - ends[0]);
    let shortest = stretches.fold(f64::INFINITY, f64::min);
    let program = problem.program(FIRST);
    let radii = program.elements().map(|(_, e)| e.geodesic.abs().recip());
    let least = radii.fold(shortest, f64::min);
    (WIDE.min(SHARE * least) / own_width(problem)).max(1.0)
}

/// The programme of the widened belt that is solved first for a slender one.
pub(in crate::equilibrium) fn widened(problem: &Problem) -> BeltProgram {
    problem.program(FIRST).widened(first_width(problem))
}

/// Whether a belt is so slender that its ribs turn within a small part of its length.
pub(in crate::equilibrium) fn is_slender(problem: &Problem) -> bool {
    first_width(problem) > 1.0
}

/// The mesh of a programme graded anew for a shape of its: fine where ribs turn, and so far about these places that they may
/// move by as much as the width.
///
/// Elements that are shorter there are not kept: where the error asks for them they are found again, and else each mesh would
/// be finer than the one before.
pub(in crate::equilibrium) fn mesh_about_ribs(
    problem: &Problem,
    program: &BeltProgram,
    point: &BeltPoint,
) -> Mesh {
    let reach = own_width(problem);
    let nodes = program.nodes();
    let turning = program.elements();
    let turning = turning.filter(|element| ribs_turn(point, *element));
    let turning: Vec<_> = turning.map(|(k, _)| [nodes[k], nodes[k + 1]]).collect();
    let is_near = |k: usize| {
        let mut turning = turning.iter();
        turning.any(|[from, to]| from - nodes[k + 1] < reach && nodes[k] - to < reach)
    };
    let lengths: Vec<f64> = program
        .elements()
        .map(|(k, element)| match is_near(k) {
            true => reach / PER_WIDTH,
            false => element.length.max(LONGEST),
        })
        .collect();
    Mesh::of(problem, program).graded(problem, &lengths, &[])
}

/// The mesh of a programme with elements split so that ribs may come to turn anywhere; `None` where it would have too many.
pub(in crate::equilibrium) fn mesh_for_ribs_anywhere(
    problem: &Problem,
    program: &BeltProgram,
) -> Option<Mesh> {
    /// Greatest number of elements.
    const MOST: usize = 1000;
    let short = own_width(problem) / PER_WIDTH;
    let lengths = program.elements().map(|(_, e)| e.length.min(short));
    let lengths: Vec<f64> = lengths.collect();
    let mesh = Mesh::of(problem, program).graded(problem, &lengths, &[]);
    (mesh.elements() <= MOST).then_some(mesh)
}

/// The width of a belt, in U.
fn own_width(problem: &Problem) -> f64 {
    problem.belt().width / problem.units().length
}

/// Whether the ribs of a shape turn fast in an element, as seen by its width.
pub(in crate::equilibrium) fn ribs_turn(
    shape: &BeltPoint,
    (k, element): (usize, &Element),
) -> bool {
    /// Share of the greatest convergence 2/V from which ribs turn fast, dimensionless.
    const FAST: f64 = 0.2;
    let slopes = [k, k + 1].map(|node| shape.fields[node][1]);
    let (_, convergence) = element.strips().middle(slopes);
    convergence.abs() * element.half_width > FAST
}
