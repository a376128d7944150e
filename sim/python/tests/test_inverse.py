"""The kept inverse on matrices of one's own, against SciPy."""

import numpy as np
import pytest
import scipy.sparse
import scipy.sparse.linalg
from yawara import Error, SparseInverse


def laplacian(n):
    """A grid of n x n springs, held by weak springs to the ground."""
    line = scipy.sparse.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    eye = scipy.sparse.eye(n)
    return (scipy.sparse.kron(line, eye) + scipy.sparse.kron(eye, line) + 0.01 * scipy.sparse.eye(n * n)).tocsr()


@pytest.mark.parametrize("method", ["sparse", "woodbury", "lu"])
def test_random_changes_against_a_fresh_factor(method):
    random = np.random.default_rng(7)
    k = laplacian(12)
    inverse = SparseInverse(k, method=method)
    dense = k.toarray()
    for _ in range(60):
        n = dense.shape[0]
        blocks = random.choice(n, size=4, replace=False)
        match random.integers(3):
            case 0:
                added = random.normal(size=(4, 2))
                inverse.update(blocks, added)
                dense[np.ix_(blocks, blocks)] += added @ added.T
            case 1:
                coupling = random.normal(size=(4, 1))
                diagonal = [[10.0 + random.random()]]
                # As stiff as to stay positive definite.
                inverse.update(blocks, np.eye(4) * 2)
                dense[np.ix_(blocks, blocks)] += 4 * np.eye(4)
                assert inverse.append(blocks, coupling, diagonal) == n
                bordered = np.zeros((n + 1, n + 1))
                bordered[:n, :n] = dense
                bordered[blocks, n] = bordered[n, blocks] = coupling[:, 0]
                bordered[n, n] = diagonal[0][0]
                dense = bordered
            case _:
                gone = int(blocks[0])
                moved = inverse.remove(gone)
                assert moved == (None if gone == n - 1 else n - 1)
                order = [n - 1 if i == gone else i for i in range(n - 1)]
                dense = dense[np.ix_(order, order)]
        f = random.normal(size=dense.shape[0])
        expected = np.linalg.solve(dense, f)
        assert np.allclose(inverse.solve(f), expected, rtol=0, atol=1e-9 * np.abs(expected).max())
    assert inverse.method == method and inverse.shape == dense.shape
    assert np.abs(inverse.matrix().toarray() - dense).max() < 1e-9
    assert np.allclose(inverse.columns([3, 0]), np.linalg.inv(dense)[:, [3, 0]], atol=1e-9)
    loads = random.normal(size=(dense.shape[0], 3))
    assert np.allclose(dense @ inverse.solve(loads), loads, atol=1e-8)
    assert inverse.watch(1) < 1e-7


def test_a_saddle_point_of_blocks():
    """Blocks of two rows with one negative pivot each: quasi-definite."""
    random = np.random.default_rng(3)
    n = 30
    k = scipy.sparse.lil_array((2 * n, 2 * n))
    for i in range(n):
        k[2 * i, 2 * i], k[2 * i + 1, 2 * i + 1] = 4.0 + random.random(), -2.0 - random.random()
        if i + 1 < n:
            for a, b in [(0, 0), (1, 0), (0, 1)]:
                k[2 * i + a, 2 * i + 2 + b] = k[2 * i + 2 + b, 2 * i + a] = random.normal() * 0.5
    inverse = SparseInverse(k, block=2, negative=1)
    f = random.normal(size=2 * n)
    assert np.allclose(k @ inverse.solve(f), f, atol=1e-10)


def test_places_change_nothing_but_the_order():
    k = laplacian(20)
    places = [[i, j, 0] for i in range(20) for j in range(20)]
    f = np.arange(400.0)
    assert np.allclose(SparseInverse(k).solve(f), SparseInverse(k, places=places).solve(f), rtol=1e-10)


def test_refusals():
    with pytest.raises(Error, match="square"):
        SparseInverse(scipy.sparse.csr_array(np.ones((2, 3))))
    with pytest.raises(Error):
        SparseInverse(-scipy.sparse.eye_array(4))
    with pytest.raises(Error):
        SparseInverse(scipy.sparse.csr_array([[2.0, 1.0], [0.0, 2.0]]))
    with pytest.raises(Error, match="woodbury"):
        SparseInverse(scipy.sparse.eye_array(4), method="magic")
    inverse = SparseInverse(scipy.sparse.eye_array(4))
    with pytest.raises(Error):
        inverse.solve(np.ones(5))
    with pytest.raises(Error):
        inverse.solve([1.0, np.nan, 0.0, 0.0])
    with pytest.raises(Error):
        inverse.remove(9)
    # A change that would make it singular leaves all as it was.
    with pytest.raises(Error):
        inverse.update([0], removed=[[1.0]])
    assert np.allclose(inverse.solve(np.ones(4)), 1.0)
