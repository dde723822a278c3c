//! The search for a minimum: its first start and its other starts.

use crate::equilibrium::guess::{buckle, disturb, guess, inside, is_flat, ring};
use crate::problem::program::{BeltPoint, BeltProgram, Piece};
use crate::scenario::SAME_PLACE;
use nalgebra::{Vector2, Vector3};
use stagewise::{Multipliers, Outcome, Program, Settings, Solution, Stationary};
use std::f64::consts::PI;
use std::ops::ControlFlow;

type Proceed<'a> = dyn FnMut() -> ControlFlow<()> + 'a;

/// Barriers, starts and limits of the search for a minimum.
#[derive(Debug, Clone, Copy)]
pub(super) struct MinimumSettings {
    /// First barrier from a guess, in mean R_f/U: so high that the search first finds the supports, then lowers the energy.
    pub(super) cold_barrier: f64,
    /// First barrier from the solution of a problem nearby, in mean R_f/U.
    pub(super) warm_barrier: f64,
    /// First barrier from the same minimum on another mesh, in mean R_f/U.
    pub(super) close_barrier: f64,
    /// Longest step, root mean square of the displacement of the board, in U.
    pub(super) longest_step: f64,
    /// Greatest count of iterations from one start, a number.
    pub(super) iterations: usize,
    /// Disturbances of a start that leads to no minimum, in turn, as shares of the rib bound.
    pub(super) disturbances: [f64; 3],
    /// Rib slope from which a flat belt is tried for buckling, dimensionless.
    pub(super) slant: f64,
    /// Steps in which a closed belt is twisted up, a number per half turn: steps of an eighth of a turn keep to the shape
    /// that began as a ring.
    pub(super) twist_steps: i32,
}

impl Default for MinimumSettings {
    fn default() -> Self {
        Self {
            cold_barrier: 10.0,
            warm_barrier: 0.1,
            close_barrier: 1e-3,
            longest_step: f64::INFINITY,
            iterations: 500,
            disturbances: [0.05, 0.2, 0.4],
            slant: 0.7,
            twist_steps: 4,
        }
    }
}

impl MinimumSettings {
    /// The settings near to a minimum of an elastic energy: barriers that are high beside it would lead the ribs away.
    pub(super) fn beside(self, energy: f64) -> Self {
        /// Energy of a belt that is flat but for rounding, in mean R_f/U: there the barrier keeps the ribs calm.
        const FLAT: f64 = 1e-12;
        let share = if energy > FLAT { energy.min(1.0) } else { 1.0 };
        Self {
            warm_barrier: share * self.warm_barrier,
            close_barrier: share * self.close_barrier,
            ..self
        }
    }
}

/// Count of flat nodes from which a belt under load counts as flat, besides those of stiff pieces, as a share of all nodes.
const FLAT_SHARE: f64 = 0.1;

/// A search for a minimum.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search {
    /// Direction in which the guess bulges, world axes, of any length.
    pub(super) bulge: Vector3<f64>,
    /// Largest residual of a converged point, lengths in U and energy in mean R_f/U.
    pub(super) tolerance: f64,
    /// Barriers, starts and limits.
    pub(super) settings: MinimumSettings,
}

impl Search {
    /// The guess with its values, without iterations.
    pub(super) fn start(&self, program: &BeltProgram) -> Solution<BeltPoint> {
        let settings = Settings {
            iterations: 0,
            ..self.interior_point(self.settings.cold_barrier)
        };
        let start = guess(program, &self.bulge);
        stagewise::minimise(program, &settings, start, &mut || ControlFlow::Continue(()))
    }

    /// Solves on the problem's mesh; by way of a coarse mesh if one is given, so that refining a mesh does not lead to
    /// another shape of the belt.
    pub(super) fn run(
        &self,
        program: &BeltProgram,
        coarse: Option<&BeltProgram>,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        let Some(coarse) = coarse else {
            return self.cold(program, proceed);
        };
        let found = self.cold(coarse, proceed);
        let fine = prolong(coarse, &found.at.point, program);
        if found.outcome == Outcome::Interrupted {
            // The result must be a shape on the problem's mesh all the same.
            return self.minimise(program, fine, self.settings.warm_barrier, &mut || {
                ControlFlow::Break(())
            });
        }
        let refined = self
            .minimise(program, fine, self.settings.warm_barrier, proceed)
            .after(found.iterations);
        if rank(&refined) >= rank(&found) || refined.outcome == Outcome::Interrupted {
            return refined;
        }
        better(refined, |_| self.cold(program, proceed))
    }

    /// Goes on from the minimum of a programme nearby; from the guess if this leads to no minimum.
    pub(super) fn again(
        &self,
        program: &BeltProgram,
        found: Solution<BeltPoint>,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        let iterations = found.iterations;
        self.from(program, found.at.point, proceed)
            .after(iterations)
    }

    /// Searches from a shape of the same mesh; from the guess if this leads to no minimum.
    pub(super) fn from(
        &self,
        program: &BeltProgram,
        point: BeltPoint,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        let near = self.minimise(
            program,
            inside(program, point),
            self.settings.warm_barrier,
            proceed,
        );
        if is_done(&near) {
            return near;
        }
        better(near, |_| self.cold(program, proceed))
    }

    /// Searches from a shape of the same mesh and from nowhere else, with a given first barrier.
    pub(super) fn only_from(
        &self,
        program: &BeltProgram,
        point: BeltPoint,
        barrier: f64,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        self.minimise(program, inside(program, point), barrier, proceed)
    }

    /// Searches from a stationary point very near to a minimum, in the units of its energy.
    pub(super) fn sharpened_from(
        &self,
        program: &BeltProgram,
        near: &Stationary<BeltPoint>,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        /// First barrier in the unit of the energy, no more than that of a converged minimum.
        const BARRIER: f64 = 1e-9;
        stagewise::minimise_near(program, &self.interior_point(BARRIER), near, proceed)
    }

    /// Searches from the guess, or through the supports of a belt held between its ends, then from other starts, until a minimum
    /// is found; if none is, the best end.
    fn cold(&self, program: &BeltProgram, proceed: &mut Proceed) -> Solution<BeltPoint> {
        // The caller is asked no more after a break, in whatever part of the search it comes.
        let mut broken = false;
        let proceed: &mut Proceed = &mut || {
            broken = broken || proceed().is_break();
            match broken {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        let through = self.through_supports(program, proceed);
        let is_through = through.is_some();
        let start = through.unwrap_or_else(|| match program.half_turns {
            None => guess(program, &self.bulge),
            Some(half_turns) => self.twisted_up(program, half_turns, proceed),
        });
        let mut best = self.minimise(program, start.clone(), self.settings.cold_barrier, proceed);
        if is_through && !is_done(&best) {
            best = better(best, |_| {
                let guess = guess(program, &self.bulge);
                self.minimise(program, guess, self.settings.cold_barrier, proceed)
            });
        }
        if !is_done(&best) {
            best = better(best, |_| self.by_way_of_another(program, &start, proceed));
        }
        let slant = self.settings.slant;
        for (slope, wave) in [(slant, 0.0), (-slant, 0.0), (0.0, 1.0), (0.0, 2.0)] {
            if best.outcome != Outcome::Interrupted && is_flat_under_load(program, &best.at.point) {
                best = better(best, |best| {
                    let buckled = buckle(program, &best.at.point, slope, wave, &self.bulge);
                    self.minimise(program, buckled, self.settings.warm_barrier, proceed)
                });
            }
        }
        for share in self.settings.disturbances {
            if is_done(&best) {
                break;
            }
            best = better(best, |best| {
                let from = if best.outcome == Outcome::Converged {
                    &best.at.point
                } else {
                    &start
                };
                let disturbed = disturb(program, from, share);
                self.minimise(program, disturbed, self.settings.cold_barrier, proceed)
            });
        }
        best
    }

    /// The start for a closed belt: a ring cut open and twisted at the cut, as by hand, a little at a time.
    fn twisted_up(
        &self,
        program: &BeltProgram,
        half_turns: i32,
        proceed: &mut Proceed,
    ) -> BeltPoint {
        let steps = self.settings.twist_steps;
        let mut point = ring(program, &self.bulge);
        for step in 1..=steps * half_turns.abs() {
            let angle = PI * f64::from(half_turns.signum() * step) / f64::from(steps);
            let cut = program.cut_and_twisted(angle);
            point = self
                .minimise(
                    &cut,
                    inside(&cut, point),
                    self.settings.warm_barrier,
                    proceed,
                )
                .at
                .point;
        }
        inside(program, point)
    }

    /// Solves with the stand-in of the programme's energy, and from its solution with the programme's own.
    fn by_way_of_another(
        &self,
        program: &BeltProgram,
        start: &BeltPoint,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        let mut other = program.clone();
        other.model = program.model.stand_in();
        let found = self.minimise(&other, start.clone(), self.settings.cold_barrier, proceed);
        let iterations = found.iterations;
        self.minimise(
            program,
            inside(program, found.at.point),
            self.settings.warm_barrier,
            proceed,
        )
        .after(iterations)
    }

    pub(super) fn minimise(
        &self,
        program: &BeltProgram,
        start: BeltPoint,
        barrier: f64,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        match self.with_square_seam(program, &start, barrier, proceed) {
            None => stagewise::minimise(program, &self.interior_point(barrier), start, proceed),
            Some(found) if is_done(&found) => found,
            Some(found) => {
                let settings = self.interior_point(barrier);
                let free = stagewise::minimise(program, &settings, start, proceed);
                free.after(found.iterations)
            }
        }
    }

    /// Searches from a shape of the same mesh as from afar, to a loose tolerance and with few iterations; `passed` gets every
    /// solution of a barrier problem, with its barrier in mean R_f/U, and interrupts by `Break`.
    pub(super) fn explore(
        &self,
        program: &BeltProgram,
        shape: BeltPoint,
        passed: &mut dyn FnMut(f64, &BeltPoint) -> ControlFlow<()>,
        proceed: &mut Proceed,
    ) -> Solution<BeltPoint> {
        /// Largest residual, lengths in U and energy in mean R_f/U.
        const LOOSE: f64 = 1e-3;
        let settings = Settings {
            tolerance: self.tolerance.max(LOOSE),
            ..self.interior_point(self.settings.cold_barrier)
        };
        stagewise::minimise_past(program, &settings, inside(program, shape), passed, proceed)
    }

    pub(super) fn interior_point(&self, barrier: f64) -> Settings {
        Settings {
            tolerance: self.tolerance,
            iterations: self.settings.iterations,
            barrier,
            longest_step: self.settings.longest_step,
        }
    }
}

/// Whether the search is over.
pub(super) fn is_done(solution: &Solution<BeltPoint>) -> bool {
    solution.outcome == Outcome::Interrupted || rank(solution) == 2
}

/// Whether a good part of a belt under load has stayed flat: there the slope of its ribs costs nothing, and the second
/// variation does not show the shape into which it buckles.
pub(super) fn is_flat_under_load(program: &BeltProgram, point: &BeltPoint) -> bool {
    let fields = &point.fields;
    let flat = fields.iter().filter(|fields| is_flat(fields)).count();
    let stiff = fields.len() - program.elements().count();
    program.is_loaded() && flat as f64 > FLAT_SHARE * fields.len() as f64 + stiff as f64
}

/// The better of two ends, of equal ranks the one with the lower energy, with the iterations of both.
fn better(
    best: Solution<BeltPoint>,
    next: impl FnOnce(&Solution<BeltPoint>) -> Solution<BeltPoint>,
) -> Solution<BeltPoint> {
    let next = next(&best);
    let (best_iterations, next_iterations) = (best.iterations, next.iterations);
    let lower = next.values.objective <= best.values.objective;
    let better = rank(&next) > rank(&best) || (rank(&next) == rank(&best) && lower);
    if next.outcome == Outcome::Interrupted || better {
        next.after(best_iterations)
    } else {
        best.after(next_iterations)
    }
}

/// Rank of an end, higher for the better: 2 of a minimum, 1 of another equilibrium, 0 of anything else.
fn rank(solution: &Solution<BeltPoint>) -> u8 {
    match solution.outcome {
        Outcome::Converged if solution.is_minimum() => 2,
        Outcome::Converged => 1,
        _ => 0,
    }
}

/// A shape prolonged to another mesh, its ribs a little off the bound.
pub(super) fn prolong(from: &BeltProgram, point: &BeltPoint, to: &BeltProgram) -> BeltPoint {
    inside(to, prolonged(from, point, to))
}

/// A shape prolonged to another mesh.
pub(crate) fn prolonged(from: &BeltProgram, point: &BeltPoint, to: &BeltProgram) -> BeltPoint {
    prolonged_by(from, point, to, &|u| u)
}

/// A shape prolonged to another mesh whose places are other ones of the shape, arc lengths in U; nodes at jumps keep theirs.
pub(super) fn prolonged_by(
    from: &BeltProgram,
    point: &BeltPoint,
    to: &BeltProgram,
    own: &dyn Fn(f64) -> f64,
) -> BeltPoint {
    let (nodes, known) = (to.nodes(), from.nodes());
    let after_joint = |k: usize| k > 0 && matches!(to.pieces[k - 1], Piece::Joint { .. });
    let places = nodes.iter().enumerate();
    let fields: Vec<_> = places
        .map(|(k, u)| fields_at(from, &known, point, own(*u), after_joint(k)))
        .collect();
    let mut prolonged = BeltPoint {
        poses: vec![point.poses[0]; fields.len()],
        fields,
    };
    to.settle(&mut prolonged);
    prolonged
}

/// A point with its multipliers prolonged to another mesh, or to another active set; its ribs a little off the bound where
/// they would meet.
pub(crate) fn prolonged_with_multipliers(
    from: &BeltProgram,
    at: &Stationary<BeltPoint>,
    to: &BeltProgram,
) -> Stationary<BeltPoint> {
    let point = prolonged(from, &at.point, to);
    Stationary {
        point: match to.least_slack(&point) <= 0.0 {
            true => inside(to, point),
            false => point,
        },
        multipliers: Multipliers {
            equalities: at.multipliers.equalities.clone(),
            inequalities: prolong_inequalities(from, &at.multipliers.inequalities, to),
        },
    }
}

/// The inequalities' multipliers prolonged to another mesh: the multipliers of a stage are shared out by length.
pub(super) fn prolong_inequalities(
    from: &BeltProgram,
    multipliers: &[f64],
    to: &BeltProgram,
) -> Vec<f64> {
    let (nodes, known) = (to.nodes(), from.nodes());
    let layout = from.layout();
    let mut prolonged = Vec::new();
    for (k, element) in to.elements() {
        let middle = 0.5 * (nodes[k] + nodes[k + 1]);
        let parent = known.partition_point(|node| *node <= middle);
        let parent = parent.clamp(1, from.pieces.len()) - 1;
        let Piece::Strip(whole) = &from.pieces[parent] else {
            continue;
        };
        let share = element.length / whole.length;
        let rows = &multipliers[layout.stage_rows(parent)];
        let of_bound = |bound: usize| {
            let mut known = from.bounds(parent, whole).places().zip(rows);
            known
                .find(|(known, _)| *known == bound)
                .map_or(0.0, |(_, multiplier)| share * multiplier)
        };
        prolonged.extend(to.bounds(k, element).places().map(of_bound));
    }
    prolonged
}

/// The fields at an arc length in U, before or after the jump where there is one.
pub(super) fn fields_at(
    program: &BeltProgram,
    nodes: &[f64],
    point: &BeltPoint,
    u: f64,
    after: bool,
) -> Vector2<f64> {
    let last = nodes.len() - 1;
    let next = nodes
        .partition_point(|node| *node < u - SAME_PLACE)
        .min(last);
    if (nodes[next] - u).abs() <= SAME_PLACE || next == 0 {
        let joint = matches!(program.pieces.get(next), Some(Piece::Joint { .. }));
        return point.fields[if joint && after { next + 1 } else { next }];
    }
    let share = (u - nodes[next - 1]) / (nodes[next] - nodes[next - 1]);
    point.fields[next - 1].lerp(&point.fields[next], share.clamp(0.0, 1.0))
}
