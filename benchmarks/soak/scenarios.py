"""What is run for hours: each scenario starts its processes and tends them."""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from processes import Process, end_all, free_port

from ros_visualise.running.executables import command_of

_HERE = Path(__file__).parent
_OURS = (sys.executable, "-m", "ros_visualise")
_PARTS = 3  # of a recording that are kept


class Scenario:
    """A page, and somebody who looks at it, if it is to be looked at.

    Args:
        folder: for logs and recordings.

    Attributes:
        watched: name -> the process that is measured.
        looker: who looks; None while nobody does.
    """

    command: tuple[str, ...] = ()
    is_looked_at = True

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True)
        self.watched: dict[str, Process] = {}
        self.looker: Process | None = None
        self._running: list[Process] = []

    def start(self) -> None:
        """Begin: a command that opens a page, and who looks at it."""
        page = ("--port", str(free_port()), "--no-open")
        self.show(self.run("page", *_OURS, *self.command, *page))

    def tend(self, elapsed_s: float) -> None:
        """Do what is to be done now and then."""

    def end(self) -> None:
        """End all that was started."""
        end_all(self._running)
        self._running.clear()

    def run(
        self, name: str, *command: str, environment: Mapping[str, str] | None = None
    ) -> Process:
        """A process of this scenario."""
        process = Process(name, command, self.folder, environment)
        self._running.append(process)
        return process

    def stop(self, process: Process) -> None:
        """End one process before the others."""
        self._running.remove(process)
        end_all([process])

    def show(self, page: Process) -> None:
        """Watch a process with a page, and have somebody look at it."""
        self.watched["page"] = page
        address = page.address()
        if self.is_looked_at:
            self.looker = self.run("looker", sys.executable, str(_HERE / "looker.py"), address)


class Demo(Scenario):
    """``ros-visualise demo``."""

    command = ("demo",)


class DemoAlone(Demo):
    """The same, and nobody looks."""

    is_looked_at = False


class Bag(Scenario):
    """A short bag of a simulated rover, with images and clouds, looped ten times as fast."""

    command = ("bag", "rover.bag", "--loop", "--rate", "10")
    topics = "/image_raw,/points,/odom,/tf,/tf_static,/imu/data"
    sizes: ClassVar = {"camera_width": 320, "camera_height": 240, "lidar_columns": 180}

    def start(self) -> None:
        settings = [f"--set=husky.{name}={value}" for name, value in self.sizes.items()]
        robot = ("sim", "husky", "--mission", "default", "--duration", "30", "--view", "none")
        record = ("--record", f"rover.bag@{self.topics}")
        self.run("robot", *_OURS, *robot, *settings, *record).wait()
        super().start()


class Camera(Scenario):
    """FFmpeg's test picture as a camera, recorded in parts of which the oldest are deleted."""

    command = ("camera", "test", "--size", "320x240")
    recording = ("--record", "camera.mcap@/edges", "--split", "10m")

    def start(self) -> None:
        self.command += self.recording
        super().start()

    def tend(self, elapsed_s: float) -> None:
        parts = sorted(self.folder.glob("camera*.mcap"), key=lambda part: part.stat().st_mtime)
        for part in parts[:-_PARTS]:
            part.unlink()


class Ros1(Scenario):
    """A ROS 1 graph: camera, filters and page go on; an edge detector and the master restart."""

    every_s: ClassVar = {"rosmaster": 600.0, "edge_detector": 180.0}

    def start(self) -> None:
        self._port = free_port()
        self._environment = {
            **os.environ,
            "PATH": f"/usr/bin:{os.environ['PATH']}",  # whose python3 the tools of ROS need
            "ROS_MASTER_URI": f"http://127.0.0.1:{self._port}",
            "ROS_IP": "127.0.0.1",
            "ROS_HOME": str(self.folder),
            "ROS_LOG_DIR": str(self.folder / "log"),
            "PYTHONUNBUFFERED": "1",
        }
        self._restarted = {name: self._begin(name) for name in self.every_s}
        self._due_s = dict(self.every_s)
        self.watched["camera"] = self._node("camera", "_uri:=test", "_size:=320x240")
        self.watched["filters"] = self._node("filters", "image:=image_raw")
        self.show(self._node("viewer", f"_port:={free_port()}"))

    def tend(self, elapsed_s: float) -> None:
        for name, due_s in self._due_s.items():
            if elapsed_s >= due_s:
                self.stop(self._restarted[name])
                self._restarted[name] = self._begin(name)
                self._due_s[name] += self.every_s[name]

    def _begin(self, name: str) -> Process:
        if name == "rosmaster":  # a roscore's processes would not be of its group
            command = (name, "--core", "-p", str(self._port))
            return self.run(name, *command, environment=self._environment)
        return self._node(name, "image:=processed_image")

    def _node(self, name: str, *arguments: str) -> Process:
        return self.run(name, *command_of(name), *arguments, environment=self._environment)


SCENARIOS: dict[str, type[Scenario]] = {
    "demo": Demo,
    "alone": DemoAlone,
    "bag": Bag,
    "camera": Camera,
    "ros1": Ros1,
}
