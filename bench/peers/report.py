"""Errors beside times: rows, their table, `peers.json` and `peers.csv`."""

import csv
import json
import os
import statistics
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from case import SIZE_M, Candidate, Failure, Solution


@dataclass(frozen=True)
class Row:
    """What is known of a candidate. Times are medians over `turns`, in s."""

    method: str
    law: str
    level: int
    vertices: int
    tets: int
    unknowns: int
    error: float
    sag_mm: float
    setup_s: float
    solve_s: float
    turns: int
    iterations: int
    residual: float
    times_yawara: float | None


def sampled(candidate: Candidate, solution: Solution) -> np.ndarray:
    """Displacements (samples, 3) in m at the coarsest mesh's vertices, refused if not finite."""
    moved = solution.displacement[candidate.mesh.samples]
    if not np.isfinite(moved).all():
        raise Failure(f"{candidate.method}: displacements are not finite")
    return moved


def row(
    candidate: Candidate, solutions: list[Solution], reference: np.ndarray, yawara_s: float | None
) -> Row:
    """`error` is √(Σ‖u − u'‖² / Σ‖u'‖²) over the samples, `sag_mm` the mean in the middle section.

    `yawara_s` is what Yawara's default takes in all on this mesh, `times_yawara` the ratio to it.
    """
    mesh, last = candidate.mesh, solutions[-1]
    moved = sampled(candidate, last)
    middle = np.isclose(mesh.points[mesh.samples, 0], SIZE_M[0] / 2, atol=1e-7)
    setup = statistics.median(s.setup_s for s in solutions)
    solve = statistics.median(s.solve_s for s in solutions)
    return Row(
        candidate.method,
        candidate.law,
        mesh.level,
        len(mesh.points),
        len(mesh.tets),
        last.unknowns,
        float(np.linalg.norm(moved - reference) / np.linalg.norm(reference)),
        float(-1e3 * moved[middle, 2].mean()),
        setup,
        solve,
        len(solutions),
        last.iterations,
        last.residual,
        (setup + solve) / yawara_s if yawara_s else None,
    )


def table(rows: list[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [
        "| method | law | level | vertices | unknowns | error | sag, mm | set-up, s | solve, s"
        " | in all / Yawara |",
        "|---|---|--:|--:|--:|--:|--:|--:|--:|--:|",
    ]
    for r in rows:
        ratio = "–" if r.times_yawara is None else f"{r.times_yawara:.2g}"
        lines.append(
            f"| {r.method} | {r.law} | {r.level} | {r.vertices} | {r.unknowns} | {r.error:.4f}"
            f" | {r.sag_mm:.3f} | {r.setup_s:.3g} | {r.solve_s:.3g} | {ratio} |"
        )
    return "\n".join(lines)


def write(out: Path, rows: list[Row], about: dict[str, object]) -> None:
    """Writes both files under temporary names, then renames them."""
    plain = [asdict(r) for r in rows]
    for name in ("peers.json", "peers.csv"):
        part = out / f".{name}.{os.getpid()}.tmp"
        with part.open("w", encoding="utf-8", newline="") as file:
            if name.endswith("json"):
                json.dump(about | {"rows": plain}, file, indent=2, ensure_ascii=False)
                file.write("\n")
            else:
                writer = csv.DictWriter(file, fieldnames=list(plain[0]))
                writer.writeheader()
                writer.writerows(plain)
        part.replace(out / name)
