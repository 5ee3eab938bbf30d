"""Lessons: the nodes' methods, step by step, on any picture or video.

Each file in ``topics`` is one: pure functions for its steps, a node for each, and a text that is
filled with the numbers of the run. Another package adds one by an entry point of the group
``ros_visualise.lessons``; see `ros_visualise.core.registry`.
"""

from __future__ import annotations

from ros_visualise.core.registry import Registry, holding
from ros_visualise.lessons.lesson import Lesson

LESSONS = Registry(
    "lessons",
    f"{__name__}.topics",
    holding(Lesson, "LESSON"),
    first=(
        *("image", "bayer", "color", "noise", "gradient", "canny", "threshold"),
        *("camera", "sensors", "frames", "landmarks", "odometry", "vision", "graph"),
    ),
)
"""All lessons, in teaching order."""
