# %% [markdown]
# # A probe over a nodule
# The force on a ball pressed into a soft block, with a stiff ball in it at several depths: the deeper, the less it is felt.

# %%
import numpy as np
import yawara

x, y, z = np.meshgrid(*(np.arange(32),) * 3, indexing="ij")


def force(depth_voxels):
    labels = np.ones(x.shape, dtype=int)
    if depth_voxels is not None:
        labels[(x - 15.5) ** 2 + (y - 15.5) ** 2 + (z - (31 - depth_voxels)) ** 2 <= 25] = 2
    labels = np.pad(labels, 2)
    scene = {
        "name": "nodule",
        "materials": [{"label": 1, "young_modulus_pa": 5e3, "poisson_ratio": 0.4}, {"label": 2, "young_modulus_pa": 1e5, "poisson_ratio": 0.4}],
        "mesh": {"base_mm": 16.0, "start_level": 3, "max_level": 6},
        "refinement": {"split_above": 1e30},
        "time": {"steps": 2, "step_s": 0.5},
        "fixed": [{"shape": "box", "min": [0, 0, 0], "max": [1, 1, 0.05]}],
        "tools": [{"kind": "probe", "centre_mm": [35.0, 35.0, 77.0], "radius_m": 0.01, "path": [{"time_s": 0}, {"time_s": 1, "move_m": [0, 0, -0.007]}]}],
    }
    if depth_voxels is None:
        scene["materials"].pop()
    reports = yawara.Simulation(scene, labels=labels, spacing_mm=2.0).run()
    assert all(report.converged for report in reports)
    return -reports[-1].tools[0].force_n[2]


# %%
depths = [7, 11, 15]
forces = [force(depth) for depth in depths]
without = force(None)
for depth, found in zip(depths, forces):
    print(f"middle {2 * depth} mm deep: {found:.4f} N, {100 * (found / without - 1):.1f} % more than without")
assert forces[0] > forces[1] > forces[2] > without > 0
