# %% [markdown]
# # Your own labels
# Any integer array [x, y, z] with the affine of its image is a body. With nibabel:
# `image = nib.load("labels.nii.gz"); labels, affine = np.asarray(image.dataobj), image.affine`.
# Here an ellipsoid with a stiff ball in it stands for the organ.

# %%
import numpy as np
import yawara

x, y, z = np.meshgrid(*(np.arange(n) for n in (48, 32, 32)), indexing="ij")
labels = (((x - 24) / 22) ** 2 + ((y - 16) / 14) ** 2 + ((z - 16) / 14) ** 2 < 1).astype(int)
labels[(x - 30) ** 2 + (y - 16) ** 2 + (z - 16) ** 2 < 36] = 2
affine = np.diag([2.5, 2.5, 2.5, 1.0])

scene = {
    "name": "ellipsoid",
    "materials": [{"label": 1, "young_modulus_pa": 4e3, "poisson_ratio": 0.45}, {"label": 2, "young_modulus_pa": 4e4, "poisson_ratio": 0.45}],
    "mesh": {"base_mm": 20.0, "max_level": 6},
    "time": {"steps": 5, "step_s": 0.1},
    "fixed": [{"shape": "box", "min": [0, 0, 0], "max": [0.15, 1, 1]}],
    "tools": [{"kind": "probe", "centre_mm": [75.0, 40.0, 90.0], "radius_m": 0.012, "path": [{"time_s": 0}, {"time_s": 0.5, "move_m": [0, 0, -0.012]}]}],
}
simulation = yawara.Simulation(scene, labels=labels, affine=affine)
reports = simulation.run()

# %%
for report in reports:
    print(f"{report.time_s:.1f} s  {report.tools[0].force_n[2]:.3f} N  {report.tools[0].contacts} points  {report.vertices} vertices")
assert all(report.converged for report in reports)
assert reports[-1].tools[0].force_n[2] < -0.01 and set(simulation.labels) >= {1}
