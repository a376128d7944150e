"""Runs Yawara on the case, and reads its summary, its table of steps and its frames."""

import csv
import json
import subprocess
from pathlib import Path

import numpy as np
from case import VOXEL_M, Failure, Solution, TetMesh, at_ends, label_image, scene


def read_vtu(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Points at rest and displacements (n, 3) in m, tetrahedra (m, 4) of a frame."""
    import meshio

    frame = meshio.read(path)
    moved = np.asarray(frame.point_data["displacement"], dtype=float) * 1e-3
    points = np.asarray(frame.points, dtype=float) * 1e-3
    return points, moved, np.asarray(frame.cells_dict["tetra"], dtype=np.int64)


def run(binary: Path, image: Path, out: Path, level: int, element: str) -> Solution:
    """One run into `out`, new or replaced. `setup_s` is what comes before its step."""
    file = image.with_name(f"level{level}_{element}.toml")
    file.write_text(scene(image, level, element), encoding="utf-8")
    command = [str(binary), "run", str(file), "--out", str(out), "--force"]
    try:
        done = subprocess.run(command, capture_output=True, text=True)
    except OSError as error:
        raise Failure(f"cannot run {binary}: {error.strerror}") from error
    if done.returncode != 0:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[0]
        raise Failure(f"{binary} ended with {done.returncode}: {last}")
    try:
        summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
        with (out / "steps.csv").open(encoding="utf-8", newline="") as table:
            step = next(csv.DictReader(table))
        points, moved, _ = read_vtu(out / "frames" / "step_000001.vtu")
        spent = sum(float(value) for key, value in step.items() if key.endswith("_ms")) * 1e-3
        return Solution(
            moved,
            3 * int((~at_ends(points)).sum()),
            summary["setup_s"],
            spent,
            float(step["residual"]),
            int(step["iterations"]),
        )
    except (OSError, KeyError, StopIteration, ValueError) as error:
        raise Failure(f"{out} does not hold what a run of Yawara writes: {error!r}") from error


def mesh_of(out: Path, level: int, coarse: np.ndarray | None) -> TetMesh:
    """The mesh of a run at rest. `coarse` are the vertices to compare at, its own if `None`.

    A tetrahedron's label is that of its centroid's voxel, as mesh generators give it.
    """
    from scipy.spatial import KDTree

    points, _, tets = read_vtu(out / "frames" / "step_000000.vtu")
    tree = KDTree(points)
    wanted = points if coarse is None else coarse
    distance, samples = tree.query(wanted)
    if distance.max() > 1e-7:
        raise Failure(f"level {level}: it lacks vertices of the coarsest mesh")
    voxels = np.floor(points[tets].mean(1) / VOXEL_M).astype(int)
    return TetMesh(level, points, tets, label_image()[tuple(voxels.T)], samples)
