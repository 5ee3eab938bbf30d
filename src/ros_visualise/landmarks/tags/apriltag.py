"""The library AprilTag 3, for its own families and for ArUco's.

It finds more tags than OpenCV's ArUco detector, its corners are 40 times more accurate, and one
pass over the image serves all families.

Source: Wang and Olson, AprilTag 2, 2016; Krogius et al., Flexible layouts for fiducial tags, 2019.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pyapriltags import Detector

from ros_visualise.landmarks.tags.families import Family

Cells = npt.NDArray[np.uint8]


_SHARPENING = 0.25  # of cells before decoding: the library's default, which pyapriltags truncates


class _Settings(ctypes.Structure):
    """The beginning of ``apriltag_detector_t`` of the library's apriltag.h."""

    _fields_ = (
        ("nthreads", ctypes.c_int),
        ("quad_decimate", ctypes.c_float),
        ("quad_sigma", ctypes.c_float),
        ("refine_edges", ctypes.c_bool),
        ("decode_sharpening", ctypes.c_double),
        ("debug", ctypes.c_bool),
        ("min_cluster_pixels", ctypes.c_int),
        ("max_nmaxima", ctypes.c_int),
        ("critical_rad", ctypes.c_float),
        ("cos_critical_rad", ctypes.c_float),
        ("max_line_fit_mse", ctypes.c_float),
        ("min_white_black_diff", ctypes.c_int),
    )


class AprilTag3(Detector):
    """AprilTag 3 with given families, including OpenCV's ArUco dictionaries."""

    def __init__(
        self,
        families: Sequence[Family],
        *,
        quad_decimate: float,
        quad_sigma: float,
        refine: bool,
        least_contrast: float,
        threads: int,
    ) -> None:
        """Prepare the codes of the families.

        Args:
            least_contrast: from black to white, levels of gray: in most images half of the time
                goes to what is fainter. The library's own is 5.
        """
        super().__init__(
            "",
            nthreads=threads,
            quad_decimate=quad_decimate,
            quad_sigma=quad_sigma,
            refine_edges=int(refine),
        )
        begin: Any = self.tag_detector_ptr
        settings = ctypes.cast(begin, ctypes.POINTER(_Settings)).contents
        settings.decode_sharpening = _SHARPENING
        settings.min_white_black_diff = max(1, int(least_contrast))
        self.cells: dict[str, int] = {}  # number along the side of a family's square
        self._codes: list[_CodedFamily] = []  # the library keeps pointers to them
        for one in families:
            self.libc.apriltag_detector_add_family_bits(  # type: ignore[union-attr]
                self.tag_detector_ptr, self._made(one), one.max_hamming
            )

    def _made(self, one: Family) -> Any:
        """The library's struct of a family: its own ones are destroyed with the detector."""
        if one.dictionary:
            cells = dictionary_cells(one.dictionary)
            self._codes.append(_CodedFamily.of_cells(one.name, cells, one.rim))
            self.cells[one.name] = self._codes[-1].width_at_border
            return ctypes.byref(self._codes[-1])
        made = getattr(self.libc, f"{one.name}_create")()
        self.tag_families[one.name] = made
        self.cells[one.name] = made.contents.width_at_border
        return made


class _CodedFamily(ctypes.Structure):
    """``apriltag_family_t`` of the library's apriltag.h."""

    _fields_ = (
        ("ncodes", ctypes.c_uint32),
        ("codes", ctypes.POINTER(ctypes.c_uint64)),
        ("width_at_border", ctypes.c_int),
        ("total_width", ctypes.c_int),
        ("reversed_border", ctypes.c_bool),
        ("nbits", ctypes.c_uint32),
        ("bit_x", ctypes.POINTER(ctypes.c_int32)),
        ("bit_y", ctypes.POINTER(ctypes.c_int32)),
        ("h", ctypes.c_int32),
        ("name", ctypes.c_char_p),
        ("impl", ctypes.c_void_p),
    )

    @classmethod
    def of_cells(cls, name: str, cells: Cells, rim: int) -> _CodedFamily:
        """A family of tags (ids, N, N) with a black rim of ``rim`` cells."""
        count, side = cells.shape[:2]
        x, y = _order(side)
        weights = np.uint64(1) << np.arange(side * side, dtype=np.uint64)[::-1]
        codes = (cells[:, y, x] * weights).sum(axis=1, dtype=np.uint64)
        return cls(
            count,
            (ctypes.c_uint64 * count)(*codes.tolist()),
            side + 2 * rim,
            side + 2 * rim + 2,
            False,
            side * side,
            (ctypes.c_int32 * len(x))(*(x + rim).tolist()),
            (ctypes.c_int32 * len(y))(*(y + rim).tolist()),
            0,
            name.encode(),
            None,
        )


def _order(side: int) -> npt.NDArray[np.int64]:
    """Columns and rows of a square's cells, by quarters, clockwise.

    In this order, rotating a tag by 90 degrees shifts its code by a quarter. The middle cell of an
    odd number is the last.
    """
    half = side // 2
    x, y = (part.ravel() for part in np.meshgrid(np.arange(side - half), np.arange(half)))
    quarters = []
    for _ in range(4):
        quarters.append(np.array([x, y]))
        x, y = side - 1 - y, x
    middle = np.full((2, side % 2), half)
    return np.concatenate([*quarters, middle], axis=1)


def dictionary_cells(name: str) -> Cells:
    """The inner cells (ids, N, N) of a dictionary of OpenCV, 1 is white, without the black rim.

    OpenCV before 4.7 draws and detects by other functions; the table is the same.
    """
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
    side = int(dictionary.markerSize)
    table = np.ascontiguousarray(dictionary.bytesList, np.uint8)
    count, length = table.shape[:2]
    codes = table.reshape(count, -1)[:, :length]  # followed by the rotated codes
    whole, rest = divmod(side * side, 8)
    bits = np.unpackbits(codes, axis=1)
    last = bits[:, 8 * length - rest :] if rest else bits[:, :0]
    return np.concatenate([bits[:, : 8 * whole], last], axis=1).reshape(count, side, side)
