"""A simulation, step by step."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, overload

import numpy as np
import scipy.sparse

from . import _yawara


def scenes() -> dict[str, str]:
    """The built-in scenes by name, with their texts (TOML)."""
    return dict(_yawara.scenes())


@dataclass(frozen=True)
class ToolReport:
    """What a tool feels after a step."""

    kind: str
    force_n: np.ndarray
    """Force of the tool on the body (3,), N."""
    force_error_n: float | None
    """How far its size is from that on a mesh without end, N; None where that is not known."""
    torque_n_m: np.ndarray
    work_j: float
    """Its work on the body in this step, J."""
    reference_m: np.ndarray
    """Where it is (3,), m."""
    contacts: int
    """Points held or pushed."""
    penetration_m: float


@dataclass(frozen=True)
class StepReport:
    """A step: what it found, and what it took."""

    step: int
    time_s: float
    vertices: int
    tetrahedra: int
    splits: int
    merges: int
    waiting: int
    """Splits that are wanted too but exceed the budget."""
    iterations: int
    substeps: int
    residual: float
    converged: bool
    error_estimate: float | None
    """How far the energy is from that on a mesh without end, relative; None where that is not known."""
    goal: tuple[str, float, float | None] | None
    """Name, value and error of the scene's goal."""
    failure: dict[str, Any] | None
    """Where a step did not converge, and what may help."""
    times_ms: dict[str, float]
    tools: list[ToolReport]


@dataclass(frozen=True)
class Frame:
    """The deformed mesh with its fields, named as in VTU files. Without a field an array is empty."""

    time_s: float
    positions: np.ndarray
    """(n, 3), m."""
    displacements: np.ndarray
    """(n, 3), m."""
    tetrahedra: np.ndarray
    """(m, 4), positively oriented."""
    level: np.ndarray
    label: np.ndarray
    """The label of most of each tetrahedron (m,)."""
    young_modulus_pa: np.ndarray
    von_mises_pa: np.ndarray
    plastic_strain: np.ndarray
    dissipated_j_m3: np.ndarray
    indicator: np.ndarray

    def _fields(self) -> dict[str, np.ndarray]:
        names = ("level", "label", "young_modulus_pa", "von_mises_pa", "plastic_strain", "dissipated_j_m3", "indicator")
        fields = {name: getattr(self, name) for name in names}
        return {name: field for name, field in fields.items() if len(field)}

    def to_meshio(self) -> Any:
        """The same as a `meshio.Mesh`."""
        import meshio

        fields = {name: [field] for name, field in self._fields().items()}
        points = {"displacement": self.displacements}
        return meshio.Mesh(self.positions, [("tetra", self.tetrahedra)], point_data=points, cell_data=fields)

    def to_pyvista(self) -> Any:
        """The same as a `pyvista.UnstructuredGrid`."""
        import pyvista

        grid = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: self.tetrahedra}, self.positions)
        grid.point_data["displacement"] = self.displacements
        for name, field in self._fields().items():
            grid.cell_data[name] = field
        return grid


class Tool:
    """A tool of a simulation."""

    def __init__(self, simulation: Simulation, number: int, kind: str) -> None:
        self._simulation = simulation
        self.number = number
        self.kind = kind

    @property
    def pose(self) -> tuple[np.ndarray, float]:
        """Where it is: displacement (3,), m, and turn, degrees. Setting it (a displacement, or both) leads it there over the
        next step, and it stays until it is led elsewhere."""
        simulation = self._simulation
        move, turn = simulation._native.tool_pose(self.number, simulation.time_s)
        return np.array(move), turn

    @pose.setter
    def pose(self, pose: Any) -> None:
        move: Any
        turn: float
        match pose:
            case (move, Real() as given):
                turn = float(given)
            case move:
                turn = 0.0
        self._simulation._native.set_tool_pose(self.number, [float(x) for x in move], turn)

    @property
    def report(self) -> ToolReport | None:
        """What it felt in the last step."""
        last = self._simulation.last
        return last.tools[self.number] if last and self.number < len(last.tools) else None

    @property
    def force(self) -> np.ndarray:
        """Its force on the body in the last step (3,), N."""
        return self.report.force_n if self.report else np.zeros(3)

    @property
    def stiffness(self) -> np.ndarray:
        """How its force grows with its displacement (3, 3), N/m."""
        return self._simulation._native.tool_stiffness(self.number)

    def release(self) -> None:
        """Lets go in the next step, for good."""
        self._simulation._native.release_tool(self.number)


class Tools(Sequence[Tool]):
    """The tools of a simulation, by number, or by kind where there is one of it."""

    def __init__(self, simulation: Simulation) -> None:
        self._all = [Tool(simulation, n, kind) for n, kind in enumerate(simulation._native.tool_kinds())]

    def __len__(self) -> int:
        return len(self._all)

    def __iter__(self) -> Iterator[Tool]:
        return iter(self._all)

    @overload
    def __getitem__(self, key: int | str) -> Tool: ...

    @overload
    def __getitem__(self, key: slice) -> Sequence[Tool]: ...

    def __getitem__(self, key: int | str | slice) -> Tool | Sequence[Tool]:
        if not isinstance(key, str):
            return self._all[key]
        found = [tool for tool in self._all if tool.kind == key]
        if len(found) == 1:
            return found[0]
        kinds = ", ".join(tool.kind for tool in self._all) or "none"
        raise KeyError(f"{len(found)} tools of kind {key!r}, want one; there are: {kinds}")


class Simulation:
    """A body, its tools and the stages that move it.

    `scene` is the name of a built-in scene, the path of a TOML file, or a dictionary of the same keys. `settings` change
    keys: `{"mesh.max_level": 3}`, or `["mesh.max_level=3"]`.

    `labels` (an integer array [x, y, z]) with the 4 x 4 `affine` of nibabel (voxel indices to scanner RAS, mm), or with cubes
    of `spacing_mm`, are the body in place of the scene's image; the scene is a dictionary then, and names none.

    Stages of one's own are objects: `homogenisation` with `combine(elasticity, gradients)`, which gives the elasticity
    (6, 6) of a tetrahedron from those of its halves (2, 6, 6), or a pair of it and how the midpoint moves per strain
    (3, 6); `indicator` with `measure(strain, volume_m3, elasticity, edge_m)`, the value of a ring of k tetrahedra from arrays
    of k; `law` with `stress(strain, elasticity, state, step_s)` and `tangent` of the same, with `state_len` numbers of state
    `stress` gives a pair; `tools` with `loads(time_s, rest, positions)`, forces on all vertices (n, 3), or `ball(time_s)`, the
    centre and radius of a ball that nothing enters (or None), with `spacing_m`. They are called for each element and are slow.
    What they raise ends the simulation.

    `progress(part, fraction)` is called while the body is made.
    """

    def __init__(
        self,
        scene: str | os.PathLike[str] | Mapping[str, Any] = "liver",
        settings: Mapping[str, Any] | Sequence[str] = (),
        *,
        labels: Any = None,
        affine: Any = None,
        spacing_mm: float | None = None,
        homogenisation: Any = None,
        indicator: Any = None,
        law: Any = None,
        tools: Sequence[Any] = (),
        progress: Callable[[str, float], object] | None = None,
    ) -> None:
        if spacing_mm is not None:
            if affine is not None:
                raise _yawara.Error("spacing_mm and affine both say how large voxels are: give one")
            affine = np.diag([spacing_mm, spacing_mm, spacing_mm, 1.0])
        if isinstance(scene, os.PathLike):
            scene = os.fspath(scene)
        self._native = _yawara.Simulation(
            scene,
            settings,
            labels=labels,
            affine=affine,
            homogenisation=homogenisation,
            indicator=indicator,
            law=law,
            tools=list(tools),
            progress=progress,
        )
        self._frame: Frame | None = None
        self.last: StepReport | None = None
        """The last step."""

    def step(self) -> StepReport:
        """Makes a step. One that does not converge is reported, not raised."""
        row = self._native.step()
        self._frame = None
        self.last = StepReport(**{**row, "tools": [ToolReport(**tool) for tool in row["tools"]]})
        return self.last

    def run(self, steps: int | None = None) -> list[StepReport]:
        """Makes so many steps, or all that the scene has left."""
        return [self.step() for _ in range(self.steps_left if steps is None else steps)]

    @property
    def name(self) -> str:
        """The scene's name."""
        return self._native.name

    @property
    def steps_left(self) -> int:
        """Steps that the scene still has."""
        return self._native.steps_left

    @property
    def time_s(self) -> float:
        """Time at the end of the last step, s."""
        return self.last.time_s if self.last else 0.0

    @property
    def plan(self) -> list[dict[str, Any]]:
        """What runs, what is left out, and why."""
        return self._native.plan()

    @property
    def summary(self) -> dict[str, Any]:
        """All that has happened so far, as in summary.json."""
        return self._native.summary()

    @property
    def frame(self) -> Frame:
        """The deformed mesh with its fields."""
        if self._frame is None:
            self._frame = Frame(**self._native.frame())
        return self._frame

    @property
    def positions(self) -> np.ndarray:
        """Vertices (n, 3), m."""
        return self.frame.positions

    @property
    def tetrahedra(self) -> np.ndarray:
        """Vertices of the tetrahedra (m, 4)."""
        return self.frame.tetrahedra

    @property
    def labels(self) -> np.ndarray:
        """The label of most of each tetrahedron (m,)."""
        return self.frame.label

    @property
    def stress(self) -> np.ndarray:
        """Von Mises stress of each tetrahedron (m,), Pa."""
        return self.frame.von_mises_pa

    @property
    def tools(self) -> Tools:
        """The tools, by number or kind."""
        return Tools(self)

    @property
    def forces(self) -> np.ndarray:
        """Forces of the tools on the body in the last step (tools, 3), N."""
        return np.array([tool.force for tool in self.tools]).reshape(-1, 3)

    @property
    def contacts(self) -> np.ndarray:
        """How many points each tool holds or pushes (tools,)."""
        return np.array([tool.report.contacts if tool.report else 0 for tool in self.tools], dtype=int)

    @property
    def error_estimate(self) -> float | None:
        """That of the last step."""
        return self.last.error_estimate if self.last else None

    @property
    def energy_j(self) -> float:
        """What the body stores, J."""
        return self._native.energy_j()

    def add_tool(self, entry: Mapping[str, Any]) -> Tool:
        """Adds a grab or a probe, with the keys of `[[tools]]`, which begins now where it is."""
        return self.tools[self._native.add_tool(dict(entry))]

    def split(self, tetrahedra: Any) -> int:
        """Bisects these tetrahedra (numbers), and those that have to be for the mesh to fit together; returns how many
        vertices came in."""
        self._frame = None
        return self._native.split(_numbers(tetrahedra))

    def merge(self, vertices: Any) -> int:
        """Takes those of these vertices (numbers) out that can go; returns how many went."""
        self._frame = None
        return self._native.merge(_numbers(vertices))

    def stiffness(self) -> scipy.sparse.bsr_array:
        """The matrix whose inverse is kept, of the body at rest, N/m: blocks of 3 displacements along the columns of `axes`, or
        with a scaled pressure as the fourth. `slots` says which block is whose."""
        return _matrix(self._native.stiffness())

    @property
    def slots(self) -> np.ndarray:
        """The block of each vertex in `stiffness` (n,), -1 where it has none."""
        return self._native.slots()

    @property
    def free(self) -> np.ndarray:
        """Which vertices are free (n,)."""
        return self._native.free()

    @property
    def axes(self) -> np.ndarray:
        """The axes of `stiffness` in the scanner, as columns (3, 3)."""
        return self._native.axes()

    def solve(self, forces: Any) -> np.ndarray:
        """Displacements (n, 3), m, of the body at rest under forces on its vertices (n, 3), N, by the inverse that is kept."""
        return self._native.solve(forces)


def _numbers(values: Any) -> list[int]:
    values = np.asarray(values)
    if values.dtype == bool:
        values = np.flatnonzero(values)
    if values.size and values.min() < 0:
        raise _yawara.Error(f"number {values.min()}, want 0 or more")
    return [int(value) for value in values.ravel()]


def _matrix(blocks: tuple[np.ndarray, np.ndarray, np.ndarray]) -> scipy.sparse.bsr_array:
    size = len(blocks[2]) - 1
    rows = size * blocks[0].shape[1]
    return scipy.sparse.bsr_array(blocks, shape=(rows, rows))
