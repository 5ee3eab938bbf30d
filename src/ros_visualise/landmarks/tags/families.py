"""Families of tags: what they are called, and when a square is believed to be one of theirs.

The fewer cells a family has, the more often something else looks like one of its tags. How many
wrong cells are put right, by how much the others must differ from gray (the margin, AprilTag's
``decision_margin``), and of the weakest families how clearly, was chosen on pictures without tags:
benchmarks/landmarks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import cv2

from ros_visualise.core.errors import ParameterError


@dataclass(frozen=True)
class Family:
    """A family of AprilTag, or a dictionary of ArUco.

    A square is a tag where at most ``max_hamming`` of its cells are wrong, and the others differ
    from the gray between black and white by ``min_margin`` levels or more; where ``min_clearness``
    is given, its `clearness` is at least that. ``dictionary`` is OpenCV's name of an ArUco
    dictionary; ``rim`` counts the black cells around a code of it.
    """

    name: str
    max_hamming: int
    min_margin: float
    dictionary: str = ""
    min_clearness: float | None = None
    rim: int = 1


_CLEAR = 0.3  # of families whose codes are like many other things

_APRILTAG = {
    one.name: one
    for one in (
        Family("tag36h11", 2, 5.0),
        Family("tag25h9", 1, 5.0),
        Family("tag16h5", 0, 20.0, min_clearness=_CLEAR),
        Family("tagStandard41h12", 2, 5.0),
        Family("tagStandard52h13", 1, 5.0),
    )
}

_ARUCO = (  # by how the names of their dictionaries begin
    Family("4x4", 0, 20.0, min_clearness=_CLEAR),
    Family("5x5", 1, 15.0),
    Family("6x6", 2, 10.0),
    Family("7x7", 1, 10.0),
    Family("aruco_mip", 2, 10.0),
    Family("aruco_original", 0, 20.0, min_clearness=_CLEAR),
)


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
        raise ParameterError(f"no family of tags {name!r}; choose from {there}")
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
    kind = next(one for one in _ARUCO if name.startswith(one.name))
    return replace(kind, name=name, dictionary=dictionary)
