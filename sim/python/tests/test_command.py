"""The program that the package brings along."""

import json
import subprocess
import sys
import sysconfig
from pathlib import Path

import yawara

SCRIPT = Path(sysconfig.get_path("scripts")) / "yawara"


def said(*words):
    return subprocess.run(words, capture_output=True, text=True, timeout=300)


def test_it_runs_a_scene_as_the_package_does(tmp_path):
    out = tmp_path / "beam"
    settings = ["--set", "time.steps=3", "--set", "output.frames_every=0"]
    ran = said(SCRIPT, "run", "beam", *settings, "--out", out)
    assert ran.returncode == 0, ran.stderr
    summary = json.loads((out / "summary.json").read_text())
    simulation = yawara.Simulation("beam", {"time.steps": 3})
    for _ in range(3):
        simulation.step()
    assert summary["tools"][0]["force_end_n"] == simulation.summary["tools"][0]["force_end_n"]


def test_it_refuses_as_the_program_does():
    for program in ([SCRIPT], [sys.executable, "-m", "yawara"]):
        refused = said(*program, "run", "no_such_scene")
        assert refused.returncode == 2
        assert refused.stderr.startswith("error: ") and "no_such_scene" in refused.stderr
    assert said(SCRIPT, "--version").stdout.split() == ["yawara", "0.2.0"]
