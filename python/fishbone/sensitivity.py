"""Derivatives of an equilibrium by the parameters of its scenario."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fishbone.errors import InvalidArgument

if TYPE_CHECKING:
    import numpy.typing as npt
    from numpy.typing import NDArray

    from fishbone import _core

    Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Change:
    """Derivative of an equilibrium along a direction of its parameters; n is the number of nodes, m of supports.

    Units: those of the scenario; angles in rad.
    """

    position: Floats
    """Displacement of the spine at the nodes, shape (n, 3)."""
    rotation: Floats
    """Rotation of the frame at the nodes, left and in world axes, shape (n, 3)."""
    bend: Floats
    """Change of the bend ω_ζ at the nodes, shape (n,)."""
    rib_slope: Floats
    """Change of the rib slope β at the nodes, shape (n,)."""
    reactions: Floats
    """Change of [force, moment] of the supports, shape (m, 6)."""
    energy: float
    """Change of the total potential."""


@dataclass(frozen=True, eq=False)
class Gradient:
    """Derivative of a number by the parameters of an equilibrium; n is the number of nodes, m of supports.

    Units: those of the number over those of the scenario; angles in rad.
    """

    supports: Floats
    """By [translation, left world-axes rotation about the support point] of the supports, shape (m, 6)."""
    rigidity: Floats
    """By the rigidity R_f at the nodes, linear in between, shape (n,)."""
    natural_bend: Floats
    """By the natural bend of every segment of the belt, shape (segments,)."""
    width: float
    """By the width, at constant rigidity and mass of the whole width."""
    thickness: float
    """By the thickness, at constant rigidity and mass; of `layers`, by that of the sheet whose stretching stiffness is
    to its bending stiffness as theirs. 0 unless the energy is "shell"."""
    poisson: float
    """By Poisson's ratio, at constant rigidity. 0 of a belt without natural bend unless the energy is "shell"."""
    gravity: Floats
    """By gravity, shape (3,)."""


class Sensitivity:
    """The first-order conditions of an equilibrium, linearised and factorised.

    A product costs about as much as one iteration of the solve. The derivatives are those of the discrete equations, on
    the mesh of the equilibrium, to the accuracy of the solution; they hold as long as the same ribs touch. Segments
    that continue each other without a joint stay without a joint when their natural bend changes.
    """

    __slots__ = ("_inner", "_of")

    def __init__(self, of: _core.Equilibrium) -> None:
        self._of = of
        self._inner = of.sensitivity()

    def __reduce__(self) -> tuple[Any, ...]:
        return Sensitivity, (self._of,)

    def forward(  # noqa: PLR0913, PLR0917
        self,
        supports: npt.ArrayLike | None = None,
        rigidity: npt.ArrayLike | None = None,
        natural_bend: npt.ArrayLike | None = None,
        width: float = 0.0,
        gravity: npt.ArrayLike | None = None,
        thickness: float = 0.0,
        poisson: float = 0.0,
    ) -> Change:
        """The change of the equilibrium along a direction of its parameters.

        `supports` holds [translation, left world-axes rotation about the support point] of every support; components
        that are free change nothing. `rigidity` is the change of R_f at the nodes, linear in between. `width` changes
        the width alone, `thickness` and `poisson` each its own number alone, at constant rigidity and mass. The
        thickness of `layers` is that of the sheet whose stretching stiffness is to its bending stiffness as theirs.

        The rigidity R_f = E h³ V/(12 (1 − ν²)) and the mass of a sheet given by its `material` change with its width V
        and its thickness h, the rigidity with Poisson's ratio ν, too. Add these changes, with `ones = np.ones(n)`:

        - for `width = 1`: `rigidity = R_f/V * ones`, `gravity = g/V`;
        - for `thickness = 1`: `rigidity = 3 * R_f/h * ones`, `gravity = g/h`;
        - for `poisson = 1`: `rigidity = 2 * ν * R_f/(1 − ν²) * ones`.

        Shapes: supports (m, 6), rigidity (n,), natural_bend (segments,), gravity (3,); None is no change.
        Errors: `InvalidArgument` for other shapes and for numbers that are not finite; `NoSensitivity` where the
        supports leave the belt no slack for the change.
        """
        m, n, segments = self._inner.shape
        sheet = (("width", width), ("thickness", thickness), ("poisson", poisson))
        arguments = (
            _array("supports", supports, (m, 6)),
            _array("rigidity", rigidity, (n,)),
            _array("natural_bend", natural_bend, (segments,)),
            [float(_array(name, value, ())) for name, value in sheet],
            _array("gravity", gravity, (3,)).tolist(),
        )
        return Change(*self._inner.forward(*arguments))

    def adjoint(  # noqa: PLR0913, PLR0917
        self,
        position: npt.ArrayLike | None = None,
        rotation: npt.ArrayLike | None = None,
        bend: npt.ArrayLike | None = None,
        rib_slope: npt.ArrayLike | None = None,
        reactions: npt.ArrayLike | None = None,
        energy: float = 0.0,
    ) -> Gradient:
        """The gradient of a number by all parameters, from its derivatives by the equilibrium, which are the arguments.

        `adjoint` is the transpose of `forward`: the gradient by all parameters costs one product.

        Shapes: those of `Change`; None is no dependence.
        Errors: `InvalidArgument` for other shapes and for numbers that are not finite; `NoSensitivity` where the
        supports leave the belt no slack for a change.
        """
        m, n, _ = self._inner.shape
        arguments = (
            _array("position", position, (n, 3)),
            _array("rotation", rotation, (n, 3)),
            _array("bend", bend, (n,)),
            _array("rib_slope", rib_slope, (n,)),
            _array("reactions", reactions, (m, 6)),
            float(_array("energy", energy, ())),
        )
        supports, rigidity, natural_bend, (width, thickness, poisson), gravity = self._inner.adjoint(*arguments)
        return Gradient(supports, rigidity, natural_bend, width, thickness, poisson, np.array(gravity))

    def jacobian(self, support: int) -> Floats:
        """Derivatives of the spine positions by the motion of a support, which is named by its index.

        The last axis is [translation, left world-axes rotation about the support point].

        Shapes: (n, 3, 6).
        Errors: `InvalidArgument` where there is no such support; `NoSensitivity` where the supports leave the belt no
        slack for the motion.
        """
        count, _, _ = self._inner.shape
        if not 0 <= support < count:
            raise InvalidArgument(f"support: found {support}, allowed 0 to {count - 1}")
        return self._inner.jacobian(support)


def _array(name: str, value: npt.ArrayLike | None, shape: tuple[int, ...]) -> Floats:
    if value is None:
        return np.zeros(shape)
    try:
        array = np.array(value, dtype=np.float64, order="C")
    except (TypeError, ValueError):
        raise InvalidArgument(f"{name}: found {type(value).__name__}, allowed numbers of shape {shape}") from None
    if array.shape != shape:
        raise InvalidArgument(f"{name}: found an array of shape {array.shape}, allowed {shape}")
    if not np.all(np.isfinite(array)):
        raise InvalidArgument(f"{name}: found a number that is not finite")
    return array
