"""The mean of the networks of two files, whose tensors are arrays here."""

import numpy as np
import pytest
from layers import Layer, mean

OLD = [Layer(np.full((2, 3), n + 1.0), np.full(2, -1.0)) for n in range(3)]
NEW = [Layer(np.zeros((2, 3)), np.ones(2)) for _ in range(3)]


@pytest.mark.parametrize("share", [0.0, 0.25, 1.0])
def test_the_mean_has_so_much_of_each(share):
    found = mean(OLD, NEW, share, 3)
    assert len(found) == 3
    for n, layer in enumerate(found):
        np.testing.assert_allclose(layer.weight, (1 - share) * (n + 1))
        np.testing.assert_allclose(layer.bias, 2 * share - 1)


def test_only_the_layers_of_one_run_are_averaged():
    """A file may have the layers of a network twice."""
    assert len(mean(OLD * 2, NEW, 0.5, 3)) == 3


def test_networks_of_other_depths_are_refused():
    with pytest.raises(ValueError, match="shorter"):
        mean(OLD, NEW[:2], 0.5, 3)
