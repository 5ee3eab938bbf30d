"""Drawings of messages in 3D: a file for each kind, with `Drawing`s that declare what they draw.

Another package brings one by an entry point of the group ``ros_visualise.drawings``; see
`ros_visualise.core.registry`. A type of messages that is drawn here already is not replaced.
"""

from __future__ import annotations

from types import ModuleType
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.core.registry import Registry
from ros_visualise.ui.scene.drawing import Drawing

Drawings = tuple[type[Drawing], ...]


def _read(held: Any, name: str) -> Drawings:
    candidates = vars(held).values() if isinstance(held, ModuleType) else [held]
    kinds = [one for one in candidates if isinstance(one, type) and issubclass(one, Drawing)]
    found = tuple(kind for kind in kinds if "draws" in vars(kind) and kind is not Drawing)
    if not found:
        raise UsageError("contains no Drawing that declares what it draws")
    return found


DRAWINGS = Registry("drawings", __name__, _read)


def by_message() -> dict[type, type[Drawing]]:
    """Type of messages -> its drawing."""
    found: dict[type, type[Drawing]] = {}
    for drawing in (one for several in DRAWINGS.all() for one in several):
        for kind in drawing.draws:
            found.setdefault(kind, drawing)
    return found
