"""False detections leave nothing behind: all that a navigator holds is counted, and its bytes."""

from __future__ import annotations

import gc
import sys
import types
from collections import Counter

import numpy as np
from driven import drive, params
from world import Sensor, World, along, square, tags_on_ground

TAGS = tags_on_ground([(x, y, -5) for x in (-1.0, 0, 1.0) for y in (-0.8, 0.8)])
_ASIDE = (type, types.ModuleType, types.FunctionType, int, float)  # code, and plain numbers


def held(root):
    """Numbers of all objects that one refers to, by type, and their size in bytes."""
    seen, left = {id(root): root}, [root]
    while left:
        for other in gc.get_referents(left.pop()):
            if id(other) not in seen and not isinstance(other, _ASIDE):
                seen[id(other)] = other
                left.append(other)
    counts = Counter(type(one).__name__ for one in seen.values())
    owned = (one for one in seen.values() if not isinstance(one, np.ndarray) or one.base is None)
    return counts, sum(getattr(one, "nbytes", 0) or sys.getsizeof(one) for one in owned)


def test_false_detections_let_nothing_grow():
    """In 30% of the images a false tag, each with a name of its own; IMU and odometry run on."""
    images, imu = Sensor(20, priority=1), Sensor(50, priority=-1)
    events = World(along(*square(2.0, laps=9)), TAGS, clutter=0.3, images=images, imu=imu).events(
        17
    )
    several, run = [], None
    for second in range(17):
        part = [one for one in events if second <= one.arrival_s < second + 1]
        run = drive(part, params(), run=run)
        several.append(held(run.node))
    before, after = several[5:11], several[11:17]
    most = {
        kind: [max(counts[kind] for counts, _ in part) for part in (before, after)]
        for kind in set().union(*(counts for counts, _ in several))
    }
    assert run.report["landmarks"] == len(TAGS)
    grown = {kind: pair for kind, pair in most.items() if pair[1] > 1.1 * pair[0] + 3}
    assert not grown, f"most in six seconds, and in the next six: {grown}"
    sizes = [max(size for _, size in part) for part in (before, after)]
    assert sizes[1] < 1.15 * sizes[0], f"{sizes[0]:,} and then {sizes[1]:,} bytes"
