"""Two frames in a recording, one followed in the other, written ``/tf:PARENT.CHILD``."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import closing
from typing import NamedTuple

from ros_visualise.core.errors import DamagedMessage, NoTransform, UsageError
from ros_visualise.data import Transforms
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.messages.recorded import content
from ros_visualise.sources.recordings import Recording

HISTORY_S = 60.0
"""How far apart the transforms of one chain may be recorded."""


class NamedPair(NamedTuple):
    """A frame in another, and the topics of moving and of static transforms."""

    topic: str
    parent: str
    child: str
    static: str | None


def parse_pair(recording: Recording, name: str) -> NamedPair:
    """The pair that is named ``/tf:PARENT.CHILD``, as the package evo writes it.

    The topic of static transforms, if it is not ``/tf_static``, follows after another colon.

    Raises:
        UsageError: it is not written like this, or there are no such topics.
    """
    topic, _, rest = name.partition(":")
    frames, _, static = rest.partition(":")
    parent, _, child = frames.partition(".")
    if not (parent and child):
        raise UsageError(f"{name}: write a pair of frames as /tf:PARENT.CHILD")
    moving = find_topic(recording, topic, (Transforms,))
    if static:
        return NamedPair(moving, parent, child, find_topic(recording, static, (Transforms,)))
    there = {name.lstrip("/"): name for name in recording.topics}
    return NamedPair(moving, parent, child, there.get("tf_static"))


def find_topic(recording: Recording, wanted: str, kinds: Collection[type]) -> str:
    """The topic of that name, with or without its first slash.

    Raises:
        UsageError: there is none of these kinds; those that there are are listed.
    """
    there = topics_of(recording, kinds)
    found = [name for name in there if name.lstrip("/") == wanted.lstrip("/")]
    if not found:
        listed = f"choose from {', '.join(there)}" if there else "it has no topic with poses"
        raise UsageError(f"{recording.path}: no poses on {wanted}; {listed}")
    return found[0]


def topics_of(recording: Recording, kinds: Collection[type]) -> list[str]:
    """The topics with messages of these kinds."""
    topics = recording.topics.items()
    return [name for name, info in topics if info.type.data_class in kinds and info.messages]


def need_motion(recording: Recording, pair: NamedPair) -> None:
    """Read until a transform shows that the child moves in the parent.

    Raises:
        UsageError: it does not move, or the two are not connected.
    """
    tree = FrameTree(HISTORY_S)
    topics = [pair.topic, *([pair.static] if pair.static else [])]
    with closing(recording.read(topics=topics)) as entries:
        for entry in entries:
            _add(tree, entry.message, entry.topic == pair.static)
            try:
                if tree.newest_ns(pair.parent, pair.child) is not None:
                    return
            except NoTransform:
                continue
    refuse_rest(recording, pair, tree)


def refuse_rest(recording: Recording, pair: NamedPair, tree: FrameTree) -> None:
    """Check, after all transforms were read, that the child moves in the parent.

    Raises:
        UsageError: it does not move, or the two are not connected.
    """
    try:
        newest_ns = tree.newest_ns(pair.parent, pair.child)
    except NoTransform as error:
        raise UsageError(f"{recording.path}: {error}; choose of these") from None
    if newest_ns is None:
        raise UsageError(f"{recording.path}: {pair.child} does not move in {pair.parent}")


def ask_for_pair(recording: Recording, option: str) -> str:
    """A message that tells how to follow a frame by tf, with the names of all frames."""
    tree = FrameTree(HISTORY_S)
    with closing(recording.read(topics=topics_of(recording, (Transforms,)))) as entries:
        for entry in entries:
            _add(tree, entry.message, static=False)
    frames = ", ".join(tree.frames())
    if not frames:
        return f"{recording.path}: no poses in it, and no transforms that can be read"
    return f"{recording.path}: choose two frames by {option}:PARENT.CHILD of {frames}"


def _add(tree: FrameTree, message: object, static: bool) -> None:
    try:
        tree.add(content(message), static)
    except (DamagedMessage, ValueError):
        return  # what says nothing of frames
