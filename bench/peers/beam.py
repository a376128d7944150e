"""Puts Yawara beside its peers: one body, one run, every time with its error.

Usage: python bench/peers/beam.py --yawara PATH_TO_BINARY --out DIR [--quick] [--force]
"""

import argparse
import importlib
import importlib.util
import os
import platform
import sys
import time
from functools import partial
from pathlib import Path

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
for variable in THREADS:
    os.environ.setdefault(variable, "1")  # read by numpy when it is imported

SLOW_S = 10.0
"""What takes longer has one turn."""


def arguments() -> argparse.Namespace:
    """The command line; what is wrong in it ends with exit code 2 and one line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--yawara", type=Path, required=True, help="Yawara's command-line binary")
    parser.add_argument("--out", type=Path, required=True, help="directory, new or empty")
    parser.add_argument("--quick", action="store_true", help="coarser, less than a minute")
    parser.add_argument("--force", action="store_true", help="replace results in a full DIR")
    return parser.parse_args()


def need(modules: dict[str, str]) -> None:
    """Raises `Failure` that names the packages to install for modules that are missing."""
    from case import Failure

    missing = [p for module, p in modules.items() if importlib.util.find_spec(module) is None]
    if missing:
        raise Failure(f"missing: pip install {' '.join(missing)}")


def prepare(binary: Path, out: Path, force: bool) -> tuple[Path, Path]:
    """Checks the binary and makes the directory; both as absolute paths."""
    from case import Failure

    if not binary.is_file() or not os.access(binary, os.X_OK):
        raise Failure(f"{binary} is no executable file (cargo build --release makes one)")
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()) and not force:
            raise Failure(f"{out} is not empty (--force replaces results of an earlier run)")
        (out / "runs").mkdir(exist_ok=True)
    except OSError as error:
        raise Failure(f"cannot write to {out}: {error.strerror}") from error
    return binary.resolve(), out.resolve()


def peers_here(meshes: list, quick: bool) -> tuple[list, list[str]]:
    """The candidates of every `peer_*.py` beside this file, and a line for each left out."""
    found, skipped = [], []
    for file in sorted(Path(__file__).parent.glob("peer_*.py")):
        try:
            peer = importlib.import_module(file.stem)
            need(peer.NEEDS)
            found += peer.candidates(meshes, quick)
        except Exception as error:  # as in `timed`
            line = (str(error) or type(error).__name__).splitlines()[0]
            skipped.append(f"{file.stem.removeprefix('peer_')}: {line}")
    return found, skipped


def timed(candidates: list, turns: int) -> tuple[list, list[str]]:
    """Solutions of every candidate, taken in turns; and a line for each that fails."""
    solutions: list[list] = [[] for _ in candidates]
    failed: dict[int, str] = {}
    for turn in range(turns):
        for number, candidate in enumerate(candidates):
            before = solutions[number]
            if number in failed or (before and before[0].setup_s + before[0].solve_s > SLOW_S):
                continue
            name = f"{candidate.method}, {candidate.law}, level {candidate.mesh.level}"
            print(f"turn {turn + 1} of {turns}: {name}", file=sys.stderr)
            try:
                before.append(candidate.solve())
            # A peer may fail in any way it likes: it costs its row, not the run.
            except Exception as error:
                failed[number] = f"{name}: {type(error).__name__}: {error}".splitlines()[0]
    pairs = [(c, s) for n, (c, s) in enumerate(zip(candidates, solutions)) if n not in failed]
    return pairs, list(failed.values())


def compare(options: argparse.Namespace) -> None:
    """The whole run: Yawara, the peers, the reference; a table on stdout and two files."""
    need({"numpy": "numpy", "scipy": "scipy", "meshio": "meshio", "skfem": "scikit-fem"})
    from case import Candidate, Failure, write_image
    from report import row, sampled, table, write
    from total_lagrangian import equilibrium
    from yawara_run import mesh_of, run

    binary, out = prepare(options.yawara, options.out, options.force)
    begin = time.perf_counter()
    image, runs = out / "runs" / "body.nrrd", out / "runs"
    write_image(image)
    levels = (0, 3) if options.quick else (0, 3, 6)
    meshes, ours = [], []
    for level in levels:
        for element, name in (("auto", "Yawara"), ("p1", "Yawara, p1")):
            folder = runs / f"level{level}_{element}"
            run(binary, image, folder, level, element)
            if element == "auto":
                meshes.append(mesh_of(folder, level, meshes[0].points if meshes else None))
            solve = partial(run, binary, image, folder, level, element)
            ours.append(Candidate(name, "co-rotated", meshes[-1], solve))
    theirs, skipped = peers_here(meshes, options.quick)
    finest = meshes[-1]
    last = [
        Candidate("reference: scikit-fem P2", "co-rotated", finest,
                  partial(equilibrium, finest, 2, "co-rotated")),
        Candidate("scikit-fem P2", "StVK", finest, partial(equilibrium, finest, 2, "StVK")),
    ]
    measured, failed = timed(ours + theirs + last, 1 if options.quick else 3)
    known = {id(c): s for c, s in measured}
    if id(last[0]) not in known or not all(id(c) in known for c in ours):
        raise Failure("; ".join(failed))
    reference = sampled(last[0], known[id(last[0])][-1])
    default: dict[int, float] = {}
    rows = []
    for candidate, solutions in measured:
        made = row(candidate, solutions, reference, default.get(candidate.mesh.level))
        if candidate.method == "Yawara":
            default[made.level] = made.setup_s + made.solve_s
        rows.append(made)
    rows.sort(key=lambda r: r.level)
    print(table(rows))
    for line in skipped + failed:
        print(f"left out: {line}")
    about = {
        "quick": options.quick,
        "python": platform.python_version(),
        "system": platform.platform(),
        "left_out": skipped + failed,
        "wall_s": time.perf_counter() - begin,
    }
    write(out, rows, about)
    print(f"{about['wall_s']:.0f} s; written to {options.out}")


def main() -> int:
    """0 where there is a table, 2 where there is none."""
    options = arguments()
    from_here = str(Path(__file__).parent)
    if from_here not in sys.path:
        sys.path.insert(0, from_here)
    try:
        from case import Failure  # needs numpy
    except ImportError as error:
        print(f"beam.py: missing: pip install {error.name}", file=sys.stderr)
        return 2
    try:
        compare(options)
    except (Failure, OSError) as error:
        print(f"beam.py: {error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
