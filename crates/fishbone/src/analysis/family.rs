//! The programmes of the problems along a path, for the solver to continue a solution along.

use crate::analysis::path::Path;
use crate::analysis::sensitivity::add_support_motion;
use crate::equilibrium::Solved;
use crate::equilibrium::model::StripModel;
use crate::problem::program::{BeltPoint, BeltProgram, rows_of};
use crate::problem::{Mesh, Problem};
use crate::strip::developable::DevelopableEnergy;
use stagewise::{Continuation, Direction, Family, Pace, Program, Stationary, by_differences};
use std::marker::PhantomData;
use std::ops::ControlFlow;

/// A station of a branch.
pub(super) type Station<const F: usize = 2, const N: usize = 8> =
    stagewise::Station<BeltPoint<F>, N>;

/// The programmes of the problems along a path, all on the same mesh.
#[derive(Debug, Clone)]
pub(super) struct Along<D = DevelopableEnergy, const F: usize = 2, const N: usize = 8> {
    pub(super) path: Path,
    pub(super) mesh: Mesh,
    model: PhantomData<D>,
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Along<D, F, N> {
    /// The programmes of a path on a mesh.
    pub(super) fn new(path: Path, mesh: Mesh) -> Self {
        Self {
            path,
            mesh,
            model: PhantomData,
        }
    }

    /// The problem at a place, with its programme.
    pub(super) fn meshed(&self, place: f64) -> Option<(Problem, BeltProgram<D, F, N>)> {
        let problem = self.path.at(place)?;
        let program = D::program_on(&problem, &self.mesh)?;
        Some((problem, program))
    }

    /// The same path on another mesh.
    pub(super) fn on(&self, mesh: Mesh) -> Self {
        Self::new(self.path.clone(), mesh)
    }

    /// The programmes along the leg of the path on which a station lies, and the places of the ends of this leg; where two
    /// legs meet, it is the leg ahead.
    pub(super) fn leg(&self, station: &Station<F, N>) -> (Self, [f64; 2]) {
        let (path, ends) = self.path.leg(station.parameter, station.is_rising());
        (Self::new(path, self.mesh.clone()), ends)
    }

    /// A continuation over the whole path.
    pub(super) fn continuation(&self, pace: Pace) -> Continuation<'_, Self, 6, F, N> {
        self.continuation_between([0.0, self.path.length()], pace)
    }

    /// A continuation over a part of the path.
    pub(super) fn continuation_between(
        &self,
        ends: [f64; 2],
        pace: Pace,
    ) -> Continuation<'_, Self, 6, F, N> {
        let tolerance = self.path.base().tolerance();
        Continuation::new(self, tolerance, ends, pace)
    }

    /// The start of the same branch on another mesh, next to a station of this family, with the path on that mesh: by Newton's
    /// method, or of a minimum by a search next to it.
    pub(super) fn on_mesh(
        &self,
        mesh: Mesh,
        station: &Station<F, N>,
        pace: Pace,
    ) -> Option<(Self, Station<F, N>)> {
        let place = station.parameter;
        let other = self.on(mesh);
        let shape = self.shape_on(station, &other)?;
        let other = other.with_active_sets_for(place, &shape)?;
        if let Some(start) = self.carried_over(station, &other, pace) {
            return Some((other, start));
        }
        let is_minimum = station.negative == 0;
        let problem = self.path.at(place).filter(|_| is_minimum)?;
        let proceed = &mut || ControlFlow::Continue(());
        let found = D::minimum_next_to(&problem, &other.mesh, &shape, proceed);
        let solved: &Solved<D, F, N> = found.certified().ok()?;
        let other = self.on(Mesh::of(&problem, &solved.program));
        let start = other
            .continuation(pace)
            .start(&solved.at, place, station.is_rising())?;
        Some((other, start))
    }

    /// Whether the mesh carries a station.
    pub(super) fn carries(&self, station: &Station<F, N>) -> bool {
        self.meshed(station.parameter)
            .is_some_and(|(problem, program)| {
                D::carries(&problem, &program, &station.at, station.objective)
            })
    }

    /// The same branch on a mesh that should carry a station beyond, next to another station of this family.
    pub(super) fn on_mesh_that_carries(
        &self,
        beyond: &Station<F, N>,
        station: &Station<F, N>,
        pace: Pace,
    ) -> Option<(Self, Station<F, N>)> {
        let (problem, program) = self.meshed(beyond.parameter)?;
        let mesh = D::mesh_that_carries(&problem, &program, &beyond.at)?;
        self.on_mesh(mesh, station, pace)
    }

    /// The shape of a station on another mesh.
    pub(super) fn shape_on(&self, station: &Station<F, N>, to: &Self) -> Option<BeltPoint<F>> {
        let [own, other] = [self, to].map(|family| family.at(station.parameter));
        Some(D::prolonged(&own?, &station.at.point, &other?))
    }

    /// A station's point with its multipliers on another mesh, or with other active edges.
    fn with_multipliers_on(
        &self,
        station: &Station<F, N>,
        to: &Self,
    ) -> Option<Stationary<BeltPoint<F>>> {
        let [own, other] = [self, to].map(|family| family.at(station.parameter));
        Some(D::prolonged_with_multipliers(&own?, &station.at, &other?))
    }

    /// The start of a branch on another mesh, or with other active edges, next to a station of this family.
    pub(super) fn carried_over(
        &self,
        station: &Station<F, N>,
        to: &Self,
        pace: Pace,
    ) -> Option<Station<F, N>> {
        let place = station.parameter;
        let near = self.with_multipliers_on(station, to)?;
        to.continuation(pace)
            .start_near(&near, place, station.is_rising())
    }

    /// The same path with the active edges for a shape at a place.
    pub(super) fn with_active_sets_for(&self, place: f64, shape: &BeltPoint<F>) -> Option<Self> {
        let (problem, mut program) = self.meshed(place)?;
        if D::has_active_sets(&problem, &program) {
            D::choose_active_sets(&problem, &mut program, shape);
        }
        Some(self.on(Mesh::of(&problem, &program)))
    }

    /// Whether the active sets of the programmes are right for a station.
    pub(super) fn holds(&self, station: &Station<F, N>) -> bool {
        self.meshed(station.parameter)
            .is_some_and(|(problem, program)| {
                let shape = D::shape(&problem, &program, &station.at.point);
                let fault = shape.and_then(|shape| D::active_set_fault(&program, &shape));
                fault.is_none()
            })
    }

    /// Whether the supports are out of the belt's reach next to a place, so that the belt is near its inextensible limit.
    pub(super) fn is_near_limit(&self, place: f64) -> bool {
        /// Distance along the path to the places on either side that are examined, in legs.
        const BESIDE: f64 = 2e-3;
        let beside = [place - BESIDE, place + BESIDE].map(|place| self.path.at(place));
        let mut known = beside.iter().flatten();
        known.any(|problem| problem.unreachable_supports().is_some())
    }
}

impl<D: StripModel<F, N>, const F: usize, const N: usize> Family<6, F, N> for Along<D, F, N> {
    type Point = BeltPoint<F>;
    type Program = BeltProgram<D, F, N>;

    fn at(&self, place: f64) -> Option<BeltProgram<D, F, N>> {
        D::program_on(&self.path.at(place)?, &self.mesh)
    }

    /// The derivative is exact where a support moves; other changes of a scenario may change any part of the programme.
    fn conditions_by_parameter(
        &self,
        program: &BeltProgram<D, F, N>,
        at: &Stationary<BeltPoint<F>>,
        place: f64,
    ) -> Option<Direction<N>> {
        let Some((support, motion)) = self.path.support_motion(place) else {
            return by_differences(self, at, place);
        };
        let mut conditions = Direction::zeros(&program.layout());
        let rows = rows_of(&at.multipliers.equalities, support);
        let held = &program.supports[support];
        let pose = &at.point.poses[held.node];
        let turn = held.turn(pose, &rows);
        add_support_motion(held, &turn, pose, support, &motion, &mut conditions);
        Some(conditions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::path::Motion;
    use crate::scenario::{BeltSpec, Component, Place, Scenario, SegmentSpec, SupportSpec};
    use crate::solve::solve;
    use nalgebra::Vector3;
    use stagewise::Response;
    use std::ops::ControlFlow;

    type Vector8 = stagewise::NodeVector<8>;

    /// A belt of length 2 with an arc, twisted and moved aside.
    fn problem() -> Problem {
        let arc = SegmentSpec::Arc {
            length: 0.5,
            curvature: 0.7,
            rigidity: None,
            natural_bend: None,
        };
        let segments = vec![SegmentSpec::straight(1.5), arc];
        let mut scenario = Scenario::new(BeltSpec::new(0.1, 2.0, segments));
        let clamp = |at, position: [f64; 3], rotation| SupportSpec {
            position: Some(position.map(Component::Held)),
            rotation: Some(rotation),
            ..SupportSpec::new(at)
        };
        scenario.supports = vec![
            clamp(Place::Start, [0.1, 0.2, -0.3], [0.0, 0.3, 0.1]),
            clamp(Place::End, [0.3, 1.2, 0.4], [0.2, -0.7, 0.5]),
        ];
        scenario.solver.elements = Some(48);
        Problem::new(scenario).unwrap()
    }

    #[test]
    fn test_a_leg_goes_on_beyond_its_ends_without_an_angle() {
        let problem = problem();
        let poses = [
            (Vector3::new(0.2, 1.1, 0.1), Vector3::new(0.5, -0.2, 1.1)),
            (Vector3::new(0.4, 1.0, 0.3), Vector3::new(-0.4, 0.6, 0.3)),
        ];
        let path = Path::poses(&problem, 1, &poses, Motion::Straight).unwrap();
        let meets = [0.0, 0.5, 1.0, 1.5, 2.0].map(|place| path.is_between_legs(place));
        assert_eq!(meets, [false, false, true, false, false]);
        let end = |path: &Path, place| path.at(place).unwrap().clamp(1).unwrap().position;
        for (rising, ends) in [(true, [1.0, 2.0]), (false, [0.0, 1.0])] {
            let (leg, found) = path.leg(1.0, rising);
            assert_eq!(found, ends);
            let [before, pose, after] = [0.8, 1.0, 1.2].map(|place| end(&leg, place));
            assert!((before + after - 2.0 * pose).norm() < 1e-12);
            assert!((pose - end(&path, 1.0)).norm() < 1e-12);
            let own = if rising { 1.2 } else { 0.8 };
            assert!((end(&leg, own) - end(&path, own)).norm() < 1e-12);
        }
    }

    #[test]
    fn test_derivative_by_a_support_s_motion_agrees_with_differences() {
        let problem = problem();
        let equilibrium = solve(&problem, &mut || ControlFlow::Continue(()));
        let solved: &Solved = equilibrium.certified().unwrap();
        let poses = [
            (Vector3::new(0.2, 1.1, 0.1), Vector3::new(0.5, -0.2, 1.1)),
            (Vector3::new(0.4, 1.0, 0.3), Vector3::new(-0.4, 0.6, 0.3)),
        ];
        for motion in [Motion::Straight, Motion::Screw] {
            let path = Path::poses(&problem, 1, &poses, motion).unwrap();
            let family =
                Along::<DevelopableEnergy, 2, 8>::new(path, Mesh::of(&problem, &solved.program));
            for place in [0.2, 0.7, 1.4] {
                let program = family.at(place).unwrap();
                let mut at = solved.at.clone();
                let mut response = Response::of_stationary(&program, &mut at).unwrap();
                let exact = family.conditions_by_parameter(&program, &at, place);
                let nearly = by_differences(&family, &at, place);
                let [exact, nearly] =
                    [exact, nearly].map(|by| response.solve(&by.unwrap()).unwrap());
                let mut error = exact.clone();
                error.add(-1.0, &nearly);
                let most = |nodes: &[Vector8]| nodes.iter().map(|n| n.amax()).fold(0.0, f64::max);
                assert!(
                    most(&error.nodes) < 1e-6 * most(&exact.nodes),
                    "{motion:?} {place}"
                );
                let rows = exact.equalities.iter().zip(&error.equalities);
                for (row, error) in rows {
                    assert!(
                        error.abs() < 1e-6 * row.abs().max(1.0),
                        "{motion:?} {place}"
                    );
                }
            }
        }
    }
}
