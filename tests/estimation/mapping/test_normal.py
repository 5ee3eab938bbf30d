"""Sparse normal equations, held against dense ones."""

import tracemalloc

import numpy as np
import pytest

from ros_visualise.estimation.mapping.normal import Factor, NormalEquations, Structure

SHARED = 9


def measured(random, views, tags, chain=True, tied=()):
    """Equations of random measurements, and the same as a dense matrix and its right-hand side."""
    sees = [(v, views + t) for v in range(views) for t in range(tags) if random.random() < 0.3]
    links = [*sees, *((v, v + 1) for v in range(views - 1) if chain)]
    links += [(views + a, views + b) for a, b in tied]
    structure = Structure(views, tags, SHARED, np.array(links))
    normal = NormalEquations(structure)
    size = 6 * (views + tags) + SHARED
    J, r = [np.eye(size) * 0.3], [0.3 * random.standard_normal(size)]  # a prior of each number
    blocks = np.arange(views + tags)
    by = np.tile(0.3 * np.eye(6), (len(blocks), 1, 1))
    normal.add(r[0][: 6 * len(blocks)].reshape(-1, 6), [(blocks, by)])
    normal.add(r[0][None, 6 * len(blocks) :], [], 0.3 * np.eye(SHARED)[None])
    for a, b in links:
        parts = [random.standard_normal((1, 8, 6)) for _ in range(2)]
        shared, residual = random.standard_normal((1, 8, SHARED)), random.standard_normal((1, 8))
        normal.add(residual, [(np.array([b]), parts[1]), (np.array([a]), parts[0])], shared)
        dense = np.zeros((8, size))
        dense[:, 6 * a : 6 * a + 6], dense[:, 6 * b : 6 * b + 6] = parts[0][0], parts[1][0]
        dense[:, -SHARED:] = shared[0]
        J.append(dense)
        r.append(residual[0])
    J, r = np.concatenate(J), np.concatenate(r)
    return normal, J.T @ J, J.T @ r


@pytest.mark.parametrize(("views", "tags"), [(1, 1), (2, 3), (5, 40), (40, 7), (30, 50)])
@pytest.mark.parametrize("chain", [True, False])
def test_solution_and_covariances_are_those_of_the_dense_equations(views, tags, chain):
    random = np.random.default_rng(views)
    tied = [(0, tags - 1), (tags // 2, tags - 1)] if tags > 2 else []
    normal, H, b = measured(random, views, tags, chain, tied)
    factor, inverse = Factor(normal), np.linalg.inv(H)
    step = np.concatenate([one.ravel() for one in factor.step()])
    np.testing.assert_allclose(step, -inverse @ b, atol=1e-8)
    found = factor.inverse()
    for block in range(views + tags):
        own = slice(6 * block, 6 * block + 6)
        np.testing.assert_allclose(found.own[block], inverse[own, own], atol=1e-8)
    padded = np.zeros((6 * normal.structure.size,) * 2)
    padded[: len(inverse), : len(inverse)] = inverse
    for key, entry in zip(normal.structure.keys, found.pairs, strict=True):
        a, b = divmod(int(key), normal.structure.size)
        wanted = padded[6 * a : 6 * a + 6, 6 * b : 6 * b + 6]
        np.testing.assert_allclose(entry, wanted, atol=1e-8)


def test_memory_grows_with_sightings_and_not_with_views_times_tags():
    views, tags = 3000, 500  # 430 MB if all of them were linked with each other
    links = [(v, views + t) for v in range(views) for t in range(v // 6, min(v // 6 + 5, tags))]
    links += [(v, v + 1) for v in range(views - 1)]
    tracemalloc.start()
    normal = NormalEquations(Structure(views, tags, SHARED, np.array(links)))
    normal.own += np.eye(6)
    factor = Factor(normal)
    factor.inverse()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 60e6


def test_many_right_hand_sides_are_solved_at_once():
    random = np.random.default_rng(3)
    normal, H, _ = measured(random, 20, 8)
    right = random.standard_normal((normal.structure.size, 6, 5))
    right[-1, SHARED - 6 :] = 0
    found = Factor(normal).solve(right).reshape(-1, 5)
    wanted = np.linalg.solve(H, right.reshape(-1, 5)[: len(H)])
    np.testing.assert_allclose(found[: len(H)], wanted, atol=1e-8)


def test_what_no_measurement_determines_is_reported():
    structure = Structure(2, 1, SHARED, np.array([[0, 2]]))
    normal = NormalEquations(structure)
    normal.own -= 1e-3 * np.eye(6)
    with pytest.raises(np.linalg.LinAlgError):
        Factor(normal)
