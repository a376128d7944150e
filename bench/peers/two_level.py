"""Conjugate gradients with two levels: Chebyshev's polynomials on P2, a factor on P1."""

import numpy as np
import scipy.sparse as sparse
import scipy.sparse.linalg
from case import Failure

DEGREE = 3
"""Degree of the smoothing polynomial."""
RELATIVE = 1e-4
"""Residual of a linear solve relative to its right-hand side: Newton corrects the rest."""


class TwoLevel:
    """Solves with `interpolation` (fine × coarse); the factor is that of the first matrix."""

    def __init__(self, interpolation: sparse.csr_matrix) -> None:
        self.interpolation = interpolation
        self.coarse = None

    def _prepare(self, matrix: sparse.bsr_matrix) -> None:
        coarse = (self.interpolation.T @ (matrix.tocsr() @ self.interpolation)).tocsc()
        self.coarse = sparse.linalg.splu(
            coarse, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        )
        self.scale = 1 / matrix.diagonal()
        vector = np.random.default_rng(1).normal(size=matrix.shape[0])
        for _ in range(12):
            vector = self.scale * (matrix @ (vector / np.linalg.norm(vector)))
        self.largest = 1.1 * np.linalg.norm(vector)

    def _smooth(self, matrix: sparse.bsr_matrix, x: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Damps what oscillates, eigenvalues from a tenth of the largest on."""
        middle, half = 0.55 * self.largest, 0.45 * self.largest
        sigma = middle / half
        rho = 1 / sigma
        step = self.scale * (b - matrix @ x) / middle
        for _ in range(DEGREE):
            x = x + step
            after = 1 / (2 * sigma - rho)
            residual = self.scale * (b - matrix @ x)
            step = after * rho * step + 2 * after / half * residual
            rho = after
        return x

    def _cycle(self, matrix: sparse.bsr_matrix, b: np.ndarray) -> np.ndarray:
        x = self._smooth(matrix, np.zeros_like(b), b)
        rest = self.interpolation.T @ (b - matrix @ x)
        x += self.interpolation @ self.coarse.solve(rest)
        return self._smooth(matrix, x, b)

    def solve(self, matrix: sparse.bsr_matrix, b: np.ndarray) -> np.ndarray:
        """x with ‖b − K x‖ ≤ `RELATIVE` ‖b‖."""
        if self.coarse is None:
            self._prepare(matrix)
        cycle = sparse.linalg.LinearOperator(matrix.shape, lambda v: self._cycle(matrix, v))
        x, stopped = sparse.linalg.cg(matrix, b, rtol=RELATIVE, maxiter=300, M=cycle)
        if stopped:
            raise Failure("conjugate gradients: no convergence in 300 iterations")
        return x
