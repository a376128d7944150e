"""The inverse of a symmetric sparse matrix, kept while the matrix changes."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse

from . import _yawara
from .simulation import _matrix, _numbers


class SparseInverse:
    """K^-1 of a symmetric sparse K (a matrix of SciPy), positive definite, or quasi-definite with the last `negative` of the
    `block` rows of each block belonging to its negative part.

    Blocks are numbered from 0. `places` (size, 3), integers from 0 to 2^21 - 1, all different, are where blocks lie: those of
    a mesh are eliminated faster with them than without. `method` is `sparse`, a factor that is patched; `woodbury`, a dense
    inverse; or another maintainer of the crate yawara-inverse-update. Both keep a solution's residual at rounding.
    """

    def __init__(
        self, k: Any, *, block: int = 1, negative: int = 0, places: Any = None, method: str = "sparse"
    ) -> None:
        k = scipy.sparse.coo_array(k)
        if k.shape[0] != k.shape[1] or block < 1 or k.shape[0] % block:
            raise _yawara.Error(f"k is {k.shape[0]} x {k.shape[1]}, want square with a multiple of {block} rows")
        rows, columns = (np.ascontiguousarray(index, dtype=np.int64) for index in k.coords)
        self._native = _yawara.Inverse(
            k.shape[0] // block,
            rows,
            columns,
            np.ascontiguousarray(k.data, dtype=float),
            block=block,
            negative=negative,
            places=None if places is None else [[int(x) for x in place] for place in places],
            method=method,
        )

    @property
    def method(self) -> str:
        """The name of the method."""
        return self._native.method

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of K."""
        rows = self._native.size * self._native.block
        return rows, rows

    def matrix(self) -> scipy.sparse.bsr_array:
        """K as it is now."""
        return _matrix(self._native.matrix())

    def solve(self, f: Any) -> np.ndarray:
        """K^-1 f of a vector or of the columns of a matrix."""
        f = np.asarray(f, dtype=float)
        return self._native.solve(f) if f.ndim == 1 else self._native.solve_many(f)

    def columns(self, blocks: Any) -> np.ndarray:
        """The columns of K^-1 that belong to these blocks."""
        return self._native.columns(_numbers(blocks))

    def update(self, blocks: Any, added: Any = None, removed: Any = None) -> None:
        """K <- K + A A^T - R R^T on the rows of these blocks: A and R have so many rows, and few columns."""
        blocks = _numbers(blocks)
        none = np.zeros((len(blocks) * self._native.block, 0))
        self._native.update(blocks, none if added is None else added, none if removed is None else removed)

    def append(self, blocks: Any, coupling: Any, diagonal: Any) -> int:
        """Adds a block with `diagonal` (b, b), coupled to the rows of `blocks` by `coupling` (rows, b); returns its number, the
        last."""
        return self._native.append(_numbers(blocks), coupling, diagonal)

    def remove(self, block: int) -> int | None:
        """Takes a block out; the last block takes its number, which was the one returned (None if it was the last itself)."""
        return self._native.remove(block)

    def rebuild(self) -> None:
        """Inverts K afresh."""
        self._native.rebuild()

    def watch(self, seed: int = 0) -> float:
        """By how much K K^-1 f misses f for random f, where something has changed since the last inversion; inverts afresh
        where that is too much."""
        return self._native.watch(seed)
