"""A robot's model: its links follow their frames, or else its joints."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ros_visualise.core.errors import NoTransform
from ros_visualise.data import Floats, Text
from ros_visualise.plotting.colors import Color
from ros_visualise.ui.live.space.nodes import Solids, SpaceNode, solid_row
from ros_visualise.ui.live.space.tree import SpaceTree
from ros_visualise.ui.scene.drawing import Appearance, Drawing, move
from ros_visualise.ui.scene.frames import Frames
from ros_visualise.ui.scene.meshes import add_mesh, load_mesh
from ros_visualise.ui.scene.urdf import RobotModel, Shape, read_model

_MOST_TRIANGLES = 3_000_000
_SOLIDS = {"box": "cube", "cylinder": "cylinder", "sphere": "sphere"}


class RobotDrawing(Drawing):
    """A robot description, a URDF in a `Text`.

    A link without a transform hangs below its parent, by the newest position of its joint. All of
    it stays as time jumps: a description comes once.
    """

    draws = (Text,)

    stays = True
    gathers: ClassVar[bool] = True

    def __init__(self, scene: SpaceTree, name: str, color: Color) -> None:
        super().__init__(scene, name, color)
        self._text, self._problem = "", ""
        self._model = RobotModel((), (), {})
        self._links: dict[str, SpaceNode] = {}
        self._places: dict[str, Floats] = {}
        self._triangles = 0

    def draw(self, message: Any, appearance: Appearance) -> None:
        if message.text == self._text:
            return
        self._text, self._problem, self._triangles = message.text, "", 0
        for link in self._links.values():
            link.remove()
        self._links, self._places = {}, {}
        try:
            self._model = read_model(message.text)
            self._add_all()
        except ValueError as error:
            self._problem = str(error)
            raise

    def frame_of(self, message: Any, frames: Frames) -> str:
        """The fixed one: each link has a frame of its own."""
        return ""

    def extent(self) -> npt.NDArray[np.floating]:
        return np.zeros((0, 3))

    def update(self, frames: Frames, now_ns: int) -> str:
        """Move the links; those without a place are hidden."""
        places: dict[str, Floats] = {}
        for name in self._model.links:
            place = self._place(name, frames, places)
            if place is not None:
                places[name] = place
            if name in self._links:
                self._show(name, place)
        self._places = places
        return self._problem

    def _show(self, link: str, place: Floats | None) -> None:
        """Send what has changed of a link."""
        node = self._links[link]
        if node.visible != (place is not None):
            node.visible = place is not None
        if place is not None and not np.array_equal(place, self._places.get(link, 0.0)):
            move(node, place)

    def _place(self, link: str, frames: Frames, places: dict[str, Floats]) -> Floats | None:
        """T_fixed_link, 4x4; ``places`` are those of its parents."""
        joint = self._model.joints.get(link)
        if joint is None:
            frames.see(link)  # where nothing else is known, the robot itself stays put
        try:
            return frames.locate(link, 0)
        except NoTransform:
            if joint is None or joint.parent not in places:
                return None
            return places[joint.parent] @ joint.child_pose(frames.joints)

    def _add_all(self) -> None:
        failed: dict[str, str] = {}
        for number, shape in enumerate(self._model.shapes):
            if shape.mesh in failed:
                continue
            try:
                self._add(number, shape)
            except ValueError as error:
                failed[shape.mesh] = str(error)
        if failed:
            meshes = {shape.mesh for shape in self._model.shapes if shape.mesh}
            why = next(iter(failed.values()))
            raise ValueError(f"{len(failed)} of {len(meshes)} meshes are missing: {why}")

    def _add(self, number: int, shape: Shape) -> None:
        link = f"{self._name}/{shape.link.replace('/', '.')}"
        if shape.link not in self._links:
            self._links[shape.link] = self._scene.add(link, SpaceNode(visible=False))
        name, scene = f"{link}/{number}", self._scene
        red, green, blue = (round(255 * c) for c in shape.rgba[:3])
        color = red, green, blue
        if shape.kind != "mesh":
            row = solid_row(_size_of(shape), color, shape.rgba[3])
            handle: SpaceNode = scene.add(name, Solids(shape=_SOLIDS[shape.kind], rows=row))
        else:
            parts = load_mesh(shape.mesh)
            self._triangles += sum(len(part.faces) for part in parts)
            if self._triangles > _MOST_TRIANGLES:
                raise ValueError(f"more than {_MOST_TRIANGLES} triangles in all")
            handle = scene.add(name, SpaceNode())
            add_mesh(scene, f"{name}/mesh", parts, shape.size, shape.rgba, own_colors=True)
        move(handle, shape.T_link_shape)


def _size_of(shape: Shape) -> tuple[float, ...]:
    """Lengths of a solid along its axes, metres."""
    if shape.kind == "box":
        return shape.size
    width = 2 * shape.size[0]
    return width, width, shape.size[1] if shape.kind == "cylinder" else width
