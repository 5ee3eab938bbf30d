"""Tag detection in gray images."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from ros_visualise.data import CameraInfo, Floats, Pixels
from ros_visualise.landmarks.tags.apriltag import AprilTag3
from ros_visualise.landmarks.tags.families import Family
from ros_visualise.landmarks.tags.fitting import fit_tags
from ros_visualise.landmarks.tags.patterns import draw_cells

Region = tuple[int, int, int, int]
"""Left, top, right and bottom of a region of an image, pixels; right and bottom are exclusive."""

_THREADS = min(4, os.cpu_count() or 1)
_LEAST_SIDE = 16  # smallest side of an image with a tag
_UNFITTED = (
    0.05  # deviation of corners of a tag that cannot be fitted, as if cut off, of its extent
)
_CENTER = 0.5  # AprilTag counts from the corner of the top-left pixel, we from its centre


@dataclass(frozen=True, eq=False)
class Tag:
    """A tag in an image.

    ``corners_uv`` (4, 2) are those of its square in pixels, origin at the centre of the top-left
    pixel: lower left, lower right, upper right and upper left, as printed. ``hamming`` is the
    number of wrong cells, ``margin`` the mean difference of cells from the gray between black and
    white, in levels. ``covariance_px2`` (8, 8) is that of u and v of the first corner, of the
    second, and so on; None if unknown.
    """

    family: str
    id: int
    corners_uv: Floats
    hamming: int
    margin: float
    covariance_px2: Floats | None = None

    @property
    def name(self) -> str:
        """Name such as ``tag36h11_3``."""
        return f"{self.family}_{self.id}"

    @property
    def center_uv(self) -> Floats:
        """(2,) intersection of the diagonals, pixels."""
        a, b, c, d = np.column_stack([self.corners_uv, np.ones(4)])
        x, y, w = np.cross(np.cross(a, c), np.cross(b, d))
        return np.array([x / w, y / w])


class TagFinder:
    """Finds the tags of some families; for one thread at a time."""

    def __init__(
        self,
        families: Sequence[Family],
        quad_decimate: float = 1.0,
        quad_sigma: float = 0.0,
        refine: bool = True,
        min_margin: float = 0.0,
    ) -> None:
        """Prepare the families' codes.

        Args:
            families: see `parse_families`.
            quad_decimate: factor by which the image is reduced to find squares.
            quad_sigma: blur of that image (negative: sharpening), pixels.
            refine: fit the squares' sides to the image, as AprilTag does, then use `fit_tags`.
            min_margin: for all families; the larger of this and the family's own counts.
        """
        self._families = {one.name: one for one in families}
        self._min_margin = min_margin
        self._refine = refine
        self._library = AprilTag3(
            families,
            quad_decimate=quad_decimate,
            quad_sigma=quad_sigma,
            refine=refine,
            least_contrast=2 * max(min_margin, min(one.min_margin for one in families)),
            threads=_THREADS,
        )

    def find(
        self, gray: Pixels, regions: Sequence[Region] = (), info: CameraInfo | None = None
    ) -> tuple[Tag, ...]:
        """The tags in an image, by family and id.

        Args:
            gray: (height, width) uint8.
            regions: disjoint regions to search; empty: the whole image.
            info: the camera's calibration: through its lens, the sides of tags are not straight.
        """
        parts = regions or [(0, 0, gray.shape[1], gray.shape[0])]
        found = [tag for part in parts for tag in self._find_in(gray, part)]
        found = self._refined(gray, found, info) if self._refine else found
        return tuple(sorted(found, key=lambda tag: (tag.family, tag.id, *tag.center_uv)))

    def _find_in(self, gray: Pixels, part: Region) -> list[Tag]:
        left, top, right, bottom = part
        pixels = gray[top:bottom, left:right]
        if min(pixels.shape) < _LEAST_SIDE:
            return []
        origin = np.array([left, top]) - _CENTER
        tags = [
            Tag(
                one.tag_family.decode(),
                one.tag_id,
                one.corners + origin,
                one.hamming,
                float(one.decision_margin),
            )
            for one in self._library.detect(pixels)
        ]
        return [tag for tag in tags if self._is_believed(tag, gray)]

    def _refined(self, gray: Pixels, tags: Sequence[Tag], info: CameraInfo | None) -> list[Tag]:
        refined = []
        for name, family in self._families.items():
            of_family = [tag for tag in tags if tag.family == name]
            if not of_family:
                continue
            drawn = [draw_cells(family, tag.id) for tag in of_family]
            corners = np.array([tag.corners_uv for tag in of_family])
            fitted = fit_tags(gray, corners, [cells for cells, _ in drawn], drawn[0][1], info)
            for tag, uv, spread in zip(of_family, *fitted, strict=True):
                if not np.isfinite(spread).all():
                    spread = (_UNFITTED * np.ptp(uv, axis=0).max()) ** 2 * np.eye(8)
                refined.append(replace(tag, corners_uv=uv, covariance_px2=spread))
        return refined

    def _is_believed(self, tag: Tag, gray: Pixels) -> bool:
        family = self._families[tag.family]
        if tag.margin < max(family.min_margin, self._min_margin) or not _is_seen(tag.corners_uv):
            return False
        wanted = family.min_clearness
        return (
            wanted is None
            or clearness(gray, tag.corners_uv, self._library.cells[tag.family]) >= wanted
        )


def _is_seen(corners: Floats) -> bool:
    """True if (4, 2) may be a square seen from the front: convex, anticlockwise."""
    before, after = np.roll(corners, 1, axis=0) - corners, np.roll(corners, -1, axis=0) - corners
    return bool((before[:, 0] * after[:, 1] > before[:, 1] * after[:, 0]).all())


def clearness(gray: Pixels, corners_uv: Floats, cells: int) -> float:
    """Gap between the brightest black and the darkest white cell: 1 in a perfect image.

    It is a fraction of the difference between the means of both. If cells of one colour differ
    much, as in most false detections, it is near 0; if the black rim is not black, it is negative.

    Args:
        gray: (height, width) uint8.
        corners_uv: (4, 2) pixels of the tag's square: lower left, lower right, and so on.
        cells: number along a side, including the black rim of one cell.
    """
    square = np.array([[0, cells], [cells, cells], [cells, 0], [0, 0]], np.float32)
    H = cv2.getPerspectiveTransform(square, corners_uv.astype(np.float32))
    middles = np.stack(np.meshgrid(*[np.arange(cells) + 0.5] * 2), axis=-1)
    places = cv2.perspectiveTransform(middles.astype(np.float32), H)
    u, v = cv2.split(places)
    levels = cv2.remap(gray, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    inner = levels[1:-1, 1:-1].astype(np.float64)
    rim = np.concatenate([levels[0], levels[-1], levels[1:-1, 0], levels[1:-1, -1]])
    is_white = inner > (inner.max() + rim.mean()) / 2
    black = np.concatenate([rim, inner[~is_white]])
    white = inner[is_white]
    contrast = white.mean() - black.mean() if white.size else 0.0
    return float((white.min() - black.max()) / contrast) if contrast > 0 else -1.0
