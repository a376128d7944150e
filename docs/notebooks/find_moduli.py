# %% [markdown]
# # Which moduli has it?
# An ellipsoid with a stiff ball in it is pulled; how points of its skin move and the force are measured, with noise. The moduli
# with which a simulation says the same are found with their bands, and then a fingertip feels for the ball.

# %%
import numpy as np
import yawara

x, y, z = np.meshgrid(*(np.arange(n) for n in (32, 24, 24)), indexing="ij")
labels = (((x - 16) / 15) ** 2 + ((y - 12) / 11) ** 2 + ((z - 12) / 11) ** 2 < 1).astype(int)
labels[(x - 18) ** 2 + (y - 12) ** 2 + (z - 16) ** 2 < 20] = 2
body = {"labels": labels, "affine": np.diag([3.0, 3.0, 3.0, 1.0])}


def scene(soft: float, stiff: float) -> dict:
    return {
        "name": "ellipsoid",
        "materials": [
            {"label": 1, "young_modulus_pa": soft, "poisson_ratio": 0.45},
            {"label": 2, "young_modulus_pa": stiff, "poisson_ratio": 0.45},
        ],
        "mesh": {"base_mm": 24.0, "start_level": 3},
        "time": {"steps": 2, "step_s": 0.1},
        "fixed": [{"shape": "box", "min": [0, 0, 0], "max": [0.2, 1, 1]}],
        "support": {"stiffness_n_m4": 1e11},
        "tools": [
            {
                "kind": "grab",
                "region": {"shape": "box", "min": [0.85, 0, 0], "max": [1, 1, 1]},
                "path": [{"time_s": 0}, {"time_s": 0.2, "move_m": [0.012, 0, 0.01]}],
            }
        ],
    }


# %% [markdown]
# What is measured: here what a simulation with the true moduli does, with noise of .05 mm and .005 N.

# %%
truth = (4e3, 3e4)
real = yawara.Simulation(scene(*truth), **body)
report = real.run()[-1]
frame = real.frame
rest = frame.positions - frame.displacements
index = np.clip(np.round(rest / 3e-3).astype(int), 0, np.array(labels.shape) - 1)
inside = labels[tuple(index.T)] > 0
random = np.random.default_rng(1)
measured = [
    yawara.Measurement(report.time_s, move + random.normal(0, 5e-5, 3), point_m=at, sd=5e-5)
    for at, move in zip(rest[inside], frame.displacements[inside])
]
force = report.tools[0].force_n + random.normal(0, 5e-3, 3)
measured.append(yawara.Measurement(report.time_s, force, tool=0, sd=5e-3))

# %%
found = yawara.identify(scene(8e3, 8e3), measured, **body)
for one, true in zip(found.moduli, truth):
    print(f"label {one.label}: {one.young_modulus_pa:.0f} Pa, 95 % in {one.band_pa[0]:.0f} to {one.band_pa[1]:.0f}; truly {true:.0f}")
    assert one.is_told and abs(np.log(one.young_modulus_pa / true)) < 3 * one.relative_sd
assert found.converged

# %%
skin = yawara.feel(scene(*truth), nodule=(1, 0), points=1000, radius_m=6e-3, **body)
gain = skin.stiffness_n_m / skin.without_n_m - 1
nearest = skin.positions[np.argmax(gain)]
print(f"stiffer by up to {100 * gain.max():.0f} % for the ball, most at {np.round(1e3 * nearest)} mm")
assert gain.max() > 0.05 and nearest[2] > 1e-3 * 3 * 16
