"""The header of messages, and read-only arrays."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

Pixels = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Header:
    """Time and frame of a message.

    ``stamp_ns`` is the time of capture in nanoseconds; ``frame_id`` the frame of the data, for an
    image the camera's optical frame (z forward, x right, y down).
    """

    stamp_ns: int = 0
    frame_id: str = ""


def keep(message: Any, dtype: npt.DTypeLike = np.float64, **shapes: tuple[int, ...]) -> None:
    """Make attributes of a frozen message read-only arrays of that type and these shapes.

    A side of -1 has any length.

    Raises:
        ValueError: one is of another shape.
    """
    keep_all(message, ((name, np.dtype(dtype), shape) for name, shape in shapes.items()))


def keep_all(message: Any, arrays: Iterable[tuple[str, np.dtype[Any], tuple[int, ...]]]) -> None:
    """Do the same for (attribute, type, shape) of each.

    They are set through ``vars``: ``object.__setattr__`` would double the time that messages of
    some kinds take, thousands of times a second.
    """
    attributes = vars(message)
    for name, dtype, shape in arrays:
        array = np.asarray(attributes[name], dtype)
        if array.shape != shape and not _fits(array.shape, shape):
            wanted = str(shape).replace("-1", "N")
            raise ValueError(
                f"{type(message).__name__}.{name} has the shape {array.shape}, not {wanted}"
            )
        attributes[name] = read_only(array) if array.flags.writeable else array


def _fits(found: tuple[int, ...], shape: tuple[int, ...]) -> bool:
    return len(found) == len(shape) and all(b in (a, -1) for a, b in zip(found, shape, strict=True))


def read_only(pixels: Pixels) -> Pixels:
    """A read-only view of an array."""
    view: Pixels = pixels.view()
    view.setflags(write=False)
    return view
