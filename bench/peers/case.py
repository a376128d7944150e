"""The body that all compare: its image, its scene, its meshes, and what a peer hands back.

Lengths are in m, moduli in Pa, densities in kg/m³, times in s, unless a name says otherwise.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SIZE_M = (0.2, 0.06, 0.06)
BALL_RADIUS_M = 0.02
YOUNG_MODULUS_PA = {1: 2e4, 2: 2e5}
POISSON_RATIO = 0.45
DENSITY_KG_M3 = 1000.0
GRAVITY_M_S2 = 9.81
VOXEL_M = 0.005
BASE_M = 0.02
RESIDUAL = 1e-6
"""Relative residual, against the weight, at which an equilibrium counts as found."""


class Failure(Exception):
    """Something a person can act on, in one line."""


def at_ends(points: np.ndarray) -> np.ndarray:
    """(n,) booleans: which of the points (n, 3) lie on the two ends, which never move."""
    return (points[:, 0] < 1e-9) | (points[:, 0] > SIZE_M[0] - 1e-9)


@dataclass(frozen=True)
class TetMesh:
    """Tetrahedra that Yawara wrote: `points` (n, 3) in m, `tets` (m, 4), `labels` (m,) 1 or 2.

    `samples` are the indices of the coarsest mesh's vertices, where displacements are compared.
    """

    level: int
    points: np.ndarray
    tets: np.ndarray
    labels: np.ndarray
    samples: np.ndarray

    def lame(self) -> tuple[np.ndarray, np.ndarray]:
        """λ and μ of every tetrahedron (m,), in Pa."""
        young = np.array([YOUNG_MODULUS_PA[int(label)] for label in self.labels])
        shear = young / (2 * (1 + POISSON_RATIO))
        return 2 * shear * POISSON_RATIO / (1 - 2 * POISSON_RATIO), shear

    def volumes(self) -> np.ndarray:
        """Volume of every tetrahedron (m,), in m³."""
        corners = self.points[self.tets]
        return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6


@dataclass(frozen=True)
class Solution:
    """Displacements (n, 3) in m of the mesh's vertices, those that are unknown, and the time."""

    displacement: np.ndarray
    unknowns: int
    setup_s: float
    solve_s: float
    residual: float
    iterations: int


@dataclass(frozen=True)
class Candidate:
    """One way to find the equilibrium; `solve` starts from nothing each time it is called."""

    method: str
    law: str
    mesh: TetMesh
    solve: Callable[[], Solution]


def label_image() -> np.ndarray:
    """Labels (nx, ny, nz) of the voxels: 2 where the centre lies in the ball, else 1."""
    axes = [(np.arange(round(size / VOXEL_M)) + 0.5) * VOXEL_M - size / 2 for size in SIZE_M]
    x, y, z = np.meshgrid(*axes, indexing="ij")
    return np.where(x**2 + y**2 + z**2 < BALL_RADIUS_M**2, 2, 1).astype(np.uint8)


def write_image(path: Path) -> None:
    """Writes the labels as NRRD, uncompressed, x fastest, millimetres."""
    labels = label_image()
    voxel_mm = VOXEL_M * 1e3
    header = "\n".join(
        [
            "NRRD0004",
            "type: uint8",
            "dimension: 3",
            "sizes: " + " ".join(str(n) for n in labels.shape),
            "space: right-anterior-superior",
            f"space directions: ({voxel_mm},0,0) (0,{voxel_mm},0) (0,0,{voxel_mm})",
            f"space origin: ({voxel_mm / 2},{voxel_mm / 2},{voxel_mm / 2})",
            "encoding: raw",
            "\n",
        ]
    )
    path.write_bytes(header.encode("ascii") + labels.tobytes(order="F"))


def scene(image: Path, level: int, element: str) -> str:
    """The scene as TOML: a uniform mesh of this level, one step, an equilibrium under gravity."""
    materials = "".join(
        f"[[materials]]\nlabel = {label}\nname = \"{name}\"\nyoung_modulus_pa = {young}\n"
        f"poisson_ratio = {POISSON_RATIO}\ndensity_kg_m3 = {DENSITY_KG_M3}\n\n"
        for (label, young), name in zip(YOUNG_MODULUS_PA.items(), ("gel", "ball"))
    )
    ends = "".join(
        f'[[fixed]]\nshape = "box"\nmin = [{x}, 0.0, 0.0]\nmax = [{x}, 1.0, 1.0]\n\n'
        for x in (0.0, 1.0)
    )
    # A JSON string is a TOML string: a path may hold quotes and backslashes.
    return (
        f'name = "peers"\ngravity_m_s2 = [0.0, 0.0, {-GRAVITY_M_S2}]\n\n'
        f"[image]\npath = {json.dumps(str(image))}\n\n{materials}"
        f"[mesh]\nbase_mm = {BASE_M * 1e3}\nstart_level = {level}\nmax_vertices = 100000\n\n"
        f"{ends}[time]\nsteps = 1\nstep_s = 0.1\n\n[solver]\nresidual = {RESIDUAL}\n\n"
        f'[stages]\nelement = "{element}"\n\n[output]\nframes_every = 1\n'
    )
