"""Families of tags: names, and thresholds for accepting a square as one of their tags.

The fewer cells a family has, the more often other objects look like its tags. The number of
corrected cells, the contrast of the others (the margin, AprilTag's ``decision_margin``), and for
the weakest families the clearness, were chosen on images without tags: benchmarks/landmarks.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

import cv2

from ros_visualise.core.errors import ParameterError


@dataclass(frozen=True)
class Family:
    """A family of AprilTag, or a dictionary of ArUco.

    A square is accepted if at most ``max_hamming`` of its cells are wrong, and the others differ
    from the mean gray by at least ``min_margin`` levels on average; with ``min_clearness``, its
    `clearness` must reach that too. ``dictionary`` is OpenCV's name of an ArUco dictionary; ``rim``
    is the number of black cells around its codes.
    """

    name: str
    max_hamming: int
    min_margin: float
    dictionary: str = ""
    min_clearness: float | None = None
    rim: int = 1


_CLEAR = 0.3  # for families whose codes resemble many other objects

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

_ARUCO = (  # by the beginning of the dictionary's name
    Family("4x4", 0, 20.0, min_clearness=_CLEAR),
    Family("5x5", 1, 15.0),
    Family("6x6", 2, 10.0),
    Family("7x7", 1, 10.0),
    Family("aruco_mip", 2, 10.0),
    Family("aruco_original", 0, 20.0, min_clearness=_CLEAR),
)


def parse_families(text: str) -> tuple[Family, ...]:
    """The families in a list such as ``tag36h11, 5x5_1000``.

    Raises:
        ParameterError: a family is unknown, or the list is empty.
    """
    names = re.split(r"[\s,;]+", text.strip())
    return tuple(dict.fromkeys(family(name) for name in names))


def family(name: str) -> Family:
    """The family of that name: ``tag36h11``, ``36h11``, ``DICT_5X5_1000``, ``5x5_1000``.

    Raises:
        ParameterError: it is unknown.
    """
    short = name.lower().removeprefix("dict_").removeprefix("apriltag_")
    bits = short.removeprefix("tag").removeprefix("standard")
    known = _by_short_name()
    found = known.get(bits, known.get(short))
    if found is None:
        there = ", ".join(dict.fromkeys(one.name for one in known.values()))
        raise ParameterError(f"no such tag family: {name!r}; choose from {there}")
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
