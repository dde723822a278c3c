"""Meshes of the surface, for CAD and rendering; needs `pip install "fishbone[mesh]"`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fishbone.errors import InvalidArgument, MissingPackage
from fishbone.files import write_whole

try:
    import trimesh
except ImportError:
    raise MissingPackage("trimesh", "mesh") from None

if TYPE_CHECKING:
    import os

    from fishbone.equilibrium import Equilibrium

SUFFIXES = (".stl", ".ply", ".obj", ".glb")


def mesh(equilibrium: Equilibrium, n_across: int = 9) -> trimesh.Trimesh:
    """The surface as triangles: open, without thickness, in the units of the scenario.

    Errors: `InvalidArgument` as `Equilibrium.mesh`.
    """
    vertices, triangles = equilibrium.mesh(n_across)
    # By default trimesh merges vertices, which would close the gap of a belt whose two ends touch.
    return trimesh.Trimesh(vertices, triangles, process=False)


def encode(equilibrium: Equilibrium, suffix: str, n_across: int = 9) -> bytes:
    """The content of a mesh file, in the format of the suffix.

    Errors: `InvalidArgument` where the suffix is not in `SUFFIXES`.
    """
    if suffix.lower() not in SUFFIXES:
        raise InvalidArgument(f"mesh: found {suffix or 'no suffix'}, allowed {', '.join(SUFFIXES)}")
    content = mesh(equilibrium, n_across).export(file_type=suffix.lower().lstrip("."))
    return content.encode() if isinstance(content, str) else bytes(content)


def save(equilibrium: Equilibrium, path: str | os.PathLike[str], n_across: int = 9) -> None:
    """Writes the mesh to a file, .stl, .ply, .obj or .glb.

    Errors: `InvalidArgument` for another suffix, `OSError`.
    """
    path = Path(path)
    write_whole(path, encode(equilibrium, path.suffix, n_across))
