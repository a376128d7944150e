"""Moduli from measurements, and what a skin feels like."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _yawara


@dataclass(frozen=True)
class Measurement:
    """The move of a point of the material, or the force of a tool on the body, at the end of a step."""

    time_s: float
    values: Sequence[float | None]
    """By scanner axis (3,), m or N; None where that was not measured."""
    point_m: Sequence[float] | None = None
    """Where the point rests, scanner RAS (3,), m."""
    tool: int | None = None
    """The tool in place of a point."""
    sd: float | None = None
    """Standard deviation of the noise of each value, m or N; of all measurements or of none."""


@dataclass(frozen=True)
class Modulus:
    """The modulus of an entry of the scene's materials."""

    entry: int
    label: int | None
    start_pa: float
    young_modulus_pa: float
    relative_sd: float
    """Standard deviation of its logarithm."""
    band_pa: tuple[float, float]
    """Where it is with a probability of 95 %."""
    is_told: bool
    """Whether the measurements tell it."""
    mesh_shift: float | None
    """By which part of it it is off because the mesh is not as fine as the scene lets it become; None where not known."""


@dataclass(frozen=True)
class Identified:
    """Moduli, and how well they are known."""

    moduli: list[Modulus]
    correlation: np.ndarray
    """Of the logarithms of the moduli (n, n)."""
    chi_squared: float
    degrees_of_freedom: float
    converged: bool
    runs: int
    vertices: int
    left_out: list[str]
    residuals: list[dict[str, Any]]
    """Of every component: where, what was measured and what is predicted, mm or N."""


@dataclass(frozen=True)
class Skin:
    """A body's skin as a fingertip feels it."""

    positions: np.ndarray
    """Where it is pressed (n, 3), m."""
    normals: np.ndarray
    """Outward (n, 3)."""
    stiffness_n_m: np.ndarray
    """(n,), N/m."""
    without_n_m: np.ndarray | None
    """The same without the nodule (n,)."""
    vertices: int


def identify(
    scene: str | Mapping[str, Any],
    measured: Sequence[Measurement],
    *,
    settings: Sequence[str] | Mapping[str, Any] = (),
    materials: Sequence[int] = (),
    prior_factor: float = 10.0,
    labels: ArrayLike | None = None,
    affine: ArrayLike | None = None,
) -> Identified:
    """The moduli of a scene's materials (these entries, or all) with which it says what was measured.

    The mesh is that of the start. `prior_factor`: before anything is measured a modulus is believed to be within this factor
    of the scene's (one standard deviation).
    """
    rows = [_row(one) for one in measured]
    found = _yawara.identify(
        scene, settings, rows, list(materials), prior_factor, labels=labels, affine=affine
    )
    moduli = [
        Modulus(
            entry=one["entry"],
            label=one.get("label"),
            start_pa=one["start_pa"],
            young_modulus_pa=one["young_modulus_pa"],
            relative_sd=one["relative_sd"],
            band_pa=(one["band_pa"][0], one["band_pa"][1]),
            is_told=one["is_told"],
            mesh_shift=one.get("mesh_shift"),
        )
        for one in found["moduli"]
    ]
    names = ("chi_squared", "degrees_of_freedom", "converged", "runs", "vertices", "left_out", "residuals")
    rest = {name: found[name] for name in names}
    return Identified(moduli=moduli, correlation=np.array(found["correlation"]), **rest)


def _row(
    one: Measurement,
) -> tuple[float, list[float] | None, int | None, list[float | None], float | None]:
    to_mm = 1e3 if one.tool is None else 1.0
    point = None if one.point_m is None else [1e3 * float(x) for x in one.point_m]
    values = [None if value is None else to_mm * float(value) for value in one.values]
    return (one.time_s, point, one.tool, values, None if one.sd is None else to_mm * one.sd)


def feel(
    scene: str | Mapping[str, Any],
    *,
    settings: Sequence[str] | Mapping[str, Any] = (),
    points: int = 10_000,
    radius_m: float = 5e-3,
    nodule: tuple[int, int] | None = None,
    labels: ArrayLike | None = None,
    affine: ArrayLike | None = None,
) -> Skin:
    """How stiff the skin of a body at rest feels under a fingertip, linearly.

    `nodule`: the entry of a nodule among the scene's materials, and that of what would be in its place.
    """
    found = _yawara.feel(
        scene, settings, points, 1e3 * radius_m, nodule, labels=labels, affine=affine
    )
    all_points = found["points"]

    def column(name: str) -> np.ndarray:
        return np.array([point[name] for point in all_points], dtype=float)

    return Skin(
        positions=1e-3 * column("rest_mm").reshape(-1, 3),
        normals=column("normal").reshape(-1, 3),
        stiffness_n_m=column("stiffness_n_m"),
        without_n_m=None if nodule is None else column("without_n_m"),
        vertices=found["vertices"],
    )
