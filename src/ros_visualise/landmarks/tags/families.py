"""Families of tags: what they are called, and when a square is believed to be one of theirs.

The fewer cells a family has, the more often something else looks like one of its tags. How many
wrong cells are put right, and by how much the others must differ from gray (the margin, AprilTag's
``decision_margin``, up to 127), were chosen on pictures without tags: benchmarks/landmarks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

import cv2

from ros_visualise.errors import ParameterError


@dataclass(frozen=True)
class Family:
    """A family of AprilTag, or a dictionary of ArUco.

    Its square has ``cells`` of them along a side. It is a tag where at most ``max_hamming`` of the
    inner ones are wrong, and the others differ from the gray between black and white by
    ``min_margin`` levels or more. ``dictionary`` is
    OpenCV's name of an ArUco dictionary; ``unsafe_ids`` are those that any stripe looks like.
    """

    name: str
    cells: int
    max_hamming: int
    min_margin: float
    dictionary: str = ""
    unsafe_ids: tuple[int, ...] = ()
    rim: int = 1


_APRILTAG = {
    one.name: one
    for one in (
        Family("tag36h11", 8, 2, 5.0),
        Family("tag25h9", 7, 1, 5.0),
        Family("tag16h5", 6, 0, 20.0),
        Family("tagStandard41h12", 5, 2, 5.0),
        Family("tagStandard52h13", 6, 1, 5.0),
    )
}

_ARUCO_LIMITS = {
    "4x4": (6, 0, 30.0),
    "5x5": (7, 1, 15.0),
    "6x6": (8, 2, 10.0),
    "7x7": (9, 1, 10.0),
    "aruco_mip": (8, 2, 10.0),
}


def parse_families(text: str) -> tuple[Family, ...]:
    """The families of a list as ``tag36h11, 5x5_1000``.

    Raises:
        ParameterError: there is no such family, or none is named.
    """
    names = re.split(r"[\s,;]+", text.strip())
    return tuple(dict.fromkeys(family(name) for name in names))


def family(name: str) -> Family:
    """The family of that name: ``tag36h11``, ``36h11``, ``DICT_5X5_1000``, ``5x5_1000``.

    Raises:
        ParameterError: there is no such family.
    """
    short = name.lower().removeprefix("dict_").removeprefix("apriltag_")
    bits = short.removeprefix("tag").removeprefix("standard")
    known = _by_short_name()
    found = known.get(bits, known.get(short))
    if found is None:
        there = ", ".join(dict.fromkeys(one.name for one in known.values()))
        raise ParameterError(f"no family of tags {name!r}; there is {there}")
    return found


def _by_short_name() -> dict[str, Family]:
    april = {re.sub(r"^tag(Standard)?", "", name): one for name, one in _APRILTAG.items()}
    names = sorted(
        name
        for name in dir(cv2.aruco)
        if re.match(r"DICT_(\dX\d_\d+|ARUCO_(ORIGINAL|MIP.*))$", name)
    )
    return april | {one.name: one for one in map(_of_dictionary, names)}


def _of_dictionary(dictionary: str) -> Family:
    name = dictionary.removeprefix("DICT_").lower()
    if name == "aruco_original":
        return Family(name, 7, 0, 30.0, dictionary, unsafe_ids=(0, 1023))
    limits = next(limit for start, limit in _ARUCO_LIMITS.items() if name.startswith(start))
    return Family(name, *limits, dictionary)
