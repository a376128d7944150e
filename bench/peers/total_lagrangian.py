"""Newton's method at rest coordinates, on scikit-fem's meshes, elements and quadrature.

scikit-fem's own assembly evaluates a form once per pair of a tetrahedron's unknowns, 900 times for
P2; here all pairs of a tetrahedron are one product of matrices, which is what a peer at its best
would take.
"""

import logging
import time

import numpy as np
import scipy.sparse as sparse
from case import DENSITY_KG_M3, GRAVITY_M_S2, RESIDUAL, Failure, Solution, TetMesh, at_ends
from material import LAWS
from skfem import Basis, ElementTetP1, ElementTetP2, MeshTet
from two_level import TwoLevel

logging.getLogger("skfem").setLevel(logging.ERROR)

CHUNK = 4096
"""Tetrahedra whose matrices are made at once: what fits into caches."""


class Body:
    """A discretised body: `degree` 1 or 2, one of `LAWS`. Vertices come first among the nodes."""

    def __init__(self, mesh: TetMesh, degree: int, law: str) -> None:
        element = ElementTetP1() if degree == 1 else ElementTetP2()
        basis = Basis(MeshTet(mesh.points.T, mesh.tets.T), element, intorder=2 * (degree - 1))
        self.law = LAWS[law]
        self.vertices = len(mesh.points)
        self.nodes = basis.element_dofs.T
        functions = range(self.nodes.shape[1])
        # (tets, points, nodes, 3)
        self.gradients = np.stack(
            [basis.basis[i][0].grad.transpose(1, 2, 0) for i in functions], axis=2
        )
        self.weights = basis.dx
        self.lam, self.mu = mesh.lame()
        places = basis.doflocs
        self.free = np.flatnonzero(~at_ends(places.T))
        self.load = np.zeros((places.shape[1], 3))
        for i in functions:
            share = (np.broadcast_to(basis.basis[i][0].value, basis.dx.shape) * basis.dx).sum(1)
            np.subtract.at(self.load[:, 2], self.nodes[:, i], DENSITY_KG_M3 * GRAVITY_M_S2 * share)
        self._pattern()

    def _pattern(self) -> None:
        """Where every 3 × 3 block of a tetrahedron's matrix goes among those of free nodes."""
        number = np.full(len(self.load), -1)
        number[self.free] = np.arange(len(self.free))
        local = number[self.nodes]
        count = local.shape[1]
        rows, columns = np.repeat(local, count, axis=1).ravel(), np.tile(local, (1, count)).ravel()
        self.kept = np.flatnonzero((rows >= 0) & (columns >= 0))
        keys = rows[self.kept] * len(self.free) + columns[self.kept]
        keys, self.slots = np.unique(keys, return_inverse=True)
        self.columns = keys % len(self.free)
        self.starts = np.searchsorted(keys, np.arange(len(self.free) + 1) * len(self.free))

    def forces_and_tangent(self, u: np.ndarray) -> tuple[np.ndarray, sparse.bsr_matrix]:
        """Inner forces (nodes, 3) in N at displacements `u` (nodes, 3), and K of the free nodes."""
        tets, points, count, _ = self.gradients.shape
        forces = np.zeros_like(u)
        blocks = np.empty((tets, count, 3, count, 3))
        for begin in range(0, tets, CHUNK):
            part = slice(begin, begin + CHUNK)
            gradients, nodes = self.gradients[part], self.nodes[part]
            some = len(nodes)
            moved = u[nodes].transpose(0, 2, 1)[:, None]
            f = (moved @ gradients + np.eye(3)).reshape(-1, 3, 3)
            lam, mu = (np.repeat(m[part], points) for m in (self.lam, self.mu))
            stress, tangent = self.law(f, lam, mu)
            weights = self.weights[part].reshape(-1)
            stress *= weights[:, None, None]
            tangent *= weights[:, None, None]
            flat = gradients.reshape(-1, count, 3)
            each = (flat @ stress.transpose(0, 2, 1)).reshape(some, points, count, 3).sum(1)
            np.add.at(forces, nodes, each)
            # B of F = 1 + B u: rows i J, columns node i'.
            b = np.einsum("gaJ,ik->giJak", flat, np.eye(3)).reshape(-1, 9, 3 * count)
            full = (b.transpose(0, 2, 1) @ (tangent @ b)).reshape(some, points, -1).sum(1)
            blocks[part] = full.reshape(some, count, 3, count, 3)
        ordered = blocks.transpose(0, 1, 3, 2, 4).reshape(-1, 9)[self.kept]
        data = np.stack(
            [np.bincount(self.slots, ordered[:, c], len(self.columns)) for c in range(9)], axis=1
        )
        matrix = sparse.bsr_matrix((data.reshape(-1, 3, 3), self.columns, self.starts))
        return forces, matrix

    def interpolation(self) -> sparse.csr_matrix:
        """From free vertices to all free nodes: a node in the middle of an edge is their mean."""
        ends = ((4, 0, 1), (5, 1, 2), (6, 0, 2), (7, 0, 3), (8, 1, 3), (9, 2, 3))
        vertices = self.free[self.free < self.vertices]
        rows, columns, values = [vertices], [vertices], [np.ones(len(vertices))]
        pairs = np.vstack([self.nodes[:, list(edge)] for edge in ends])
        _, first = np.unique(pairs[:, 0], return_index=True)
        for end in (1, 2):
            rows.append(pairs[first, 0])
            columns.append(pairs[first, end])
            values.append(np.full(len(first), 0.5))
        whole = sparse.csr_matrix(
            (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))),
            shape=(len(self.load), self.vertices),
        )
        return sparse.kron(whole[self.free][:, vertices], np.eye(3), format="csr")


def equilibrium(mesh: TetMesh, degree: int, law: str, most: int = 25) -> Solution:
    """Static equilibrium from rest: full load and full steps, the first of which overshoots.

    P1 is solved by SuperLU (scikit-fem's default), P2 by conjugate gradients, preconditioned by P1.
    Raises `Failure` where `most` steps do not reach the residual.
    """
    begin = time.perf_counter()
    body = Body(mesh, degree, law)
    ready = time.perf_counter()
    u = np.zeros_like(body.load)
    weight = np.linalg.norm(body.load[body.free])
    solver = TwoLevel(body.interpolation()) if degree == 2 else None
    forces, matrix = body.forces_and_tangent(u)
    out_of_balance = (body.load - forces)[body.free].ravel()
    for iteration in range(most):
        residual = np.linalg.norm(out_of_balance) / weight
        if residual <= RESIDUAL:
            done = time.perf_counter()
            moved = u[: body.vertices]
            return Solution(
                moved, 3 * len(body.free), ready - begin, done - ready, residual, iteration
            )
        if solver:
            step = solver.solve(matrix, out_of_balance)
        else:
            lower = sparse.linalg.splu(
                matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
            )
            step = lower.solve(out_of_balance)
        u[body.free] += step.reshape(-1, 3)
        forces, matrix = body.forces_and_tangent(u)
        out_of_balance = (body.load - forces)[body.free].ravel()
        if not np.isfinite(out_of_balance).all():
            raise Failure(f"{law} P{degree}: not finite after {iteration + 1} Newton steps")
    raise Failure(f"{law} P{degree}: residual {residual:.1e} after {most} Newton steps")
