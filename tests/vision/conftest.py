"""Small images of every kind, and sizes that catch careless code."""

import numpy as np
import pytest

SIZES = [(1, 1), (1, 7), (7, 1), (2, 2), (5, 3), (31, 17)]


@pytest.fixture(params=SIZES, ids=lambda size: "{}x{}".format(*size))
def size(request):
    """(height, width)."""
    return request.param


@pytest.fixture(params=[np.uint8, np.uint16], ids=["8bit", "16bit"])
def dtype(request):
    return request.param


@pytest.fixture
def gray(size, dtype):
    """Noise over the whole range."""
    top = np.iinfo(dtype).max
    return np.random.default_rng(1).integers(0, top + 1, size, dtype)


@pytest.fixture
def colored(size, dtype):
    """Noise over the whole range, three channels."""
    top = np.iinfo(dtype).max
    return np.random.default_rng(2).integers(0, top + 1, (*size, 3), dtype)
