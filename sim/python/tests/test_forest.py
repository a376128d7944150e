"""The bisection forest by itself."""

import numpy as np
import pytest
from yawara import BisectionForest, Error


def forest(**keys):
    labels = np.zeros((16, 16, 8), dtype=np.int32)
    labels[:] = 5
    labels[4:9, 4:9, :] = 9
    return BisectionForest(labels, np.diag([2.0, 2.0, 2.0, 1.0]), **keys)


def volume(mesh):
    corners = mesh.positions[mesh.tetrahedra]
    return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 6


def test_it_stays_conforming_and_whole():
    mesh = forest(max_level=9)
    whole = 32e-3 * 32e-3 * 16e-3
    random = np.random.default_rng(5)
    for _ in range(20):
        before = mesh.vertex_count
        came = mesh.split(random.choice(mesh.tetrahedron_count, 5))
        assert mesh.vertex_count == before + came
        assert np.isclose(volume(mesh).sum(), whole)
        # A face belongs to two tetrahedra or lies on the outside.
        faces = np.sort(np.concatenate([np.delete(mesh.tetrahedra, i, axis=1) for i in range(4)]), axis=1)
        unique, counts = np.unique(faces, axis=0, return_counts=True)
        assert counts.max() == 2
        x = mesh.positions[unique[counts == 1]]
        low, high = mesh.positions.min(axis=0), mesh.positions.max(axis=0)
        assert (np.isclose(x, low).all(axis=1) | np.isclose(x, high).all(axis=1)).any(axis=1).all()
        mesh.merge(random.choice(mesh.vertex_count, 10))
    while mesh.merge(np.arange(mesh.vertex_count)):
        pass
    fresh = forest(max_level=9)
    assert mesh.vertex_count == fresh.vertex_count and np.allclose(mesh.positions, fresh.positions)


def test_labels_and_levels():
    mesh = forest(start_level=3, max_level=9)
    assert set(mesh.levels) == {3} and set(mesh.labels) <= {5, 9}
    while mesh.is_mixed.any() and mesh.levels.max() < 9:
        mesh.split(np.flatnonzero(mesh.is_mixed))
    nine = volume(mesh)[mesh.labels == 9].sum()
    assert np.isclose(nine, 5 * 5 * 8 * 8e-9, rtol=0.05)


def test_refusals():
    with pytest.raises(Error, match="power of 2"):
        forest(voxels_per_cell=3)
    with pytest.raises(Error, match="none of"):
        forest().split([10**6])
    with pytest.raises(Error):
        BisectionForest(np.zeros((4, 4, 4), dtype=int), np.eye(4))
    with pytest.raises(Error):
        BisectionForest(np.ones((4, 4, 4)), np.zeros((4, 4)))
