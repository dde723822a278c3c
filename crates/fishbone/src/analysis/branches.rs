//! A search for all equilibria of a problem: many starts, then perturbations of each minimum and continuation in modal loads
//! from each equilibrium.
//!
//! The starts are arches to either side with waves of bend and of rib slope laid over them, and lead to minima. A minimum
//! perturbed along its lowest modes leads downhill to other minima. A load along one of the lowest modes of an equilibrium,
//! continued until it is zero again, leads to another equilibrium, of one negative mode more or less. From a saddle the energy
//! falls to both sides of its lowest mode.

mod settings;
mod starts;
mod thick;
mod trails;

pub use settings::{SearchSettings, Wave};

use crate::equilibrium::{
    Equilibrium, Status, minimum_from, minimum_next_to, near_minimum_from, of_solution,
};
use crate::problem::Problem;
use crate::problem::program::{BeltPoint, BeltProgram};
use crate::scenario::Method;
use nalgebra::Vector2;
use stagewise::Stationary;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};
use trails::{Passed, Trails};

/// A mode of the programme.
type Mode = stagewise::Mode<8>;

/// Runs `task(i)` for every i below a number, in any order and on any thread.
pub(crate) type Run<'a> = dyn Fn(usize, &(dyn Fn(usize) + Sync)) + 'a;

/// Control and progress of the search, from any thread.
pub trait Watch: Sync {
    /// Whether to go on.
    fn proceed(&self) -> ControlFlow<()>;

    /// Reports the number of tasks done, and of tasks planned by now.
    fn report(&self, done: usize, planned: usize);
}

/// The equilibria of a problem, rising in energy: minima, and saddles with one or two
/// negative modes.
///
/// Of mirror images the one that bulges along `solver.bulge` is reported. The same input gives the same output, however the
/// tasks are run. If nothing is found, the outcome of a solve is reported, whose message gives the reason.
pub fn branches(
    problem: &Problem,
    settings: &SearchSettings,
    run: &Run,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    if problem.is_of_shell() {
        return thick::branches_of_thick(problem, settings, run, watch);
    }
    let proceed = &mut || watch.proceed();
    let plain = crate::solve::solve(problem, proceed);
    let is_intrinsic = problem.scenario().solver.method == Method::Intrinsic;
    if plain.status == Status::Infeasible || !is_intrinsic {
        return vec![plain];
    }
    let on_mesh = |elements| problem.with_elements(elements).ok();
    let fine = on_mesh(problem.elements()).unwrap_or_else(|| problem.clone());
    let [rough, middle] = [settings.coarse_elements, settings.elements]
        .map(|most| on_mesh(most.min(problem.elements())).unwrap_or_else(|| fine.clone()));
    let mut census = Census {
        problem: &rough,
        settings,
        run,
        watch,
        found: Vec::new(),
        trails: Trails::default(),
        done: AtomicUsize::new(0),
        planned: 0,
    };
    census.enter(crate::solve::solve(&rough, proceed));
    census.start();
    census.start_from_sums();
    census.load();
    if census.promote(&middle) {
        // Some equilibria are there on this mesh only.
        census.start_from_sums();
    }
    census.perturb();
    census.promote(&fine);
    census.carry(problem);
    census.confirm(problem);
    census.face();
    census.refine(problem, &plain);
    let mut found = census.found;
    if found.is_empty() {
        return vec![plain];
    }
    found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
    found
}

/// The equilibria found so far.
struct Census<'a> {
    problem: &'a Problem,
    settings: &'a SearchSettings,
    run: &'a Run<'a>,
    watch: &'a dyn Watch,
    found: Vec<Equilibrium>,
    /// What the searches on the mesh of `problem` have passed.
    trails: Trails,
    done: AtomicUsize,
    planned: usize,
}

impl<'a> Census<'a> {
    /// Runs a task for each item; returns the results in the order of the items.
    fn each<T: Sync, R: Send + Sync>(
        &mut self,
        items: &[T],
        task: impl Fn(&T) -> R + Sync,
    ) -> Vec<R> {
        self.planned += items.len();
        self.each_planned(items, task)
    }

    /// As [`Self::each`], for items that are planned already.
    fn each_planned<T: Sync, R: Send + Sync>(
        &self,
        items: &[T],
        task: impl Fn(&T) -> R + Sync,
    ) -> Vec<R> {
        let (done, planned, watch) = (&self.done, self.planned, self.watch);
        let slots: Vec<OnceLock<R>> = items.iter().map(|_| OnceLock::new()).collect();
        (self.run)(items.len(), &|i| {
            let filled = slots[i].set(task(&items[i]));
            debug_assert!(filled.is_ok(), "every task runs once");
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            watch.report(done, planned);
        });
        slots.into_iter().filter_map(OnceLock::into_inner).collect()
    }

    /// Enters an equilibrium unless it is known or has too many negative modes; of mirror images the higher.
    fn enter(&mut self, equilibrium: Equilibrium) {
        if equilibrium.status == Status::Converged {
            self.enter_any(equilibrium);
        }
    }

    /// As [`Self::enter`], an equilibrium of its mesh, be it one of the belt or not; of the first mesh only if it is one, as
    /// the search goes on on a finer one.
    fn enter_any(&mut self, equilibrium: Equilibrium) {
        let settings = self.settings;
        let may_enter = match self.problem.elements() > settings.coarse_elements {
            true => equilibrium.is_of_its_mesh(),
            false => equilibrium.status == Status::Converged,
        };
        if !may_enter || index(&equilibrium) > settings.highest_index() {
            return;
        }
        let same = self
            .found
            .iter_mut()
            .find(|known| settings.is_same(known, &equilibrium));
        match same {
            None => self.found.push(equilibrium),
            Some(known) => {
                if settings.is_higher(&equilibrium, known) {
                    *known = equilibrium;
                }
            }
        }
    }

    /// The equilibria lowest in energy that `may` be chosen and are like none `known`; they are added to `known`.
    fn lowest_unlike(
        &self,
        known: &mut Vec<Equilibrium>,
        most: usize,
        may: impl Fn(&Equilibrium) -> bool,
    ) -> Vec<Equilibrium> {
        let mut found: Vec<_> = self.found.iter().filter(|e| may(e)).collect();
        found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
        let before = known.len();
        for equilibrium in found {
            let is_enough = known.len() == before + most;
            if !is_enough
                && !known
                    .iter()
                    .any(|known| self.settings.is_like(known, equilibrium))
            {
                known.push(equilibrium.clone());
            }
        }
        known[before..].to_vec()
    }

    /// Minimises from arches with waves over them.
    fn start(&mut self) {
        self.minimise(&starts::arches(self.problem, self.settings));
    }

    /// Minimises from sums of waves, and from more as long as they lead to anything unlike what is known.
    fn start_from_sums(&mut self) {
        let (problem, settings) = (self.problem, self.settings);
        let mut tried = 0;
        let mut is_fruitful = true;
        while is_fruitful && tried < settings.sums {
            let next = settings.sums.min(tried + settings.batch);
            let known = self.found.len();
            self.minimise(&starts::sums(problem, tried..next));
            let (known, new) = self.found.split_at(known);
            let is_like =
                |new: &Equilibrium| known.iter().any(|known| settings.is_like(known, new));
            let mut of_belt = new.iter().filter(|e| e.status == Status::Converged);
            is_fruitful = !of_belt.all(is_like);
            tried = next;
        }
    }

    /// Minimises from each of some starts.
    fn minimise(&mut self, starts: &[BeltPoint]) {
        let (problem, settings, watch) = (self.problem, self.settings, self.watch);
        self.planned += starts.len();
        for some in starts.chunks(settings.searches_at_a_time) {
            let trails = std::mem::take(&mut self.trails);
            let found = self.each_planned(some, |start| {
                new_minimum_from(problem, settings, start, &trails, watch)
            });
            self.trails = trails;
            for (way, equilibrium) in found {
                self.trails.extend(way);
                if let Some(equilibrium) = equilibrium {
                    self.enter_any(equilibrium);
                }
            }
        }
    }

    /// Perturbs the minima along their lowest modes, the lowest in energy first, and the minima found in this way in turn;
    /// of minima that are alike only one.
    fn perturb(&mut self) {
        let mut known = Vec::new();
        loop {
            let is_minimum = |e: &Equilibrium| e.stable() == Some(true);
            let most = self.settings.perturbed - known.len();
            let next = self.lowest_unlike(&mut known, most, is_minimum);
            if next.is_empty() {
                return;
            }
            let settings = self.settings;
            let starts = self.each(&next, |minimum| perturbed(settings, minimum));
            self.minimise(&starts.concat());
        }
    }

    /// Continues the equilibria in loads along their lowest modes, the lowest in energy first, and the equilibria found in
    /// this way in turn.
    fn load(&mut self) {
        let mut continued = Vec::new();
        loop {
            let settings = self.settings;
            let most = settings.at_a_time.min(settings.continued - continued.len());
            let next = self.lowest_unlike(&mut continued, most, |_| true);
            if next.is_empty() {
                return;
            }
            let modes = self.each(&next, |equilibrium| {
                let index = index(equilibrium).min(settings.highest_index());
                lowest_modes(equilibrium, settings.loaded_modes[index])
            });
            let tasks: Vec<_> = next
                .iter()
                .zip(&modes)
                .flat_map(|(equilibrium, modes)| {
                    let sided = modes.iter().flat_map(|mode| [(mode, true), (mode, false)]);
                    sided.map(move |(mode, forth)| (equilibrium, mode, forth))
                })
                .collect();
            let (problem, watch) = (self.problem, self.watch);
            let found = self.each(&tasks, |(equilibrium, mode, forth)| {
                beyond_modal_load(problem, settings, equilibrium, mode, *forth, watch)
            });
            for equilibrium in found.into_iter().flatten() {
                self.enter(equilibrium);
            }
        }
    }

    /// Goes on to the mesh of another problem, and replaces the equilibria by those to which they lead there; false where that
    /// is the same mesh.
    fn promote(&mut self, problem: &'a Problem) -> bool {
        if problem.elements() == self.problem.elements() {
            return false;
        }
        self.problem = problem;
        self.trails = Trails::default();
        let mut found = std::mem::take(&mut self.found);
        found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
        let (settings, watch) = (self.settings, self.watch);
        let led_to = self.each(&found, |found| {
            found.led_to(problem, &mut settings.budget(watch))
        });
        for equilibrium in led_to.into_iter().flatten() {
            self.enter_any(equilibrium);
        }
        true
    }

    /// Replaces the equilibria of this mesh alone, the lowest, by those to which they lead on meshes that follow the error,
    /// where the problem asks for that.
    fn carry(&mut self, asked: &Problem) {
        let found = std::mem::take(&mut self.found);
        let (of_belt, mut of_mesh): (Vec<_>, Vec<_>) = found
            .into_iter()
            .partition(|e| e.status == Status::Converged);
        self.found = of_belt;
        of_mesh.sort_by(|a, b| a.energy.total_cmp(&b.energy));
        of_mesh.truncate(self.settings.carried);
        let (settings, watch) = (self.settings, self.watch);
        let carried = self.each(&of_mesh, |found| {
            found.refined_for(asked, &mut settings.long_budget(watch))
        });
        for equilibrium in carried.into_iter().flatten() {
            self.enter(equilibrium);
        }
    }

    /// Keeps the equilibria that are confirmed on a mesh twice as fine; of equilibria that this mesh does not separate the
    /// lowest, unless they are refined further.
    fn confirm(&mut self, asked: &Problem) {
        let mut found = std::mem::take(&mut self.found);
        found.sort_by(|a, b| a.energy.total_cmp(&b.energy));
        let (settings, watch) = (self.settings, self.watch);
        let fine = self.each(&found, |found| {
            on_finer_mesh(settings, found, &mut settings.budget(watch))
        });
        let mut known: Vec<(Equilibrium, f64)> = Vec::new();
        for (found, fine) in found.into_iter().zip(fine) {
            let Some(fine) = fine else {
                continue;
            };
            let change = (fine.energy - found.energy).abs();
            let is_final = asked.has_fixed_mesh() || index(&found) > 0;
            let is_known = |(known, own): &(Equilibrium, f64)| {
                let is_level = (known.energy - fine.energy).abs() <= change.max(*own);
                settings.is_same(known, &fine)
                    || (is_final && is_level && settings.is_like(known, &fine))
            };
            if !known.iter().any(is_known) {
                known.push((fine, change));
                self.found.push(found);
            }
        }
    }

    /// Replaces the minima by those to which they lead on meshes that follow the error, where the problem asks for that; of
    /// equilibria that these meshes do not separate the lowest of those that meet the accuracy, else the lowest. The result of
    /// a plain solve is among the equilibria.
    fn refine(&mut self, asked: &Problem, plain: &Equilibrium) {
        let found = std::mem::take(&mut self.found);
        let (settings, watch) = (self.settings, self.watch);
        let mut refined = self.each(&found, |found| {
            let refined = found.refined_for(asked, &mut settings.long_budget(watch));
            refined.unwrap_or_else(|| found.clone())
        });
        let error = |e: &Equilibrium| e.error().map_or(f64::INFINITY, |error| error.energy);
        let is_accurate = |e: &Equilibrium| error(e) <= asked.accuracy();
        refined.sort_by(|a, b| {
            is_accurate(b)
                .cmp(&is_accurate(a))
                .then(a.energy.total_cmp(&b.energy))
        });
        self.enter(plain.clone());
        for equilibrium in refined {
            let proceed = &mut settings.budget(watch);
            let mut is_known = |known: &Equilibrium| {
                settings.is_unresolved(known, &equilibrium)
                    || is_same_on_its_mesh(settings, known, &equilibrium, proceed)
            };
            if !self.found.iter().any(&mut is_known) {
                self.enter(equilibrium);
            }
        }
    }

    /// Replaces a minimum by its mirror image if the image meets the supports too and bulges more along `solver.bulge`.
    fn face(&mut self) {
        let found = std::mem::take(&mut self.found);
        let (settings, watch) = (self.settings, self.watch);
        self.found = self.each(&found, |found| {
            facing(settings, found, &mut || watch.proceed()).unwrap_or_else(|| found.clone())
        });
    }
}

/// The mirror image that bulges most; `None` unless it bulges more than the minimum itself.
fn facing(
    settings: &SearchSettings,
    found: &Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    /// Mirrors, as signs of bend and of rib slope, dimensionless.
    const MIRRORS: [[f64; 2]; 3] = [[-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let solved = found.developable()?;
    let stable = found.stability.is_none_or(|s| s.negative_modes == 0);
    let mirrored = MIRRORS
        .into_iter()
        .filter(|_| stable)
        .filter_map(|[bend, slope]| {
            let mut point = solved.at.point.clone();
            for fields in &mut point.fields {
                *fields = Vector2::new(bend * fields[0], slope * fields[1]);
            }
            solved.program.settle(&mut point);
            let meets = solved.program.miss_of_supports(&point) < settings.miss;
            meets.then_some(point)
        });
    let images = mirrored.filter_map(|point| {
        let image = minimum_next_to(&found.problem, &point, proceed);
        (image.status == Status::Converged && settings.is_same(found, &image)).then_some(image)
    });
    let highest = images.max_by(|a, b| height(a).total_cmp(&height(b)))?;
    settings.is_higher(&highest, found).then_some(highest)
}

/// The same equilibrium on a mesh twice as fine; `None` if it is unconfirmed on refinement.
fn on_finer_mesh(
    settings: &SearchSettings,
    found: &Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> Option<Equilibrium> {
    let elements = found.developable()?.program.elements().count();
    let fine = found.refined(settings.refinement * elements, proceed)?;
    let change = (fine.energy - found.energy).abs();
    let is_level = change <= settings.like_level * settings.size(found);
    (is_level && found.displacement(&fine) <= settings.like_distance).then_some(fine)
}

/// Whether a minimum that is like a known one leads to it on its mesh. With a density that does not know the width
/// it may, and be another one: such minima lie at the elements of their meshes.
fn is_same_on_its_mesh(
    settings: &SearchSettings,
    known: &Equilibrium,
    other: &Equilibrium,
    proceed: &mut dyn FnMut() -> ControlFlow<()>,
) -> bool {
    let solved = known.developable();
    let knows_width = solved.is_some_and(|solved| solved.program.model.knows_width());
    let are_minima = index(known) == 0 && index(other) == 0;
    if !knows_width || !are_minima || !settings.is_like(known, other) {
        return false;
    }
    let led_to = other.on_mesh_of(known, proceed);
    led_to.is_some_and(|led_to| settings.is_same(known, &led_to))
}

/// The lowest modes of an equilibrium beside its symmetries, which lead to no other shape.
fn lowest_modes(equilibrium: &Equilibrium, count: usize) -> Vec<Mode> {
    let Some(solved) = equilibrium.developable().filter(|_| count > 0) else {
        return Vec::new();
    };
    let symmetries = solved.inertia.map_or(0, |inertia| inertia.symmetries);
    let all = count + symmetries;
    let modes = stagewise::lowest_modes(&solved.program, &mut solved.at.clone(), all);
    let mut modes = modes.unwrap_or_default();
    modes.retain(|mode| mode.eigenvalue != 0.0);
    modes.truncate(count);
    modes
}

/// What a search for a minimum has passed, and the minimum; none where the search came to the way of an earlier one.
fn new_minimum_from(
    problem: &Problem,
    settings: &SearchSettings,
    start: &BeltPoint,
    trails: &Trails,
    watch: &dyn Watch,
) -> (Vec<Passed>, Option<Equilibrium>) {
    let mut way = Vec::new();
    let pass = &mut |barrier: f64, shape: &BeltPoint| {
        if barrier > settings.highest_barrier {
            return ControlFlow::Continue(());
        }
        if trails.lead_past(barrier, shape) {
            return ControlFlow::Break(());
        }
        let shape = shape.clone();
        way.push(Passed { barrier, shape });
        ControlFlow::Continue(())
    };
    let proceed = &mut settings.budget(watch);
    let near = near_minimum_from(problem, start, pass, proceed);
    let minimum = near.map(|near| minimum_next_to(problem, &near, proceed));
    (way, minimum)
}

/// Shapes of a minimum displaced far along its lowest modes.
fn perturbed(settings: &SearchSettings, minimum: &Equilibrium) -> Vec<BeltPoint> {
    let Some(solved) = minimum.developable() else {
        return Vec::new();
    };
    let modes = lowest_modes(minimum, settings.perturbed_modes);
    let displaced = modes.iter().flat_map(|mode| {
        let far = settings.perturbations.iter();
        far.map(move |far| stagewise::moved(&solved.program, &solved.at.point, mode, *far))
    });
    displaced.collect()
}

/// The equilibrium to which a modal load leads and, if it is a saddle, the minima downhill on either side.
fn beyond_modal_load(
    problem: &Problem,
    settings: &SearchSettings,
    from: &Equilibrium,
    mode: &Mode,
    forth: bool,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    let Some(solved) = from.developable() else {
        return Vec::new();
    };
    let program = &solved.program;
    let tolerance = problem.tolerance();
    let proceed = &mut |_| watch.proceed();
    let other = stagewise::over_modal_load(program, tolerance, &solved.at, mode, forth, proceed);
    let Some(other) = other else {
        return Vec::new();
    };
    let mut found = downhill(problem, settings, program, &other, watch);
    if problem.active_set_fault(program, &other.point).is_none() {
        let solution = stagewise::assess(program, tolerance, &other);
        found.push(of_solution(problem, program.clone(), solution));
    }
    found
}

/// The minima downhill from a saddle, to either side along its lowest mode.
fn downhill(
    problem: &Problem,
    settings: &SearchSettings,
    program: &BeltProgram,
    saddle: &Stationary<BeltPoint>,
    watch: &dyn Watch,
) -> Vec<Equilibrium> {
    let off = settings.off_saddle;
    let modes = stagewise::lowest_modes(program, &mut saddle.clone(), 1).unwrap_or_default();
    let falling = modes.into_iter().filter(|mode| mode.eigenvalue < 0.0);
    let sides = falling.flat_map(|mode| {
        [off, -off].map(|off| stagewise::moved(program, &saddle.point, &mode, off))
    });
    sides
        .map(|side| minimum_from(problem, &side, &mut settings.budget(watch)))
        .collect()
}

/// Number of negative modes, 0 where it is undecided.
fn index(equilibrium: &Equilibrium) -> usize {
    equilibrium.stability.map_or(0, |s| s.negative_modes)
}

/// Bulge of an equilibrium along its scenario's `solver.bulge`.
fn height(equilibrium: &Equilibrium) -> f64 {
    let bulge = equilibrium.problem.bulge();
    equilibrium.highest_point().position.dot(&bulge.normalize())
}
