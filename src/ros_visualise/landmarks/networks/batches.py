"""Several images through a network in one run, where its file allows that.

A network takes batches if the first side of its image input is free. Each output then has that side
too, and one entry for each image; those of our own network have all objects in one row, and
`IMAGE_NUMBERS` beside them.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.landmarks.networks.layouts.own import IMAGE_NUMBERS
from ros_visualise.landmarks.networks.session import OnnxSession

Inputs = Mapping[str, Any]
"""Name of an input -> array, for one image."""

Room = dict[tuple[Any, ...], Any]
"""Shape and type -> array."""

Answer = list[Any] | RosVisualiseError
"""The outputs for one image, or the error in place of them."""


def group_of(session: OnnxSession, inputs: Inputs, names: Sequence[str]) -> Hashable:
    """Equal for inputs that can be run together; None if these cannot."""
    if not _is_free(session):
        return None
    stacked = _stacked(session)
    shapes = [(name, one.dtype.str, one.shape[1:]) for name, one in inputs.items()]
    others = [(name, one.tobytes()) for name, one in inputs.items() if name not in stacked]
    return session.path, tuple(names), tuple(shapes), tuple(others)


def run_together(
    session: OnnxSession, several: Sequence[Inputs], names: Sequence[str], room: Room | None = None
) -> list[Answer]:
    """The outputs of these names for each of several inputs of one group.

    If the network fails on all of them together, it gets one after the other.

    Args:
        room: memory for batches, filled and used again: a new one takes as long as copying to it.
    """
    room = {} if room is None else room
    if len(several) > 1:
        try:
            return [*_split(session, _run(session, several, names, room), names, len(several))]
        except RosVisualiseError:
            pass  # such as not enough memory for so many, or one that it fails on
    return [_alone(session, one, names) for one in several]


def _is_free(session: OnnxSession) -> bool:
    return any(len(one.shape) == 4 and one.name in _stacked(session) for one in session.inputs)


def _stacked(session: OnnxSession) -> set[str]:
    """Inputs with an entry for each image."""
    return {one.name for one in session.inputs if one.shape and not isinstance(one.shape[0], int)}


def _alone(session: OnnxSession, inputs: Inputs, names: Sequence[str]) -> Answer:
    try:
        return session.run(dict(inputs), [*names])
    except RosVisualiseError as error:
        return error


def _run(
    session: OnnxSession, several: Sequence[Inputs], names: Sequence[str], room: Room
) -> dict[str, Any]:
    stacked = _stacked(session)
    inputs = {
        name: _stack([each[name] for each in several], room) if name in stacked else one
        for name, one in several[0].items()
    }
    wanted = [*names]
    if any(one.name == IMAGE_NUMBERS for one in session.outputs) and IMAGE_NUMBERS not in wanted:
        wanted.append(IMAGE_NUMBERS)
    return dict(zip(wanted, session.run(inputs, wanted), strict=True))


def _stack(arrays: Sequence[Any], room: Room) -> Any:
    shape = (sum(len(one) for one in arrays), *arrays[0].shape[1:])
    place = room.setdefault((shape, arrays[0].dtype), np.empty(shape, arrays[0].dtype))
    return np.concatenate(arrays, out=place)


def _split(
    session: OnnxSession, outputs: Mapping[str, Any], names: Sequence[str], count: int
) -> list[list[Any]]:
    """The outputs for each image, as the network gives them for it alone.

    Raises:
        RosVisualiseError: an output has no entry for each image.
    """
    if IMAGE_NUMBERS in outputs:
        numbers = outputs[IMAGE_NUMBERS][0]
        rows = [numbers == number for number in range(count)]
        found = [{name: one[:, row] for name, one in outputs.items()} for row in rows]
        for each in found:
            each[IMAGE_NUMBERS] = np.zeros_like(each[IMAGE_NUMBERS])
        return [[each[name] for name in names] for each in found]
    if any(len(one) != count for one in outputs.values()):
        raise RosVisualiseError(
            f"{session.path}: takes several images, but returns results for one"
        )
    return [[outputs[name][at : at + 1] for name in names] for at in range(count)]
