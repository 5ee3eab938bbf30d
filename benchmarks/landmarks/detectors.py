"""Tag detectors, ours and alternatives, all called alike."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
import pyapriltags

from ros_visualise.landmarks.tags import TagFinder, family
from ros_visualise.landmarks.tags.search import TagSearch

Found = list[tuple[int, np.ndarray]]
"""Id and corners (4, 2), origin at the centre of the top-left pixel, lower left first."""


@dataclass(frozen=True)
class Detector:
    """``find`` takes a gray image; ``forget`` is called before one of another scene."""

    find: Callable[[np.ndarray], Found]
    forget: Callable[[], None] = field(default=lambda: None)


def ours(name: str, every: int = 1, **settings: float) -> Detector:
    finder, search = TagFinder([family(name)], **settings), TagSearch()

    def find(gray: np.ndarray) -> Found:
        return [(tag.id, tag.corners_uv) for tag in search.find(finder, gray, every)]

    return Detector(find, search.reset)


def plain_apriltag(decimate: float) -> Detector:
    return _of_apriltag(pyapriltags.Detector("tag36h11", nthreads=2, quad_decimate=decimate))


def pupil(decimate: float) -> Detector:
    """Raises ModuleNotFoundError where it is not installed."""
    import pupil_apriltags

    return _of_apriltag(pupil_apriltags.Detector("tag36h11", nthreads=2, quad_decimate=decimate))


def _of_apriltag(library: pyapriltags.Detector) -> Detector:
    return Detector(lambda gray: [(one.tag_id, one.corners - 0.5) for one in library.detect(gray)])


def opencv(dictionary: str, turns: int = 0) -> Detector:
    """As its defaults have it; a tag of it may be drawn turned by so many half turns."""
    library = cv2.aruco.ArucoDetector(
        cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    )

    def find(gray: np.ndarray) -> Found:
        corners, ids, _ = library.detectMarkers(gray)
        ids = [] if ids is None else ids.ravel().tolist()
        order = np.roll([3, 2, 1, 0], 2 * turns)
        return [(id, one[0][order]) for id, one in zip(ids, corners, strict=True)]

    return Detector(find)


def of_tag36h11() -> Mapping[str, Detector]:
    """By name; the half turn is that of OpenCV's pictures of this family beside AprilTag's own."""
    found = {
        "ours": ours("tag36h11"),
        "ours, quad_sigma -0.8": ours("tag36h11", quad_sigma=-0.8),
        "ours, quad_decimate 2": ours("tag36h11", quad_decimate=2),
        "ours, search_every 5": ours("tag36h11", every=5),
        "ours, refine off": ours("tag36h11", refine=False),
        "ours, refine off, quad_decimate 2": ours("tag36h11", refine=False, quad_decimate=2),
        "ours, refine off, search_every 5": ours("tag36h11", every=5, refine=False),
        "AprilTag 3 (pyapriltags), decimate 1": plain_apriltag(1),
        "AprilTag 3 (pyapriltags), decimate 2": plain_apriltag(2),
        "OpenCV": opencv("DICT_APRILTAG_36h11", turns=1),
    }
    try:
        return found | {"pupil-apriltags, decimate 1": pupil(1)}
    except ModuleNotFoundError:
        print("pupil-apriltags is not installed, and left out\n")
        return found


def of_aruco() -> Mapping[str, Detector]:
    return {"ours": ours("5x5_1000"), "OpenCV": opencv("DICT_5X5_1000")}
