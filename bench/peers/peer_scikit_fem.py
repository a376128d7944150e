"""scikit-fem: P1 and P2 tetrahedra on Yawara's meshes, total Lagrangian, by Newton's method."""

from functools import partial

from case import Candidate, TetMesh

NEEDS = {"skfem": "scikit-fem", "scipy": "scipy"}
"""Modules and the packages that bring them."""


def candidates(meshes: list[TetMesh], quick: bool) -> list[Candidate]:
    """P1 by both laws on all meshes; P2 on all but the finest, which the reference has."""
    from total_lagrangian import equilibrium

    equilibrium(meshes[0], 1, "StVK")  # what is loaded at first use is nobody's time
    found = []
    for mesh in meshes:
        for degree in (1, 2):
            if degree == 2 and mesh.level == meshes[-1].level:
                continue
            for law in ("co-rotated", "StVK"):
                solve = partial(equilibrium, mesh, degree, law)
                found.append(Candidate(f"scikit-fem P{degree}", law, mesh, solve))
    return found
