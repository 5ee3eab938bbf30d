"""Places of a smoothed map: each is one of its views."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ros_visualise.data import Detections
from ros_visualise.estimation.localization.track import LandmarkTrack
from ros_visualise.estimation.mapping.smoothing import SmoothedMap
from ros_visualise.geometry import rotations
from ros_visualise.geometry.se3 import about_itself, about_origin


def places_in(found: SmoothedMap, places: Sequence[Detections]) -> list[LandmarkTrack]:
    """Places as landmarks, with poses from the smoothed views.

    Args:
        found: the map; views that nothing connects with it are missing, and so are their places.
        places: the first sighting of each by the first camera, one per message.
    """
    if not places:
        return []
    views = {int(stamp_ns): n for n, stamp_ns in enumerate(found.problem.stamps_ns)}
    covariances = found.factor.inverse().own
    several = []
    for message in places:
        view = views.get(message.header.stamp_ns)
        if view is None:
            continue
        (one,) = message.detections
        seen = one.hypotheses[0]
        R, t = found.views.R[view], found.views.t[view]
        p, turned = R @ seen.position_xyz + t, R @ rotations.to_matrix(seen.quat_xyzw)
        # the errors of the view are those of a rigid body, which the place is a part of
        change = about_itself(p) @ about_origin(t)
        axes = np.kron(np.eye(2), R)
        P = change @ covariances[view] @ change.T + axes @ seen.covariance @ axes.T
        of_class = one.class_id, int(one.id)
        several.append(LandmarkTrack.of_map(of_class, (p, turned, (P + P.T) / 2), np.zeros(3), 1))
    return several
