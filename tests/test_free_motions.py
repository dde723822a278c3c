"""Motions that change nothing are zero modes, and the other modes are those of beams and rings that move freely.

Eigenvalues are squared natural frequencies of a board of total mass 1. Expected values are closed forms: of the free
beam, and of the ring in its plane, n² (n² − 1)²/(n² + 1) R_f/(m R⁴) with the mass m per length (R. Hoppe, 1871).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import fishbone as fb
from helpers import ENERGIES, ORIGIN, Energy, Json, belt, board, rigid, solve, straight, support

FREE_FREE = 4.730040744862704
"""First root of cos k cosh k = 1."""
MOBIUS = 1
"""Half turns of a Möbius band."""


def hoppe(n: int) -> float:
    """In-plane eigenvalue of a ring of length 1, rigidity 1 and mass 1."""
    return (2.0 * math.pi) ** 4 * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)


def closed(half_turns: int, supports: list[Json] | None = None, segments: Any = None, **options: Any) -> Json:
    """A closed band of length 1."""
    scenario = board(segments or [straight(1.0)], supports or [], **options)
    scenario["belt"] |= {"closed": True, "half_turns": half_turns}
    return scenario


def point(at: float | str, *coordinates: float | str, **fields: Any) -> Json:
    """A support of a point by its coordinates, each held or "free"."""
    return {"at": at, "position": list(coordinates), **fields}


def pinned(**fields: Any) -> list[Json]:
    """A pin at either end, nearer to each other than the belt is long."""
    return [point("start", 0.0, 0.0, 0.0, **fields), point("end", 0.0, 0.7, 0.0, **fields)]


def counts(equilibrium: fb.Equilibrium) -> tuple[bool | None, int | None, int | None]:
    return equilibrium.stable, equilibrium.negative_modes, equilibrium.zero_modes


def in_plane(equilibrium: fb.Equilibrium, count: int) -> list[float]:
    """Eigenvalues of the modes without displacement along z, of eigenvalue above zero."""
    modes = [mode for mode in equilibrium.modes(count) if mode.eigenvalue > 1.0]
    return [mode.eigenvalue for mode in modes if np.abs(mode.translation[:, 2]).max() < 1e-3]


@pytest.mark.parametrize(
    ("supports", "free"),
    [
        ([point(0.5, "free", 0.0, "free")], 5),
        ([point("start", 0.0, 0.0, 0.0)], 3),
        (pinned(), 1),
        ([point("start", 0.0, 0.0, "free", rotation=[0.0] * 3), point("end", 0.0, 0.7, "free", rotation=[0.0] * 3)], 1),
    ],
    ids=["one coordinate", "one point", "both ends", "a slide"],
)
def test_motions_that_the_supports_leave_are_zero_modes(supports: list[Json], free: int) -> None:
    equilibrium = solve(belt(supports))
    assert counts(equilibrium) == (True, 0, free)
    modes = equilibrium.modes(free + 1)
    assert [mode.eigenvalue for mode in modes[:free]] == pytest.approx([0.0] * free, abs=1e-6)
    assert modes[free].eigenvalue > 1.0
    for mode in modes[:free]:
        assert np.ptp(mode.rotation, axis=0).max() < 1e-9
        assert max(np.abs(mode.bend).max(), np.abs(mode.rib_slope).max()) < 1e-9


def test_belt_that_moves_freely_has_the_modes_of_the_free_beam() -> None:
    """The coordinate that is held is along the flat belt: no bending moves it to first order."""
    modes = solve(belt([point(0.5, "free", 0.0, "free")])).modes(6)
    assert modes[5].eigenvalue == pytest.approx(FREE_FREE**4, rel=1e-3)


def test_free_turn_of_an_arch_about_its_pins_leaves_the_modes_in_its_plane() -> None:
    """Hinges that keep the arch in its plane leave the same motions in the plane."""
    hinged = in_plane(solve(belt(pinned(rotation=list(ORIGIN), hinge="zeta"))), 8)
    assert in_plane(solve(belt(pinned())), 8)[:2] == pytest.approx(hinged[:2], rel=1e-6)


@pytest.mark.parametrize("energy", ENERGIES)
def test_ring_that_nothing_holds_has_the_frequencies_of_hoppe(energy: Energy) -> None:
    ring = solve(closed(0, energy=energy))
    assert counts(ring) == (True, 0, 6)
    assert [mode.eigenvalue for mode in ring.modes(6)] == pytest.approx([0.0] * 6, abs=1e-6)
    assert in_plane(ring, 14)[:4] == pytest.approx([hoppe(2)] * 2 + [hoppe(3)] * 2, rel=1e-3)


def test_one_coordinate_held_leaves_a_ring_one_mode_of_each_pair() -> None:
    """Of each pair one combination does not move the point that is held."""
    ring = solve(closed(0, [point(0.3, "free", 0.0, "free")]))
    assert counts(ring) == (True, 0, 5)
    values = in_plane(ring, 16)
    for n in (2, 3):
        assert min(abs(value / hoppe(n) - 1.0) for value in values) < 1e-3


@pytest.mark.parametrize("elements", [80, 160, 320])
def test_sliding_along_itself_is_a_zero_mode_of_a_mobius_band_on_every_mesh(elements: int) -> None:
    band = solve(closed(MOBIUS, elements=elements))
    assert counts(band) == (True, 0, 7)
    modes = band.modes(8)
    assert [mode.eigenvalue for mode in modes[:7]] == pytest.approx([0.0] * 7, abs=1e-6)
    assert modes[7].eigenvalue > 1000.0


def test_clamp_leaves_a_mobius_band_free_to_slide_along_itself() -> None:
    """The bend moves on along the spine, while the belt turns so that the clamped place stays."""
    band = solve(closed(MOBIUS, [support("start", ORIGIN, ORIGIN)], elements=320))
    assert counts(band) == (True, 0, 1)
    (sliding,) = band.modes(1)
    assert sliding.eigenvalue == pytest.approx(0.0, abs=1e-6)
    assert np.abs(sliding.translation[0]).max() < 1e-9
    along = np.gradient(band.bend, band.u)[2:-2]
    ratio = np.dot(sliding.bend[2:-2], along) / np.dot(along, along)
    assert np.abs(sliding.bend[2:-2] - ratio * along).max() < 1e-6 * np.abs(ratio * along).max()


def test_clamped_ring_has_one_spectrum_wherever_it_is_clamped() -> None:
    """A circle that slides along itself is the same: no motion. Its first mode is that of a strip curved to a ring."""
    rings = [solve(closed(0, [support(at, ORIGIN, ORIGIN)], elements=320)) for at in ("start", 0.3, 0.5)]
    assert [counts(ring) for ring in rings] == [(True, 0, 0)] * 3
    spectra = np.array([[mode.eigenvalue for mode in ring.modes(3)] for ring in rings])
    np.testing.assert_allclose(spectra, spectra[[0, 0, 0]], rtol=1e-6)
    ends = [support(at, ORIGIN, [0.0, 0.0, turn], square_rib=False) for at, turn in (("start", 0.0), ("end", math.tau))]
    strip = solve(belt(ends, elements=320))
    assert spectra[0, 0] == pytest.approx(strip.modes(1)[0].eigenvalue, rel=0.02)


@pytest.mark.parametrize("place", [0.5, 0.495])
def test_ring_between_two_pins_may_turn_about_them_alone(place: float) -> None:
    """Where sliding keeps the pins' distance to first order, it does not beyond."""
    ring = solve(closed(0, [support("start", ORIGIN), support(place, [0.0, 0.4, 0.0])]))
    assert counts(ring) == (True, 0, 1)
    assert ring.modes(2)[1].eigenvalue == pytest.approx(18400.0, rel=5e-3)


def test_belt_that_hangs_from_a_point_may_turn_about_the_vertical_alone() -> None:
    hanging = board([straight(1.0, natural_bend=3.0)], [point("start", 0.0, 0.0, 0.0)], gravity=(0.0, 0.0, -10.0))
    hanging["belt"] |= {"density": 1.0, "poisson": 0.3}
    equilibrium = solve(hanging)
    assert counts(equilibrium) == (True, 0, 1)
    turn, swing = equilibrium.modes(2)
    assert turn.eigenvalue == pytest.approx(0.0, abs=1e-6)
    assert np.abs(turn.rotation[:, :2]).max() < 1e-9
    assert swing.eigenvalue > 1.0


def test_stiffener_leaves_a_closed_belt_the_motions_of_the_whole_alone() -> None:
    band = solve(closed(MOBIUS, segments=[straight(0.95), rigid(0.05)]))
    assert band.zero_modes == 6
