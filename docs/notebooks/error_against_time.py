# %% [markdown]
# # Error against time
# The beam with uniform meshes and with one that refines where its indicator asks for it: what force they find, how far
# they say it is off, and how far it is off from the finest.

# %%
import time

import yawara


def run(name, settings):
    simulation = yawara.Simulation("beam", {"time.steps": 8, "mesh.max_vertices": 8000, **settings})
    begin = time.perf_counter()
    reports = simulation.run()
    wall = (time.perf_counter() - begin) / len(reports)
    assert all(report.converged for report in reports)
    return name, reports[-1].vertices, 1e3 * wall, reports[-1].tools[0].force_n[2], reports[-1].tools[0].force_error_n


uniform = [run(f"uniform {level}", {"mesh.start_level": level, "mesh.max_level": level}) for level in (0, 3, 5)]
adaptive = run("adaptive", {"mesh.max_level": 7})
reference = run("reference", {"mesh.start_level": 7, "mesh.max_level": 7})

# %%
errors = {}
for name, vertices, wall, force, said in [*uniform, adaptive]:
    errors[name] = abs(force / reference[3] - 1)
    print(f"{name:10} {vertices:6} vertices {wall:8.2f} ms a step  {force:.4f} N  off by {100 * errors[name]:.1f} %")
assert errors["uniform 5"] < errors["uniform 3"] < errors["uniform 0"] and errors["adaptive"] < errors["uniform 0"]
