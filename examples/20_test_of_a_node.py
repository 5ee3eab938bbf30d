"""The test of a node: it needs no runtime, no file and no window.

python -m pytest -q examples/20_test_of_a_node.py
"""

from pathlib import Path

import numpy as np
import pytest

import ros_visualise as rv

POSTERIZE = f"{Path(__file__).parent / '01_own_filter.py'}:posterize"


@pytest.mark.parametrize("levels", [2, 4, 8])
def test_as_many_levels_are_left_as_asked_for(levels: int) -> None:
    ramp = np.tile(np.arange(256, dtype=np.uint8), (8, 1))
    seen = rv.node_function(POSTERIZE, levels=levels)(ramp).of("image", rv.Image)
    assert len(np.unique(seen.pixels)) == levels


def test_a_value_out_of_range_is_rejected() -> None:
    with pytest.raises(rv.ParameterError, match="levels"):
        rv.node_function(POSTERIZE, levels=1)
