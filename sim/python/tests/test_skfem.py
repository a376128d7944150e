"""The linear problem of an exported mesh, solved elsewhere."""

import numpy as np
import pytest
import scipy.sparse.linalg
from yawara import Simulation


def test_displacements_are_those_of_scikit_fem():
    skfem = pytest.importorskip("skfem")
    from skfem.models.elasticity import lame_parameters, linear_elasticity

    poisson = 0.3
    settings = {
        "mesh.max_level": 4,
        "stages.element": "p1",
        "support.hold": "vertices",
        "materials.0.poisson_ratio": poisson,
    }
    simulation = Simulation("beam", settings)
    simulation.split(np.arange(20))
    # Positions at rest.
    rest = simulation.frame.positions - simulation.frame.displacements
    mesh = skfem.MeshTet(rest.T.copy(), simulation.tetrahedra.T.astype(np.int64))
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTetP1()))
    young = simulation.frame.young_modulus_pa[0]
    k = linear_elasticity(*lame_parameters(young, poisson)).assemble(basis)
    forces = np.random.default_rng(2).normal(size=rest.shape)
    free = simulation.free
    dofs = basis.nodal_dofs[:, free].T.ravel()
    solved = np.zeros_like(rest)
    solved[free] = scipy.sparse.linalg.spsolve(k[dofs][:, dofs].tocsc(), forces[free].ravel()).reshape(-1, 3)
    moved = simulation.solve(forces)
    assert np.abs(moved - solved).max() < 1e-9 * np.abs(solved).max()
