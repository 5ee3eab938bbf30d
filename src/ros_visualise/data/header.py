"""What every message has, and arrays that nobody can change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Header:
    """When and where a message was taken.

    ``stamp_ns`` is the time of capture in nanoseconds; ``frame_id`` the frame of the data, for an
    image the camera's optical frame (z forward, x right, y down).
    """

    stamp_ns: int = 0
    frame_id: str = ""


def keep(message: Any, dtype: npt.DTypeLike = np.float64, **shapes: tuple[int, ...]) -> None:
    """Make fields of a frozen message read-only arrays of that type and these shapes.

    Set through ``vars``: ``object.__setattr__`` takes as long as all else, for some messages
    thousands of times a second.

    Raises:
        ValueError: one is of another shape.
    """
    fields = vars(message)
    for name, shape in shapes.items():
        array = np.asarray(fields[name], dtype)
        if array.shape != shape:
            raise ValueError(f"{type(message).__name__}.{name} is {array.shape}, not {shape}")
        fields[name] = read_only(array) if array.flags.writeable else array


def read_only(pixels: Pixels) -> Pixels:
    """The same memory as an array that nobody can write to; the array itself stays as it was."""
    view: Pixels = pixels.view()
    view.setflags(write=False)
    return view
