"""Findings of the filter about its input, reported once: wrong clocks and sizes, missing tags."""

from __future__ import annotations

import math

import numpy as np

from ros_visualise.estimation.belief import Belief
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.measuring import CAMERAS, CLOCK, clock_of

_WRONG_CLOCK_S = 0.02
_REPEATED = 20  # images with tags in a row by which a clock is wrong before the user is told
_WRONG_SIZE = 0.02  # as a fraction
_UNSEEN_NS = 10_000_000_000  # without a map tag in view, after which the user is told


def name_clock(belief: Belief, view: CameraView) -> None:
    """Report once that a camera's clock is wrong, if it stays wrong."""
    own, name = CAMERAS[view.camera], f"clock of camera {view.camera + 1}"
    said = f"wrong {name}"
    late_s, rows = float(belief.state.robot[own][CLOCK]), clock_of(view.camera)
    sigma_s = float(np.sqrt(belief.state.P[rows, rows].item()))
    is_wrong = abs(late_s) > max(_WRONG_CLOCK_S, 5 * sigma_s)
    count = belief.memory.get(name, 0) + 1 if is_wrong else 0
    belief.remember(name, count)
    if count >= _REPEATED and said not in belief.memory:
        belief.remember(said, True)
        where = "behind" if late_s > 0 else "ahead of"
        belief.note(f"the {name} is {abs(late_s) * 1e3:.0f} ms {where} that of the odometry")


def name_sizes(belief: Belief) -> None:
    """Say once for each tag that it has another size than stated."""
    for name in (*belief.outcome.used, *belief.outcome.pending):
        tag = belief.map.landmarks.get(name)
        is_known = f"size of {name}" in belief.memory
        if tag is None or is_known or tag.key not in belief.state.keys:
            continue
        larger, sigma = belief.state.size_error(tag.key)
        if abs(larger) > max(_WRONG_SIZE, 5 * sigma):
            belief.remember(f"size of {name}", True)
            by = f"{abs(larger):.1%} {'larger' if larger > 0 else 'smaller'}"
            belief.note(f"{name} is {by} than stated: check the tag size given to the detector")


def name_missing_tags(belief: Belief, is_seen: bool) -> None:
    """Say once that the robot is not localized because no tag of the map is in view."""
    last_ns = belief.memory.get("map tags")
    if is_seen or last_ns is None:
        belief.remember("map tags", belief.now_ns)
    elif belief.now_ns - last_ns > _UNSEEN_NS:
        belief.remember("map tags", math.inf)  # until one is seen
        otherwise = "" if belief.has_pose else ", or an initial pose (topic initialpose)"
        belief.note(f"no map tag in view for {_UNSEEN_NS // 10**9} s; {belief.reason}{otherwise}")
