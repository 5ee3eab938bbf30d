"""Pointing into the scene: coordinates, distances, and goals for a robot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from html import escape

import numpy as np
import viser

from ros_visualise.data import Floats, Header, PoseStamped
from ros_visualise.runtime.base import Runtime
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.scene.picking import Ray
from ros_visualise.ui.scene.scene import Scene

_LOOK, _PLACE, _DISTANCE, _GOAL = (
    "Orbit view",
    "Show coordinates",
    "Measure distance",
    "Send goal: ",
)


class Pointing:
    """The action of a click into the scene, in the present container.

    While a click only orbits the view, browsers send none.
    """

    def __init__(
        self, server: viser.ViserServer, runtime: Runtime, scene: Scene, worker: Worker
    ) -> None:
        self._server, self._runtime, self._scene = server, runtime, scene
        self._worker = worker
        self._places: list[Floats] = []
        self._fixed = ""
        self._choice = server.gui.add_dropdown(
            "Click",
            (_LOOK,),
            hint="Action of a click in 3D",
        )
        self._choice.on_update(worker.listener(("3D", "click"), lambda _: self._begin()))
        self._note = server.gui.add_html("", visible=False)
        self._stop: Callable[[], None] | None = None

    def follow(self, inputs: Mapping[str, type]) -> None:
        """Offer goals on those of these topics that take poses."""
        goals = [f"{_GOAL}{topic}" for topic, kind in inputs.items() if kind is PoseStamped]
        options = (_LOOK, _PLACE, _DISTANCE, *goals)
        if options != self._choice.options:
            if self._choice.value not in options:
                set_value(self._choice, _LOOK)
                self._begin()
            self._choice.options = options

    def refresh(self) -> None:
        """Clear the points as the fixed frame changes."""
        if self._places and self._scene.frames.fixed != self._fixed:
            self._begin()

    def _begin(self) -> None:
        self._places = []
        self._scene.pin([], "")
        self._note.visible = False
        listens = self._choice.value != _LOOK
        if listens and self._stop is None:
            self._stop = self._listen()
        elif not listens and self._stop is not None:
            self._stop()
            self._stop = None

    def _listen(self) -> Callable[[], None]:
        async def clicked(event: viser.SceneClickEvent) -> None:
            ray = Ray(np.array(event.ray_origin), np.array(event.ray_direction))
            self._worker.post(("3D", "clicked"), lambda: self._point(ray))

        self._server.scene.on_click()(clicked)  # type: ignore[arg-type]  # as documented
        return lambda: self._server.scene.remove_click_callback(clicked)

    def _point(self, ray: Ray) -> None:
        place = self._scene.pick(ray)
        if place is None:
            self._say("Nothing there; click a drawn object")
            return
        self._fixed = self._scene.frames.fixed
        keeps = self._choice.value == _DISTANCE and len(self._places) == 1
        self._places = [*self._places, place] if keeps else [place]
        text = describe(self._places)
        self._scene.pin(self._places, text)
        self._say(f"{text} in {self._fixed}")
        if self._choice.value.startswith(_GOAL):
            self._send(self._choice.value.removeprefix(_GOAL), place)

    def _send(self, topic: str, place: Floats) -> None:
        """Send the robot there, to face in its direction of travel."""
        start = self._scene.robot_xyz
        ahead = np.zeros(3) if start is None else place - start
        half = np.arctan2(ahead[1], ahead[0]) / 2
        quat_xyzw = np.array([0, 0, np.sin(half), np.cos(half)])
        header = Header(self._scene.time.newest_ns, self._fixed)
        self._runtime.publish(topic, PoseStamped(place, quat_xyzw, header))
        self._say(f"Goal sent: {describe([place])} in {self._fixed}")

    def _say(self, text: str) -> None:
        self._note.content = f'<div class="rv-note rv-place">{escape(text)}</div>'
        self._note.visible = True


def describe(places_xyz: list[Floats]) -> str:
    """The coordinates of one point, or the distance between two."""
    if len(places_xyz) == 1:
        x, y, z = places_xyz[0]
        return f"x {x:.2f}, y {y:.2f}, z {z:.2f} m"
    x, y, z = places_xyz[1] - places_xyz[0]
    length = float(np.linalg.norm(places_xyz[1] - places_xyz[0]))
    return f"{length:.2f} m (x {x:+.2f}, y {y:+.2f}, z {z:+.2f})"
