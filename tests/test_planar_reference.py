"""The planar reference against independent ones: closed forms, SciPy's boundary value solver, differences."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import solve_bvp
from scipy.optimize import brentq

import planar
from folds import FOLDS, Expected, turned
from helpers import Array, Elastica
from planar import ALONG_X, ALONG_Y, TURN, Branch, Planar, Shot

DISTANCES = (0.6, 0.8, 0.9)
FOLD_ERROR = 1e-8
SAME = 1e-10


each_fold = pytest.mark.parametrize("expected", FOLDS, ids=lambda expected: expected.name)
each_distance = pytest.mark.parametrize("distance", DISTANCES)


# ---------------------------------------------------------------------------------------------- equilibria


@pytest.mark.parametrize("distance", [0.4, 0.6, 0.8, 0.9, 0.99])
def test_arch_is_the_elastica_in_closed_form(distance: float) -> None:
    """The clamp at the end pushes with (0, −P) and turns with −2kλ about z."""
    arch, elastica = planar.buckled(distance), Elastica(distance)
    u = np.linspace(0.0, 1.0, 21)
    assert arch.energy == pytest.approx(elastica.energy, rel=SAME)
    assert arch.reaction == pytest.approx([0.0, -elastica.thrust, elastica.end_moment], abs=SAME * elastica.thrust)
    assert arch.height == pytest.approx(elastica.height, rel=SAME)
    assert np.max(np.abs(arch.position(u) - elastica.position(u)[:, :2])) < SAME
    assert np.max(np.abs(arch.bend(u) - elastica.bend(u))) < 1e-8


@each_distance
def test_arch_pushed_aside_is_the_elastica_along_its_chord(distance: float) -> None:
    """With both tangents along y a whole period of the pendulum lies between the clamps, whatever its phase.

    So energy and force are those of the arch between clamps in line as far apart, the force along the chord.
    """
    arch = planar.buckled(distance)
    for aside in (-0.2, 0.1, 0.3):
        found = planar.at_parameter(arch, math.copysign(1.0, aside) * ALONG_X, abs(aside))
        elastica = Elastica(math.hypot(aside, distance))
        assert found.energy == pytest.approx(elastica.energy, rel=SAME)
        chord = np.array([aside, distance]) / elastica.distance
        assert found.force == pytest.approx(-elastica.thrust * chord, abs=SAME * elastica.thrust)
        assert found.negative_modes == 0


SHAPES = {
    "arch": (0.6, 1, 0.0),
    "arch turned back": (0.6, 1, -0.8),
    "arch turned on": (0.8, 1, 2.0),
    "S": (0.8, 2, 0.0),
    "S turned": (0.6, 2, 0.7),
}
each_shape = pytest.mark.parametrize("name", SHAPES)


@each_shape
def test_reaction_is_the_gradient_of_the_energy(name: str) -> None:
    """By differences of fourth order over 1e-3, of minima and saddles alike."""
    state, step = turned(*SHAPES[name]), 1e-3
    for i, direction in enumerate((ALONG_X, ALONG_Y, TURN)):
        near, no_change = {}, np.zeros(planar.MODES + 2)
        for k in (-2, -1, 1, 2):
            near[k] = planar.converge(state.moved(direction, k * step, no_change)).energy
        gradient = (8.0 * (near[1] - near[-1]) - (near[2] - near[-2])) / (12.0 * step)
        assert gradient == pytest.approx(state.reaction[i], abs=1e-7 * float(np.linalg.norm(state.reaction)))


@each_shape
def test_differential_equation_has_the_same_solution(name: str) -> None:
    """Shot from the start with the bend and force of the stationary point of the energy, it ends where that does."""
    state = turned(*SHAPES[name])
    shot = planar.shot_of(state)
    assert shot.pose == pytest.approx(state.pose, abs=1e-9)
    assert shot.energy == pytest.approx(state.energy, rel=1e-9)
    u = np.linspace(0.0, 1.0, 11)
    assert np.max(np.abs(shot.path.sol(u)[:2].T - state.position(u))) < 1e-9


def test_jacobi_fields_are_the_derivatives_of_the_end_pose() -> None:
    shot = planar.shot_of(turned(0.6, 1, -0.8))
    for i, step in enumerate((1e-4, 1e-3, 1e-3)):
        change = step * np.eye(3)[i]
        difference = Shot(shot.unknowns + change).pose - Shot(shot.unknowns - change).pose
        assert difference / (2.0 * step) == pytest.approx(shot.jacobian[:, i], abs=1e-6)


@each_shape
def test_derivatives_along_a_branch_are_those_of_differences(name: str) -> None:
    """Of the residual, and of the matrix times a vector, by coefficients, force and pose."""
    state, step = turned(*SHAPES[name]), 1e-5
    random = np.random.default_rng(0)
    decay = np.append(1.0 / np.arange(1.0, planar.MODES + 1.0) ** 2, [10.0, 10.0])
    null, change, direction = random.normal(size=decay.size) * decay, random.normal(size=decay.size) * decay, TURN
    ahead, behind = (state.moved(direction, h, h * change) for h in (step, -step))
    first = (ahead.residual - behind.residual) / (2.0 * step)
    assert first == pytest.approx(state.matrix @ change + state.by_pose(direction), abs=1e-5)
    second = (ahead.matrix @ null - behind.matrix @ null) / (2.0 * step)
    by_state, by_end = state.change_of_matrix(null, direction)
    assert second == pytest.approx(by_state @ change + by_end, abs=1e-4)


# ----------------------------------------------------------------------------------------------- stability


@each_shape
def test_conjugate_points_are_as_many_as_negative_modes(name: str) -> None:
    state = turned(*SHAPES[name])
    assert len(planar.shot_of(state).conjugate_points) == state.negative_modes


@each_distance
def test_arch_is_stable_in_its_plane_and_the_s_is_not(distance: float) -> None:
    assert planar.buckled(distance).negative_modes == 0
    assert planar.buckled(distance, mode=2).negative_modes == 1


@each_fold
def test_conjugate_point_comes_in_or_leaves_by_the_end_at_a_fold(expected: Expected) -> None:
    found = [len(planar.shot_of(state).conjugate_points) for state in (expected.fold.before, expected.fold.after)]
    assert tuple(found) == expected.modes


# --------------------------------------------------------------------------------------------------- folds


@each_fold
def test_fold_is_where_it_was_found(expected: Expected) -> None:
    """Parameter, energy, bend at the start, height, and the negative modes on both sides."""
    fold = expected.fold
    assert fold.pose[expected.component] == pytest.approx(expected.parameter, abs=FOLD_ERROR)
    assert fold.state.energy == pytest.approx(expected.energy, rel=1e-8)
    assert fold.state.bend(0.0)[0] == pytest.approx(expected.bend, rel=1e-7)
    assert fold.state.height == pytest.approx(expected.height, abs=FOLD_ERROR)
    assert (fold.before.negative_modes, fold.after.negative_modes) == expected.modes


@each_fold
def test_fold_is_where_the_jacobian_of_the_shots_is_singular(expected: Expected) -> None:
    """From values rounded to two digits, so that the two discretisations are independent."""
    state = expected.fold.state
    near = np.asarray(np.round(np.append(state.bend(0.0), state.force), 2), dtype=np.float64)
    base = expected.start.pose * (np.array(expected.direction) == 0.0)
    along = np.abs(expected.along)
    shot, parameter = planar.fold_of_shots(near, base, along, round(expected.parameter, 2))
    assert parameter == pytest.approx(expected.parameter, abs=FOLD_ERROR)
    assert shot.energy == pytest.approx(expected.energy, rel=1e-7)


@pytest.mark.parametrize("expected", FOLDS[::3], ids=lambda expected: expected.name)
def test_fold_is_where_scipy_finds_a_jacobi_field_that_is_zero_at_both_ends(expected: Expected) -> None:
    """ϑ, ϑ', x, y with a field η, η', ξ, υ of unit slope at the start; X, Y, their changes and λ unknown."""
    state, null = expected.fold.state, expected.fold.null
    moving = np.abs(expected.along)
    end = state.pose * (moving == 0.0)

    def rate(_: Array, at: Array, p: Array) -> Array:
        sine, cosine = np.sin(at[0]), np.cos(at[0])
        bending = (p[1] * cosine - p[0] * sine) * at[4] + p[2] * cosine + p[3] * sine
        field = [at[5], bending, -cosine * at[4], -sine * at[4]]
        return np.vstack([at[1], p[0] * cosine + p[1] * sine, -sine, cosine, *field])

    def conditions(a: Array, b: Array, p: Array) -> Array:
        pose = np.array([b[2], b[3], b[0]]) - end - p[4] * moving
        return np.concatenate([[a[0], a[2], a[3]], pose, [a[4], a[5] - 1.0, a[6], a[7], b[4], b[6], b[7]]])

    u = np.linspace(0.0, 1.0, 201)
    slope = float((planar.basis_rate(np.zeros(1)) @ null[:-2])[0])
    along = planar.basis(u) @ null[:-2] / slope
    rising = planar.basis_rate(u) @ null[:-2] / slope
    angle, position = state.angle(u), state.position(u)
    guess = np.vstack([angle, state.bend(u), position.T, along, rising, np.zeros((2, u.size))])
    unknowns = np.concatenate([state.force, null[-2:] / slope, [expected.parameter]])
    found = solve_bvp(rate, conditions, u, 1.002 * guess, p=0.998 * unknowns, tol=1e-8, max_nodes=20_000)
    assert found.success, found.message
    assert found.p is not None
    assert found.p[4] == pytest.approx(expected.parameter, abs=FOLD_ERROR)


@each_fold
def test_fold_is_the_turning_point_of_the_branch(expected: Expected) -> None:
    """The top of a polynomial through points followed with a short step, without the extended system."""
    before, step = expected.fold.before, 0.02
    towards = math.copysign(1.0, float((expected.fold.pose - before.pose) @ expected.along)) * expected.along
    back = Branch(before, -towards, step=step, longest=step).points()
    start, _ = next(itertools.islice(back, 6, None))
    points = Branch(start, towards, step=step, longest=step).points()
    values: list[float] = []
    turn: int | None = None
    while turn is None or len(values) < turn + 5:
        state, tangent = next(points)
        turn = len(values) if turn is None and tangent[-1] < 0.0 else turn
        values.append(float(state.pose[expected.component]))
    near = np.array(values[turn - 5 : turn + 5])
    fit = np.polynomial.Polynomial.fit(np.arange(-5.0, 5.0), near, 7)
    tops = np.asarray(fit.deriv().roots(), dtype=np.complex128)
    top = float(tops[np.argmin(np.abs(tops + 0.5))].real)
    assert float(fit(top)) == pytest.approx(expected.parameter, abs=FOLD_ERROR)


@each_distance
def test_arch_whose_end_is_turned_on_has_no_fold_within_half_a_turn(distance: float) -> None:
    """It opens, is least bent on the way, and goes over into a loop."""
    assert list(planar.folds(planar.buckled(distance), TURN)) == []


def test_shape_of_more_waves_than_there_are_modes_is_refused() -> None:
    """A loop in a belt that is nearly straight."""
    with pytest.raises(planar.NoEquilibriumError, match="too few"):
        list(planar.folds(planar.buckled(0.9), TURN, turns=1.0))


@pytest.mark.parametrize("side", [1.0, -1.0])
@each_distance
def test_arch_turned_on_has_no_fold_when_pushed_aside(distance: float, side: float) -> None:
    """It is drawn out straight, stable on the way."""
    assert list(planar.folds(turned(distance, 1, 0.5), side * ALONG_X)) == []


def test_equilibrium_beyond_a_fold_is_refused() -> None:
    with pytest.raises(planar.NoEquilibriumError, match="turns back before"):
        turned(0.8, 1, -1.0)


# ------------------------------------------------------------------------------------------------ pitchforks


@each_distance
def test_arches_meet_the_s_where_neither_end_is_bent(distance: float) -> None:
    """In closed form: from one greatest angle γ to the chord to the next, a period of the pendulum with k = sin(γ/2).

    Then ϑ' is itself a Jacobi field that is 0 at both ends. The chord is r = 2E/K − 1 long, as of the arch with that
    k, and its end is at (r sin γ, r cos γ).
    """

    def along_y(r: float) -> float:
        return r * math.cos(2.0 * math.asin(Elastica(r).k)) - distance

    r = float(brentq(along_y, distance, 0.9999, xtol=1e-15))
    elastica = Elastica(r)
    found = planar.pitchfork(distance)
    assert found.pose[0] == pytest.approx(r * math.sin(2.0 * math.asin(elastica.k)), abs=FOLD_ERROR)
    assert found.bend([0.0, 1.0]) == pytest.approx([0.0, 0.0], abs=1e-4)
    assert found.energy == pytest.approx(elastica.energy, rel=1e-8)


@each_distance
def test_arch_pushed_aside_has_no_fold_but_goes_over_into_the_s(distance: float) -> None:
    """It turns back at the pitchfork, as its own image; short of it, it is there."""
    arch, aside = planar.buckled(distance), float(planar.pitchfork(distance).pose[0])
    assert list(planar.folds(arch, ALONG_X)) == []
    assert planar.at_parameter(arch, ALONG_X, 0.999 * aside).negative_modes == 0
    with pytest.raises(planar.NoEquilibriumError, match="turns back before"):
        planar.at_parameter(arch, ALONG_X, 1.001 * aside)
    beyond = planar.at_parameter(planar.buckled(distance, mode=2).mirrored(), ALONG_X, 1.001 * aside)
    assert beyond.negative_modes == 0


# --------------------------------------------------------------------------------------------- Euler's loads


def test_euler_loads_are_those_of_the_transcendental_equation() -> None:
    assert planar.euler_load(1) == pytest.approx(4.0 * math.pi**2, rel=1e-15)
    assert planar.euler_load(2) == pytest.approx(80.7629, abs=1e-4)
    for mode in (2, 4, 6):
        half = 0.5 * math.sqrt(planar.euler_load(mode))
        assert math.sin(half) == pytest.approx(half * math.cos(half), abs=1e-11)


@pytest.mark.parametrize("mode", [1, 2, 3, 4])
def test_straight_strut_loses_its_stability_at_euler_loads(mode: int) -> None:
    """Held across and free along y, whose constraint is left out: the energy with the thrust P has n negative modes."""
    for side, count in ((-1.0, mode - 1), (1.0, mode)):
        thrust = planar.euler_load(mode) * (1.0 + side * 1e-9)
        strut = Planar(ALONG_Y, np.zeros(planar.MODES), np.array([0.0, -thrust]))
        assert np.max(np.abs(strut.residual)) < 1e-12
        assert int(np.sum(np.linalg.eigvalsh(strut.matrix[:-1, :-1]) < 0.0)) - 1 == count


@pytest.mark.parametrize("mode", [1, 2])
def test_buckled_strut_tends_to_its_euler_load(mode: int) -> None:
    """P = P₀ (1 + O(slack)): twice the value at half the slack, less that at the whole."""
    thrusts = [-float(planar.buckled(1.0 - slack, mode).force[1]) for slack in (2e-3, 4e-3)]
    assert 2.0 * thrusts[0] - thrusts[1] == pytest.approx(planar.euler_load(mode), rel=1e-4)
