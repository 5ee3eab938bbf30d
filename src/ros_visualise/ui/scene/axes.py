"""The frames of the tree, as axes with their names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.geometry import se3
from ros_visualise.ui.live.space.nodes import Axes, Label
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, node_name, to_wxyz

_LENGTH, _RADIUS = 0.5, 0.014
_LIFT = 0.06  # of a name above its axes, in lengths of the axes


class _Group(NamedTuple):
    names: list[str]
    centre: Floats


class FrameAxes:
    """Axes for every frame that can be located.

    Frames that are nearer to each other than their axes are long share one label.
    """

    def __init__(self, scene: SpaceTree) -> None:
        self._scene = scene
        self._axes = scene.add(node_name("axes"), Axes(poses=np.zeros((0, 7)), radius=_RADIUS))
        self._labels: dict[str, Label] = {}
        self._drawn: tuple[Mapping[str, Floats], Appearance] | None = None

    def draw(self, places: Mapping[str, Floats], appearance: Appearance) -> bool:
        """Show frames: name -> T_fixed_frame; True if they have changed."""
        if (
            self._drawn is not None
            and _are_same(places, self._drawn[0])
            and appearance == self._drawn[1]
        ):
            return False
        self._drawn = places, appearance
        self._draw_axes(places if appearance.axes else {}, appearance)
        self._draw_labels(
            clusters(places, _LENGTH * appearance.axes_size) if appearance.names else {}, appearance
        )
        return True

    def _draw_labels(self, groups: Mapping[str, _Group], appearance: Appearance) -> None:
        for name in self._labels.keys() - groups.keys():
            self._labels.pop(name).remove()
        for name, (names, centre) in groups.items():
            text = "\n".join(names)
            if name not in self._labels:
                self._labels[name] = self._scene.add(node_name("frames", name), Label(text=text))
            self._labels[name].text = text
            self._labels[name].position = centre + np.array([0, 0, _LIFT * appearance.axes_size])

    def _draw_axes(self, places: Mapping[str, Floats], appearance: Appearance) -> None:
        T = np.array(list(places.values())).reshape(-1, 4, 4)
        positions, quats_xyzw = se3.to_pose(T)
        self._axes.poses = np.concatenate([positions, to_wxyz(quats_xyzw)], axis=1)
        self._axes.length = _LENGTH * appearance.axes_size
        self._axes.radius = _RADIUS * appearance.axes_size


def clusters(places: Mapping[str, Floats], distance_m: float) -> dict[str, _Group]:
    """Frames that share a label, each within a distance of the first of its group.

    Returns: first name -> all names, and where the first frame is.
    """
    groups: dict[str, _Group] = {}
    for name, T in places.items():
        position = T[:3, 3]
        for names, centre in groups.values():
            if np.linalg.norm(position - centre) < distance_m:
                names.append(name)
                break
        else:
            groups[name] = _Group([name], position)
    return groups


def _are_same(places: Mapping[str, Floats], others: Mapping[str, Floats]) -> bool:
    return places.keys() == others.keys() and all(
        np.array_equal(T, others[name]) for name, T in places.items()
    )
