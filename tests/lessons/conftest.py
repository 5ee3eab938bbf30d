"""What several tests of lessons look at."""

import numpy as np
import pytest

from ros_visualise.sources.flyover import draw_landscape


@pytest.fixture(scope="session")
def landscape() -> np.ndarray:
    """A part of the drawn landscape, (240, 320, 3) BGR: edges, colours, texture."""
    return draw_landscape()[900:1140, 1200:1520]
