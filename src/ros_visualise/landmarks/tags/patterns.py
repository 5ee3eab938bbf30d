"""Cells of printed tags."""

from __future__ import annotations

import ctypes
from functools import lru_cache
from typing import Any

import numpy as np
from pyapriltags import Detector

from ros_visualise.core.errors import ParameterError
from ros_visualise.landmarks.tags.apriltag import Cells, dictionary_cells
from ros_visualise.landmarks.tags.families import Family


@lru_cache(maxsize=1024)
def draw_cells(family: Family, id: int) -> tuple[Cells, int]:
    """The cells of a tag, and the number of them between its outer edge and its square.

    Returns:
        (N, N) uint8, read-only, 1 is white, upright; and the width of the rim around the square by
            which its size is measured: white, with code cells in newer families.

    Raises:
        ParameterError: the family has no tag of that number.
    """
    if family.dictionary:
        every = dictionary_cells(family.dictionary)
        _check_id(family, id, len(every))
        return np.pad(np.pad(every[id], 1), 1, constant_values=1), 1
    library = Detector("")
    of_family = getattr(library.libc, f"{family.name}_create")()
    try:
        _check_id(family, id, of_family.contents.ncodes)
        rim = (of_family.contents.total_width - of_family.contents.width_at_border) // 2
        return _drawn(library.libc, of_family, id), rim
    finally:
        getattr(library.libc, f"{family.name}_destroy")(of_family)


def _check_id(family: Family, id: int, count: int) -> None:
    if not 0 <= id < count:
        raise ParameterError(f"no tag {id} in {family.name}: choose from 0 to {count - 1}")


def _drawn(library: Any, of_family: Any, id: int) -> Cells:
    library.apriltag_to_image.restype = library.image_u8_create.restype
    image = library.apriltag_to_image(of_family, ctypes.c_int(id))
    part = image.contents
    rows = np.ctypeslib.as_array(part.buf, (part.height, part.stride))
    cells: Cells = (rows[:, : part.width] > 0).astype(np.uint8)
    library.image_u8_destroy(image)
    return cells
