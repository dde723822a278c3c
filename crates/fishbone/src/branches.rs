//! All equilibria of a scenario that can be found: many starts, then pushes from each that is found to others.
//!
//! The starts are arches to either side with waves of bend and of rib slope laid over them, and lead to minima. A push along
//! one of the lowest modes of an equilibrium, followed until it takes none, leads to another, of one index more or less; and
//! from a saddle it is downhill to both sides.

use crate::equilibrium::{Equilibrium, Status, is_settled, minimum_from, of_solution, program_of};
use crate::guess::{guess, waved};
use crate::program::{BeltPoint, BeltProgram};
use crate::scenario::{Method, Scenario};
use crate::solver::{self, Mode, Stationary};
use crate::twins::are_twins;
use nalgebra::{Vector2, Vector3};
use std::f64::consts::PI;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Most pushes.
const PUSHES: usize = 400;
/// Most negative modes of what is told.
const HIGHEST_INDEX: usize = 2;
/// Modes along which an equilibrium is pushed, by its number of negative modes.
const PUSHED_MODES: [usize; HIGHEST_INDEX + 1] = [6, 4, 0];

/// Runs `task(i)` for every i below a number, in any order and on any thread.
pub type Run<'a> = dyn Fn(usize, &(dyn Fn(usize) + Sync)) + 'a;

/// What is asked and told while the search goes on, from any thread.
pub trait Watch: Sync {
    /// Whether to go on.
    fn proceed(&self) -> ControlFlow<()>;

    /// So many tasks are done of those that are planned so far.
    fn tell(&self, done: usize, planned: usize);
}

/// Runs one task after the other on this thread.
pub fn one_by_one(count: usize, task: &(dyn Fn(usize) + Sync)) {
    (0..count).for_each(task);
}

/// The equilibria of a scenario that [`Scenario::validate`] passes, rising in energy: minima, and saddles with one or two
/// negative modes.
///
/// Of shapes that are mirror images of each other the one is told that bulges as the scenario asks. The same input gives the
/// same output, whatever runs the tasks. Where nothing is found, the one outcome of a solve is told, which says why.
pub fn branches(scenario: &Scenario, run: &Run, watch: &dyn Watch) -> Vec<Equilibrium> {
    let proceed = &mut || watch.proceed();
    let first = crate::equilibrium::solve(scenario, proceed);
    if first.status != Status::Converged || scenario.solver.method != Method::Intrinsic {
        let is_hopeless = first.status == Status::Infeasible;
        if is_hopeless || scenario.solver.method != Method::Intrinsic {
            return vec![first];
        }
    }
    let mut census = Census {
        scenario,
        run,
        watch,
        found: Vec::new(),
        done: AtomicUsize::new(0),
        planned: 0,
    };
    census.enter(first.clone());
    census.start();
    census.push();
    let mut found = census.found;
    if found.is_empty() {
        return vec![first];
    }
    found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    found
}

/// What has been found so far.
struct Census<'a> {
    scenario: &'a Scenario,
    run: &'a Run<'a>,
    watch: &'a dyn Watch,
    found: Vec<Equilibrium>,
    done: AtomicUsize,
    planned: usize,
}

impl Census<'_> {
    /// Runs a task for each item; what comes out, in the order of the items.
    fn each<T: Sync, R: Send + Sync>(
        &mut self,
        items: &[T],
        task: impl Fn(&T) -> R + Sync,
    ) -> Vec<R> {
        self.planned += items.len();
        let slots: Vec<OnceLock<R>> = items.iter().map(|_| OnceLock::new()).collect();
        (self.run)(items.len(), &|i| {
            let filled = slots[i].set(task(&items[i]));
            debug_assert!(filled.is_ok(), "every task runs once");
            let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
            self.watch.tell(done, self.planned);
        });
        slots.into_iter().filter_map(OnceLock::into_inner).collect()
    }

    /// Enters an equilibrium unless it is known or of too many negative modes; whether it is new.
    fn enter(&mut self, equilibrium: Equilibrium) -> bool {
        let index = equilibrium.stability.map_or(0, |s| s.negative_modes);
        if equilibrium.status != Status::Converged || index > HIGHEST_INDEX {
            return false;
        }
        let twin = self
            .found
            .iter_mut()
            .find(|known| is_twin(known, &equilibrium));
        match twin {
            None => {
                self.found.push(equilibrium);
                true
            }
            Some(twin) => {
                if height(&equilibrium) > height(twin) + 1e-9 * equilibrium.spine.length() {
                    *twin = equilibrium;
                }
                false
            }
        }
    }

    /// Minimises from many starts.
    fn start(&mut self) {
        let scenario = self.scenario;
        let starts = starts(scenario);
        let watch = self.watch;
        let found = self.each(&starts, |start| {
            minimum_from(scenario, start, &mut || watch.proceed())
        });
        for equilibrium in found {
            self.enter(equilibrium);
        }
    }

    /// Pushes what was found along its lowest modes, and what is found so, until nothing new is.
    fn push(&mut self) {
        let (mut from, mut pushes) = (0, 0);
        while from < self.found.len() && pushes < PUSHES {
            let new = self.found[from..].to_vec();
            from = self.found.len();
            let modes = self.each(&new, lowest_modes);
            let tasks: Vec<_> = new
                .iter()
                .zip(&modes)
                .flat_map(|(equilibrium, modes)| {
                    let sided = modes.iter().flat_map(|mode| [(mode, true), (mode, false)]);
                    sided.map(move |(mode, forth)| (equilibrium, mode, forth))
                })
                .take(PUSHES - pushes)
                .collect();
            pushes += tasks.len();
            let (scenario, watch) = (self.scenario, self.watch);
            let found = self.each(&tasks, |(equilibrium, mode, forth)| {
                pushed(scenario, equilibrium, mode, *forth, watch)
            });
            for equilibrium in found.into_iter().flatten() {
                self.enter(equilibrium);
            }
        }
    }
}

/// The modes along which an equilibrium is pushed.
fn lowest_modes(equilibrium: &Equilibrium) -> Vec<Mode> {
    let index = equilibrium.stability.map_or(0, |s| s.negative_modes);
    let count = PUSHED_MODES[index.min(HIGHEST_INDEX)];
    let solved = equilibrium.solved.as_ref().filter(|_| count > 0);
    let modes = solved.and_then(|solved| {
        solver::lowest_modes(&solved.program, &mut solved.at.clone(), count).ok()
    });
    modes.unwrap_or_default()
}

/// The equilibrium that a push leads to and, where that is a saddle, the minima downhill on either side.
fn pushed(
    scenario: &Scenario,
    from: &Equilibrium,
    mode: &Mode,
    forth: bool,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    let Some(solved) = &from.solved else {
        return Vec::new();
    };
    let program = &solved.program;
    let tolerance = scenario.solver.tolerance;
    let proceed = &mut |_| watch.proceed();
    let other = solver::pushed_over(program, tolerance, &solved.at, mode, forth, proceed);
    let Some(other) = other else {
        return Vec::new();
    };
    let mut found = downhill(scenario, program, &other, watch);
    if is_settled(scenario, program, &other.point) {
        let solution = solver::assess(program, tolerance, &other);
        found.push(of_solution(scenario, program.clone(), solution));
    }
    found
}

/// The minima downhill from a saddle, to either side along its lowest mode.
fn downhill(
    scenario: &Scenario,
    program: &BeltProgram,
    saddle: &Stationary<BeltPoint>,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    const OFF: f64 = 0.01;
    let modes = solver::lowest_modes(program, &mut saddle.clone(), 1).unwrap_or_default();
    let falling = modes.into_iter().filter(|mode| mode.eigenvalue < 0.0);
    let sides = falling
        .flat_map(|mode| [OFF, -OFF].map(|off| solver::moved(program, &saddle.point, &mode, off)));
    sides
        .map(|side| minimum_from(scenario, &side, &mut || watch.proceed()))
        .collect()
}

fn is_twin(a: &Equilibrium, b: &Equilibrium) -> bool {
    /// Share of the energy by which twins may differ.
    const SAME: f64 = 1e-4;
    let poses = |e: &Equilibrium| Some(e.solved.as_ref()?.at.point.poses.clone());
    let is_level = (a.energy - b.energy).abs() <= SAME * a.energy.abs().max(b.energy.abs());
    let is_like = a.stability.map(|s| s.negative_modes) == b.stability.map(|s| s.negative_modes);
    let shapes = poses(a).zip(poses(b));
    is_level && is_like && shapes.is_some_and(|(a, b)| are_twins(&a, &b))
}

/// How far an equilibrium bulges as its scenario asks.
fn height(equilibrium: &Equilibrium) -> f64 {
    let bulge = Vector3::from(equilibrium.scenario.solver.bulge);
    equilibrium.highest_point().position.dot(&bulge.normalize())
}

/// Shapes from which to search: arches to both sides and the straight belt, with waves of bend and of rib slope over them.
fn starts(scenario: &Scenario) -> Vec<BeltPoint> {
    /// Amplitude of a wave of bend by half its number of half waves.
    const BEND: f64 = 4.0;
    const SLOPES: [f64; 2] = [0.4, 1.2];
    let program = program_of(scenario, scenario.elements());
    let bulge = Vector3::from(scenario.solver.bulge);
    let [up, down] = [bulge, -bulge].map(|bulge| guess(&program, &bulge));
    let flat = waved(&program, &up, 0.0, &|_| Vector2::zeros());
    let bends = (0..5).flat_map(|waves: i32| {
        let size = BEND * f64::from(waves.max(1));
        let signs: &[f64] = if waves == 0 { &[0.0] } else { &[1.0, -1.0] };
        signs
            .iter()
            .map(move |sign| (f64::from(waves), sign * size))
    });
    let bends: Vec<_> = bends.collect();
    let mut slopes = vec![(1.0, 0.0)];
    for slope in SLOPES {
        for waves in [1.0, 2.0, 3.0] {
            slopes.extend([(waves, slope), (waves, -slope)]);
        }
    }
    let mut starts = Vec::new();
    for (base, kept) in [(&up, 1.0), (&down, 1.0), (&flat, 0.0)] {
        for (bend_waves, bend) in &bends {
            for (slope_waves, slope) in &slopes {
                let wave = |u: f64| {
                    Vector2::new(
                        bend * (PI * bend_waves * u).cos(),
                        slope * (PI * slope_waves * u).sin(),
                    )
                };
                starts.push(waved(&program, base, kept, &wave));
            }
        }
    }
    starts
}
