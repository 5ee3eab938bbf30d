"""Settings of a scene: the fixed frame, the appearance, and how topics are drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import partial
from typing import Any

from ros_visualise.core.errors import UsageError
from ros_visualise.data import Detections3D, Marker, MarkerArray, OccupancyGrid, PointCloud
from ros_visualise.ui.scene.drawing import Appearance
from ros_visualise.ui.scene.kinds import DRAWINGS, is_beside_image
from ros_visualise.ui.scene.scene import Scene

Value = bool | float | str
_AUTO = "Auto"
_SIZED = "Size in metres; Auto suits a robot 1 m long"
_COLORED = (PointCloud, Marker, MarkerArray, Detections3D, OccupancyGrid)
_APPEARANCE: Mapping[str, tuple[str, tuple[float, float, float] | None, str]] = {
    "axes": ("Frame axes", None, "x red, y green, z blue"),
    "names": ("Frame names", None, "Frames close to each other share a label"),
    "axes_size": ("Axes size", (0.1, 5.0, 0.1), _SIZED),
    "point_size": ("Point size", (0.01, 0.5, 0.01), _SIZED),
    "max_points": ("Max points", (5000, 500_000, 5000), "Maximum number of points drawn per cloud"),
    "covariances": ("Covariances", None, "Ellipsoids of two standard deviations"),
}
"""Field of an `Appearance` -> its label, its range with a step, and a line of help."""


@dataclass(frozen=True)
class SceneControl:
    """One setting: a switch, a number within ``range`` (with a step), or one of ``options``.

    ``place`` names it in layouts, in lower case; ``group`` is its part of the panel; ``color`` is
    that of a topic, where it has only one.
    """

    group: str
    place: str
    label: str
    value: Value
    set: Callable[[Any], object]
    options: tuple[str, ...] = ()
    range: tuple[float, float, float] | None = None
    hint: str = ""
    color: tuple[int, ...] = ()

    def checked(self, value: Any) -> Value:
        """The value to set, of the right type.

        Raises:
            UsageError: it cannot have that value.
        """
        if self.options:
            found = {one.casefold(): one for one in self.options}.get(str(value).casefold())
            if found is None:
                raise UsageError(f"{self.place}: no such choice; use {', '.join(self.options)}")
            return found
        if self.range is None:
            known = {"true": True, "false": False}.get(str(value).casefold())
            if known is None:
                raise UsageError(f"{self.place}: use true or false")
            return known
        low, high, _ = self.range
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            number = low - 1
        if isinstance(value, bool) or not low <= number <= high:
            raise UsageError(f"{self.place}: give a number from {low:g} to {high:g}")
        return type(self.value)(number)


class SceneControls:
    """The settings of a scene; the first value of each is the one that it has at first."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._topics: Mapping[str, type] = {}
        self._first: dict[str, Value] = {}
        self._waiting: dict[str, Value] = {}

    def follow(self, topics: Mapping[str, type]) -> None:
        """Offer these topics; given with their types."""
        self._topics = {
            topic: kind
            for topic, kind in topics.items()
            if kind in DRAWINGS and not is_beside_image(topic, topics)
        }
        self.refresh()

    def refresh(self) -> None:
        """Set what waits for topics and frames that have come."""
        for control in list(self):
            self._first.setdefault(control.place, control.value)
            value = self._waiting.get(control.place)
            if value is not None and (not control.options or _has(control, value)):
                del self._waiting[control.place]
                control.set(control.checked(value))

    def set(self, place: str, value: Any) -> None:
        """Set one.

        Raises:
            UsageError: it is unknown, or cannot have that value.
        """
        for control in self:
            if control.place == place:
                control.set(control.checked(value))
                return
        raise UsageError(f"no such setting of the 3D view: {place[:100]}")

    def apply(self, arrangement: Mapping[str, Value]) -> None:
        """Set those of saved settings, as soon as they are offered."""
        self._waiting = {place: value for place, value in arrangement.items() if value is not None}
        self.refresh()

    @property
    def arrangement(self) -> dict[str, Value]:
        """The settings that were changed."""
        return {
            one.place: one.value
            for one in self
            if one.value != self._first.get(one.place, one.value)
        }

    def __iter__(self) -> Iterator[SceneControl]:
        scene = self._scene
        yield SceneControl(
            "",
            "3d/fixed frame",
            "Fixed frame",
            scene.frames.chosen or _AUTO,
            lambda name: scene.set_fixed(None if name == _AUTO else name),
            (_AUTO, *scene.frames.names),
            hint="Frame in which everything is drawn",
        )
        for name, (label, limits, hint) in _APPEARANCE.items():
            value = getattr(scene.appearance, name)
            yield SceneControl(
                "Appearance",
                f"3d/appearance/{label.casefold()}",
                label,
                value,
                partial(self._set_look, name),
                range=limits,
                hint=hint,
            )
        yield from self._topic_controls()

    def _topic_controls(self) -> Iterator[SceneControl]:
        scene, colored = self._scene, 0
        for topic, kind in self._topics.items():
            if scene.is_covered(topic):
                continue
            yield SceneControl(
                "Topics",
                f"3d/legend/{topic.casefold()}",
                topic,
                scene.is_visible(topic),
                partial(scene.set_visible, topic),
                hint=kind.__name__,
                color=() if kind in _COLORED else scene.color(topic),
            )
            coloring = scene.coloring(topic)
            if coloring is None:
                continue
            colored += 1
            yield SceneControl(
                "Topics",
                "3d/legend/colour by" + (f" {colored}" if colored > 1 else ""),
                "Colour by",
                coloring.value,
                partial(self._set_coloring, topic, type(coloring)),
                tuple(one.value for one in type(coloring)),
                hint=topic,
            )

    def _set_coloring(self, topic: str, scheme: type[Enum], name: str) -> None:
        self._scene.set_coloring(topic, scheme(name))

    def _set_look(self, name: str, value: Any) -> None:
        changed: Appearance = replace(self._scene.appearance, **{name: value})
        self._scene.appearance = changed


def notes(
    fixed: str, frames: Mapping[str, str], problems: Mapping[str, str], has_transforms: bool
) -> list[str]:
    """Lines about the fixed frame and about problems.

    Args:
        fixed: the fixed frame, or empty.
        frames: topic -> the frame of its newest message.
        problems: topic -> why it is not drawn.
        has_transforms: True once any has come.
    """
    if has_transforms or not fixed:
        where = [f"Shown in {fixed}"] if fixed else []
        return where + [f"{topic}: {why}" for topic, why in problems.items()]
    there = [topic for topic, frame in frames.items() if frame in ("", fixed)]
    apart = [f"{topic} ({frame})" for topic, frame in frames.items() if topic not in there]
    wrong = {topic: why for topic, why in problems.items() if topic in there}
    line = f"No transforms received. Shown in frame {fixed}: {', '.join(there) or 'nothing'}"
    if apart:
        line += f". Not shown (no transform to their frames): {', '.join(apart)}"
    return [line, *(f"{topic}: {why}" for topic, why in wrong.items())]


def _has(control: SceneControl, value: Value) -> bool:
    return str(value).casefold() in map(str.casefold, control.options)
