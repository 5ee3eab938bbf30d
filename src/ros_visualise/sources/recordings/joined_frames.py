"""Frames of recordings that are played together: one tree, in which no two move the same frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import islice

from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.data import Transforms
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording

_SAMPLED = 200
"""Messages of each topic of transforms that are read for the names of frames."""


@dataclass(frozen=True)
class OwnFrames:
    """Names of a recording's frames: below its own name, but for roots that all share."""

    name: str
    roots: frozenset[str]

    def __call__(self, frame: str) -> str:
        """The name among the frames of all."""
        bare = frame.lstrip("/")
        return frame if not bare or bare in self.roots else f"{self.name}/{bare}"


def own_frames(names: Sequence[str], parts: Sequence[Recording]) -> list[OwnFrames | None]:
    """New names for the frames of each recording; None where all keep theirs.

    A recording gets them if it moves a frame that one before it moves too, as two runs of the same
    robot do. Its roots keep their names, unless others move them: both runs are in one map.
    """
    moved: set[str] = set()
    found: list[OwnFrames | None] = []
    for name, part in zip(names, parts, strict=True):
        links = set(_links(part)) if len(parts) > 1 else set()
        children = {child for _, child in links}
        roots = {parent for parent, _ in links} - children - moved
        is_again = bool(children & moved)
        found.append(OwnFrames(name, frozenset(roots)) if is_again else None)
        moved |= children
    return found


def _links(recording: Recording) -> Iterator[tuple[str, str]]:
    """Parent and child of the transforms at its start; what is damaged is skipped."""
    for topic, info in recording.topics.items():
        if info.type.data_class is not Transforms:
            continue
        with (
            suppress(RosVisualiseError, OSError),
            closing(recording.read(topics=[topic])) as entries,
        ):
            for entry in islice(entries, _SAMPLED):
                for one in content(entry.message).transforms:
                    yield one.header.frame_id.lstrip("/"), one.child_frame_id.lstrip("/")
