"""A simulation from Python: what it gives, what it refuses, and stages of one's own."""

import numpy as np
import pytest
import yawara
from yawara import Error, Simulation


def test_steps_arrays_and_tools_of_a_built_in_scene():
    simulation = Simulation("beam", ["time.steps=3", "mesh.max_level=3"])
    report = simulation.step()
    assert report.converged and report.step == 1 and simulation.steps_left == 2
    n, m = report.vertices, report.tetrahedra
    assert simulation.positions.shape == (n, 3) and simulation.tetrahedra.shape == (m, 4)
    corners = simulation.positions[simulation.tetrahedra]
    edges = corners[:, 1:] - corners[:, :1]
    assert (np.linalg.det(edges) > 0).all() and set(simulation.labels) == {1}
    assert simulation.stress.shape == (m,) and simulation.energy_j > 0
    grab = simulation.tools["grab"]
    assert np.array_equal(simulation.forces[0], grab.force) and simulation.contacts[0] > 0
    grab.pose = np.array([0.0, 0.0, 0.01]), np.int64(5)
    assert simulation.step().converged
    move, turn = grab.pose
    assert np.allclose(move, [0, 0, 0.01]) and turn == 5
    grab.pose = [0.0, 0.0, 0.01]
    assert simulation.step().converged and grab.pose[1] == 0
    # A force that grows with the displacement.
    assert np.linalg.eigvalsh(grab.stiffness).min() > 0
    assert simulation.summary["mesh"]["vertices"]["end"] == len(simulation.positions)
    assert any(not row["runs"] for row in simulation.plan)


def test_the_kept_inverse_solves_what_scipy_solves():
    import scipy.sparse.linalg

    simulation = Simulation("beam", {"mesh.max_level": 4, "stages.element": "p1", "support.hold": "vertices"})
    simulation.step()
    k, slots = simulation.stiffness(), simulation.slots
    assert abs(k - k.T).max() == 0
    forces = np.random.default_rng(1).normal(size=(len(slots), 3))
    axes = simulation.axes
    right = np.zeros(k.shape[0])
    for vertex, slot in enumerate(slots):
        if slot >= 0:
            right[3 * slot : 3 * slot + 3] = axes.T @ forces[vertex]
    solved = scipy.sparse.linalg.spsolve(k.tocsc(), right)
    moved = simulation.solve(forces)
    assert np.abs(moved[slots < 0]).max(initial=0) == 0
    for vertex, slot in enumerate(slots):
        if slot >= 0:
            assert np.allclose(axes @ solved[3 * slot : 3 * slot + 3], moved[vertex], atol=1e-9 * np.abs(moved).max())


def test_splits_and_merges_by_hand():
    simulation = Simulation("beam", {"mesh.max_level": 3, "refinement.split_above": 1e30})
    before = len(simulation.positions)
    came = simulation.split(np.arange(len(simulation.tetrahedra)))
    assert came > 0 and len(simulation.positions) == before + came
    assert simulation.step().converged
    with pytest.raises(Error, match="tetrahedra"):
        simulation.split([10**6])


def test_labels_of_numpy_as_a_body():
    labels = np.zeros((20, 8, 8), dtype=np.uint8)
    labels[1:19, 1:7, 1:7] = 1
    labels[8:12, 2:5, 2:5] = 2
    scene = {
        "name": "mine",
        "materials": [
            {"label": 1, "young_modulus_pa": 5e3, "poisson_ratio": 0.3},
            {"label": 2, "young_modulus_pa": 5e4, "poisson_ratio": 0.3},
        ],
        "mesh": {"base_mm": 12.0, "max_level": 3},
        "time": {"steps": 2, "step_s": 0.1},
        "fixed": [{"shape": "box", "min": [0, 0, 0], "max": [0.05, 1, 1]}],
        "tools": [
            {
                "kind": "grab",
                "region": {"shape": "box", "min": [0.9, 0, 0], "max": [1, 1, 1]},
                "path": [{"time_s": 0}, {"time_s": 0.2, "move_m": [0.004, 0, 0]}],
            }
        ],
    }
    simulation = Simulation(scene, labels=labels, spacing_mm=3.0)
    reports = simulation.run()
    assert [report.converged for report in reports] == [True, True]
    assert reports[-1].tools[0].force_n[0] > 0.1
    # Turned by 90 degrees and elsewhere: the long axis is the scanner's second.
    affine = np.array([[0, -3.0, 0, 50], [3.0, 0, 0, -20], [0, 0, 3.0, 7], [0, 0, 0, 1]])
    turned = Simulation(scene, labels=labels, affine=affine).positions
    low, high = turned.min(axis=0), turned.max(axis=0)
    middle = affine @ [9.5, 3.5, 3.5, 1]
    assert np.allclose((low + high) / 2, 1e-3 * middle[:3], atol=3e-3)
    assert (high - low)[1] > 2 * (high - low)[0]
    with pytest.raises(Error, match="affine"):
        Simulation(scene, labels=labels, spacing_mm=3.0, affine=affine)
    with pytest.raises(Error, match="dictionary"):
        Simulation("liver", labels=labels, spacing_mm=3.0)


def test_refusals_name_the_key_and_the_limit(tmp_path):
    with pytest.raises(Error, match="liver_ct"):
        Simulation("livr")
    with pytest.raises(Error, match="mesh.max_levl"):
        Simulation("beam", {"mesh.max_levl": 3})
    with pytest.raises(ValueError, match="poisson_ratio"):
        Simulation("beam", ["materials.0.poisson_ratio=0.7"])
    with pytest.raises(OSError):
        Simulation(tmp_path / "none.toml")
    with pytest.raises(KeyError, match="scalpel"):
        Simulation("beam").tools["scalpel"]
    assert "beam" in yawara.scenes() and yawara.materials()[0]["source"]


class Voigt:
    """The mean of the halves."""

    name = "voigt"

    def __init__(self):
        self.calls = 0

    def combine(self, elasticity, gradients):
        assert elasticity.shape == (2, 6, 6) and gradients.shape == (2, 3)
        self.calls += 1
        return elasticity.mean(axis=0)


def force(**stages):
    settings = {"time.steps": 2, "mesh.max_level": 0, "image.voxel_mm": 7.0, "stages.homogenisation": "linear"}
    return Simulation("liver", settings, **stages).run()[-1].tools[0].force_n


def test_a_homogenisation_in_python_is_the_one_in_rust():
    own = Voigt()
    mine, built_in = force(homogenisation=own), force()
    assert own.calls > 100
    assert np.allclose(mine, built_in, rtol=1e-3)


def test_an_indicator_and_a_law_in_python():
    class Strain:
        name, unit = "strain", "1"

        def measure(self, strain, volume_m3, elasticity, edge_m):
            assert strain.shape == (len(volume_m3), 6) and elasticity.shape[1:] == (6, 6) and edge_m.shape == (3,)
            return float(np.abs(strain).max())

    settings = {"time.steps": 2, "mesh.max_level": 3, "refinement.split_above": 1e-3}
    refined = Simulation("beam", settings, indicator=Strain()).run()
    assert sum(report.splits for report in refined) > 0

    class Hooke:
        name = "hooke"

        def stress(self, strain, elasticity, state, step_s):
            return elasticity @ strain

        def tangent(self, strain, elasticity, state, step_s):
            return elasticity

    still = {"time.steps": 2, "mesh.max_level": 0, "stages.law": "linear", "stages.element": "p1"}
    built_in, mine = (Simulation("beam", still, **law).run()[-1] for law in ({}, {"law": Hooke()}))
    assert mine.converged and np.allclose(mine.tools[0].force_n, built_in.tools[0].force_n, rtol=1e-4)


def test_tools_in_python():
    class Pull:
        name = "pull"

        def loads(self, time_s, rest, positions):
            forces = np.zeros_like(rest)
            end = rest[:, 0] > rest[:, 0].max() - 1e-9
            forces[end] = [0, 0, -0.01 / end.sum()]
            return forces

    settings = {"mesh.max_level": 0, "time.steps": 1}
    simulation = Simulation("beam", settings, tools=[Pull()])
    report = simulation.step()
    assert report.converged and simulation.tools["pull"].force == pytest.approx([0, 0, -0.01], abs=1e-9)

    class Nothing:
        name = "nothing"

    with pytest.raises(Error, match="loads"):
        Simulation("beam", settings, tools=[Nothing()])


def test_what_a_stage_raises_ends_the_simulation():
    class Wrong:
        def combine(self, elasticity, gradients):
            raise RuntimeError("not today")

    with pytest.raises(RuntimeError, match="not today"):
        force(homogenisation=Wrong())

    class Late:
        name = "late"

        def loads(self, time_s, rest, positions):
            return np.zeros((1, 3))

    with pytest.raises(Error, match="one per vertex"):
        Simulation("beam", {"mesh.max_level": 0}, tools=[Late()]).step()


def test_a_frame_as_a_mesh_of_meshio(tmp_path):
    meshio = pytest.importorskip("meshio")
    simulation = Simulation("beam", {"mesh.max_level": 0})
    simulation.step()
    mesh = simulation.frame.to_meshio()
    meshio.write(tmp_path / "frame.vtu", mesh)
    again = meshio.read(tmp_path / "frame.vtu")
    assert np.allclose(again.points, simulation.positions) and "von_mises_pa" in again.cell_data


def test_progress_can_stop_a_simulation_that_is_being_made():
    class Enough(Exception):
        pass

    def stop(part, fraction):
        raise Enough(part)

    with pytest.raises(Enough):
        Simulation("beam", progress=stop)
