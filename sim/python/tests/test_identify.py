"""Moduli that a simulation was made with are found again; a stiff nodule makes the skin stiffer."""

import numpy as np
import pytest

import yawara

SETTINGS = {"mesh.max_level": 0, "time.steps": 2, "support.stiffness_n_m4": 1e11}


def measured(modulus: float) -> list[yawara.Measurement]:
    simulation = yawara.Simulation("beam", {**SETTINGS, "materials.0.young_modulus_pa": modulus})
    before = simulation.frame
    report = simulation.step()
    after = simulation.frame
    rest = before.positions - before.displacements
    found = [
        yawara.Measurement(report.time_s, after.displacements[i], point_m=rest[i], sd=1e-5)
        for i in range(0, len(rest), 7)
    ]
    force = report.tools[0].force_n
    return [*found, yawara.Measurement(report.time_s, force, tool=0, sd=1e-4)]


def test_a_modulus_is_found_again() -> None:
    found = yawara.identify("beam", measured(7e3), settings=SETTINGS)
    (modulus,) = found.moduli
    assert found.converged and modulus.is_told and modulus.mesh_shift is None
    assert modulus.young_modulus_pa == pytest.approx(7e3, rel=1e-4)
    assert modulus.band_pa[0] < 7e3 < modulus.band_pa[1]
    assert found.correlation.shape == (1, 1) and len(found.residuals) % 3 == 0


def test_what_is_neither_a_point_nor_a_tool_is_refused() -> None:
    with pytest.raises(yawara.Error, match=r"measured\[0\]: want either a point or a tool"):
        yawara.identify("beam", [yawara.Measurement(0.1, [0.0, None, None])], settings=SETTINGS)


def test_a_nodule_is_felt() -> None:
    labels = np.ones((12, 12, 12), dtype=np.int64)
    labels[4:8, 4:8, 9:11] = 2
    scene = {
        "name": "pad",
        "materials": [
            {"label": 1, "young_modulus_pa": 5e3, "poisson_ratio": 0.45},
            {"label": 2, "young_modulus_pa": 5e4, "poisson_ratio": 0.45},
        ],
        "mesh": {"base_mm": 20.0, "start_level": 3},
        "fixed": [{"shape": "box", "min": [0.0, 0.0, 0.0], "max": [1.0, 1.0, 0.1]}],
        "time": {"steps": 1, "step_s": 0.1},
    }
    affine = np.diag([5.0, 5.0, 5.0, 1.0])
    skin = yawara.feel(scene, points=400, radius_m=8e-3, nodule=(1, 0), labels=labels, affine=affine)
    assert skin.without_n_m is not None and len(skin.positions) == len(skin.stiffness_n_m) > 100
    gain = skin.stiffness_n_m / skin.without_n_m
    at = skin.positions[np.argmax(gain)]
    assert gain.max() > 1.1 and skin.normals[np.argmax(gain)][2] > 0.9
    assert np.abs(at[:2] - skin.positions[:, :2].mean(axis=0)).max() < 0.015
