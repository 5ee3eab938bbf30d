"""The surfaces that things stand on."""

import numpy as np
from grounds import paint_marks


def test_painted_lines_go_on_beside_the_surface():
    """Laid beside itself a surface shows no line that ends: a short one would look like a post."""
    met = []
    for seed in range(40):
        canvas = np.full((160, 160, 3), 120, np.uint8)
        paint_marks(np.random.default_rng(seed), canvas)
        painted = (canvas != 120).any(axis=2)
        for edge, beyond in ((painted[0], painted[-1]), (painted[:, 0], painted[:, -1])):
            near = np.any([np.roll(beyond, by) for by in range(-3, 4)], axis=0)
            met += near[edge].tolist()
    assert len(met) > 500
    assert np.mean(met) > 0.95  # a ring may touch an edge from one side
