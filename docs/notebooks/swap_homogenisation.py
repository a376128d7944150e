# %% [markdown]
# # Swap a homogenisation
# How material finer than the mesh acts in it is a stage. The bounds of Voigt (halves in parallel) and Reuss (in series),
# written here, enclose what the rule `laminate` finds on the same coarse mesh.

# %%
import numpy as np
import yawara


class Voigt:
    name = "voigt"

    def combine(self, elasticity, gradients):
        return elasticity.mean(axis=0)


class Reuss:
    name = "reuss"

    def combine(self, elasticity, gradients):
        return np.linalg.inv(np.linalg.inv(elasticity).mean(axis=0))


def force(**stage):
    settings = {"time.steps": 2, "mesh.max_level": 0, "stages.element": "p1"}
    report = yawara.Simulation("liver", settings, **stage).run()[-1]
    assert report.converged
    return float(np.linalg.norm(report.tools[0].force_n))


# %%
upper, lower, laminate = force(homogenisation=Voigt()), force(homogenisation=Reuss()), force()
print(f"Reuss {lower:.4f} N <= laminate {laminate:.4f} N <= Voigt {upper:.4f} N")
assert lower <= laminate * (1 + 1e-3) and laminate <= upper * (1 + 1e-3)
