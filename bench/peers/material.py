"""Two laws of large displacements: energy's first and second derivative by F, many points at once.

Both have linear elasticity's moduli at rest. F is (n, 3, 3); λ and μ are (n,), in Pa.
"""

from collections.abc import Callable

import numpy as np

Law = Callable[[np.ndarray, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]

PERMUTATION = np.zeros((3, 3, 3))
for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    PERMUTATION[i, j, k], PERMUTATION[j, i, k] = 1.0, -1.0
IDENTITY = np.eye(3)


def polar(f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R and S of F = R S, with det R = 1."""
    u, s, vt = np.linalg.svd(f)
    sign = np.sign(np.linalg.det(u @ vt))
    u[:, :, 2] *= sign[:, None]
    s[:, 2] *= sign
    rotation = u @ vt
    return rotation, np.einsum("nji,nj,njk->nik", vt, s, vt)


def corotated(f: np.ndarray, lam: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """W = μ‖F − R‖² + λ/2 tr(S − 1)²: P (n, 3, 3) and ∂P/∂F (n, 9, 9). What Yawara solves.

    δR = R [ω]×, (tr S − S) ω = the axis of RᵀδF − δFᵀR, is exact; it is what the
    stiffness matrix of a tetrahedron turned by R leaves out, without changing the equilibrium.
    """
    rotation, stretch = polar(f)
    trace = np.trace(stretch, axis1=1, axis2=2)
    strain = trace - 3.0
    stress = 2 * mu[:, None, None] * (f - rotation) + (lam * strain)[:, None, None] * rotation
    turn = np.einsum("nim,mjp->nijp", rotation, PERMUTATION).reshape(-1, 9, 3)
    inner = np.linalg.inv(trace[:, None, None] * IDENTITY - stretch)
    r = rotation.reshape(-1, 9)
    tangent = (lam * strain - 2 * mu)[:, None, None] * (turn @ inner @ turn.transpose(0, 2, 1))
    tangent += lam[:, None, None] * r[:, :, None] * r[:, None, :]
    tangent[:, range(9), range(9)] += 2 * mu[:, None]
    return stress, tangent


def st_venant_kirchhoff(
    f: np.ndarray, lam: np.ndarray, mu: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """W = μ‖E‖² + λ/2 (tr E)², E = (FᵀF − 1)/2: P (n, 3, 3) and ∂P/∂F (n, 9, 9)."""
    green = 0.5 * (f.transpose(0, 2, 1) @ f - IDENTITY)
    second = 2 * mu[:, None, None] * green
    second += (lam * np.trace(green, axis1=1, axis2=2))[:, None, None] * IDENTITY
    flat = f.reshape(-1, 9)
    left = f @ f.transpose(0, 2, 1)
    tangent = np.einsum("ik,njl->nijkl", IDENTITY, second)
    tangent += np.einsum("n,nik,jl->nijkl", mu, left, IDENTITY)
    tangent += np.einsum("n,nil,nkj->nijkl", mu, f, f)
    tangent = tangent.reshape(-1, 9, 9)
    tangent += lam[:, None, None] * flat[:, :, None] * flat[:, None, :]
    return f @ second, tangent


LAWS: dict[str, Law] = {"co-rotated": corotated, "StVK": st_venant_kirchhoff}
