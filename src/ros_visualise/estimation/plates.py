"""Level plates above the ground, such as a landing pad: over one, a rangefinder measures the plate.

They are tags of the map, and things that move, where they were seen last.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.measuring import camera_of

_MOVING = "plates that move"
_LEVEL = 0.95  # least cosine of the tilt
_REACH_M = 1.5  # of a plate, around its marker
_NEAR_M = 0.15  # largest difference in height, beside errors
_FAR = 0.03  # error of a height, as a fraction of the distance from which it was seen


def note_moving(belief: Belief, view: CameraView) -> None:
    """Remember where things that move are, by the camera of a localized robot."""
    camera = camera_of(view, belief.state.robot)
    found = {}
    for sight in view.moving:
        pose = next((one for one in sight.poses if one.R is not None and one.has_range), None)
        if pose is not None and pose.R is not None and (camera.R @ pose.R)[2, 2] > _LEVEL:
            found[sight.name] = np.append(
                camera.R @ pose.t + camera.p, _FAR * np.linalg.norm(pose.t)
            )
    if found:
        belief.remember(_MOVING, belief.memory.get(_MOVING, {}) | found)


def is_on_plate(belief: Belief, point: Floats, ground_m: float) -> bool:
    """True if a point (3,) of the map, above the ground's height, is on a plate."""
    if point[2] - ground_m < _NEAR_M:
        return False
    return any(
        np.hypot(*(point - at)[:2]) < _REACH_M
        and abs(point[2] - at[2]) < min(_NEAR_M + error_m, at[2] - ground_m)
        for *at, error_m in _plates(belief)
    )


def _plates(belief: Belief) -> Iterator[Floats]:
    """Position and error of the height of each, (4,)."""
    yield from belief.memory.get(_MOVING, {}).values()
    state = belief.state
    for n, key in enumerate(state.keys):
        tag = belief.map.landmarks.get(key.partition("/")[0])
        if tag and tag.is_used and tag.side_m > 0 and state.landmarks_R[n, 2, 2] > _LEVEL:
            yield np.append(state.landmarks_p[n], 0.0)
