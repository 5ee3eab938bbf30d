"""Lessons: what the nodes compute, step by step, on a picture or film of one's own.

Each file in ``topics`` is one: pure functions for its steps, a node for each, and a text that is
filled with the numbers of the run.
"""

from __future__ import annotations

from difflib import get_close_matches
from importlib import import_module

from ros_visualise.errors import UsageError
from ros_visualise.lessons.lesson import Lesson

TOPICS = (
    *("image", "bayer", "color", "noise", "gradient", "canny", "threshold"),
    *("camera", "sensors", "frames", "landmarks", "vision", "graph"),
)
"""The names of all lessons, in the order in which one would give them."""


def find_lesson(name: str) -> Lesson:
    """The lesson of that name.

    Raises:
        UsageError: there is none; those that there are are listed.
    """
    if name not in TOPICS:
        close = get_close_matches(name, TOPICS, 1)
        meant = f"did you mean {close[0]}? " if close else ""
        raise UsageError(f"no lesson {name!r}: {meant}choose from {', '.join(TOPICS)}")
    lesson: Lesson = import_module(f"{__name__}.topics.{name}").LESSON
    return lesson
