"""Options that commands share: a command's options inherit from the groups that it has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ros_visualise.core.limits import DEFAULT_MEMORY
from ros_visualise.core.rate import MAX_RATE
from ros_visualise.running.arguments import (
    count,
    folder,
    memory,
    not_negative,
    option,
    port,
    positive,
    rate,
    seed,
)
from ros_visualise.simulation.worlds import OURS


@dataclass(frozen=True, kw_only=True)
class MemoryOptions:
    """Memory that an input may take."""

    max_memory: int = option(
        DEFAULT_MEMORY,
        f"memory that one input may take, such as 4G (default: {DEFAULT_MEMORY >> 30}G)",
        type=memory,
        metavar="SIZE",
    )


def mission_option(otherwise: str) -> Any:
    """An option ``--mission``; ``otherwise`` says what happens without it."""
    shapes = "square, figure_of_eight, lawn_mower, default or a YAML file"
    help = f"mission of the robot: {shapes} (default: {otherwise})"
    return option(None, help, metavar="SHAPE|FILE")


def profile_option(default: str | None, otherwise: str) -> Any:
    """An option ``--profile``; ``otherwise`` is the profile without it."""
    help = f"error profile of the sensors and the world (default: {otherwise})"
    return option(default, help, choices=("ideal", "realistic", "hard"))


@dataclass(frozen=True, kw_only=True)
class WorldOptions:
    """A simulated robot's world and mission."""

    world: str | None = option(None, f"{OURS}, or one from a plug-in (default: field)")
    profile: str | None = profile_option(None, "ideal")
    seed: int | None = option(None, "seed of all random errors (default: 0)", type=seed)
    mission: str | None = mission_option("wait for commands")

    @property
    def scenario(self) -> dict[str, str | int]:
        """The given ones, by the robot's parameters."""
        names = ("world", "profile", "mission", "seed")
        given = {name: getattr(self, name) for name in names}
        return {name: value for name, value in given.items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class ViewingOptions:
    """The view of a run."""

    GROUP = "viewing"

    view: str = option(
        "web",
        "show a web page (default), OpenCV windows, or nothing",
        choices=("web", "windows", "none"),
    )
    host: str = option("127.0.0.1", "address on which the page is served (default: %(default)s)")
    port: int = option(8080, "port of the page (default: %(default)s)", type=port)
    token: bool = option(
        True,
        "let anyone who can reach the page use it (default: its address contains a secret token)",
    )
    open: bool | None = option(
        None, "open the page in a browser (default: only when started from a terminal on a desktop)"
    )
    layout: Path | None = option(
        None,
        "layout of the page, as 'Save layout' on the page writes it",
        metavar="FILE.yaml",
    )
    urdf: Path | None = option(
        None, "URDF file of the robot to draw, instead of /robot_description", metavar="FILE"
    )
    tiles: str = option(
        "",
        "map tiles for the page, from an address or an MBTiles file",
        metavar="URL|FILE.mbtiles",
    )
    allow_control: bool = option(
        False,
        "let the page publish messages and command the vehicles connected with --mavlink; a page at"
        " the read-only address never can",
    )
    allow_origin: Sequence[str] = option(
        [],
        "allow this web site to use the page, such as https://robot.example.org; repeatable",
        metavar="SITE",
    )


@dataclass(frozen=True, kw_only=True)
class PartOptions:
    """The part of the source that is played."""

    GROUP = "playing"

    start: float | None = option(None, "skip the first S seconds", type=not_negative, metavar="S")
    duration: float | None = option(None, "stop after S seconds", type=positive, metavar="S")
    frames: int | None = option(None, "stop after N images", type=count, metavar="N")


@dataclass(frozen=True, kw_only=True)
class PaceOptions(PartOptions):
    """The speed at which the source is played, and the part of it."""

    GROUP = "playing"

    rate: float | None = option(
        None,
        f"playback speed, up to {MAX_RATE} (default: 1); 0: as fast as possible without loss",
        type=rate,
    )
    duration: float | None = option(
        None,
        "stop after S seconds; of a video or recording, a page or window plays only these and stays"
        " open",
        type=positive,
        metavar="S",
    )
    loop: bool = option(False, "start again when the end is reached (loop)")
    paused: bool = False
    """Begin paused; no argument."""


@dataclass(frozen=True, kw_only=True)
class SettingOptions:
    """Parameters of nodes."""

    GROUP = "nodes"

    set: Sequence[str] = option(
        [],
        "set a parameter of a node; `ros-visualise nodes` lists them; repeatable",
        metavar="NODE.PARAM=VALUE",
    )
    params: Path | None = option(
        None,
        "set parameters from a file, as 'Save parameters' on the page writes it",
        metavar="FILE.yaml",
    )


def _presets(**_: object) -> tuple[str, ...]:
    from ros_visualise.graph.presets import NAMES

    return NAMES


@dataclass(frozen=True, kw_only=True)
class NodeOptions(SettingOptions):
    """Nodes beside those of the source, and their parameters."""

    GROUP = "nodes"

    landmarks: bool | None = option(
        None,
        "find tags in the images, and map them where the camera's pose is known (default:"
        " on for simulated robots only)",
    )
    preset: str = option(
        "",
        "set the image nodes together: default, seed, soft, strong, automatic, gradient "
        "or 'black and white'",
        metavar="NAME",
        completer=_presets,
    )
    navigate: str | None = option(
        None,
        "localize the robot by tags, in a saved map or in a new one",
        nargs="?",
        const="",
        metavar="MAP.yaml",
    )
    visual_odometry: bool | None = option(
        None,
        "estimate the robot's motion from the images and an IMU; --navigate uses the result as"
        " odometry (default: on with --navigate if the source has an IMU but no odometry)",
    )
    node: Sequence[str] = option(
        [],
        "add a node: a built-in one, or your own as FILE.py:NAME; AFTER names the node "
        "whose output it takes (default: filters, or else the source); repeatable",
        metavar="NODE[@AFTER][,INPUT=TOPIC]",
    )


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """Files that a run writes."""

    GROUP = "output"

    record: Sequence[str] = option(
        [],
        "record to an .mcap, a .bag or a ROS 2 folder; or one image topic (default: /edges) to an"
        " .mp4, numbers to a .csv, tracks to a .txt (MOT format), or MAVLink to a .tlog;"
        " repeatable",
        metavar="OUT[@TOPIC,...]",
    )
    split: str | None = option(
        None,
        "start a new file after this size or time, such as 1G or 10m",
        metavar="SIZE|TIME",
    )
    record_dir: Path = option(
        Path(),
        "folder of the files that the page reads and writes (default: the current one)",
        type=folder,
        metavar="DIR",
    )
    overwrite: bool = option(
        False,
        "replace existing recordings, maps and calibrations, each as soon as the new one is"
        " complete",
    )
    json: bool = option(False, "print a report of the run as JSON at the end")


@dataclass(frozen=True, kw_only=True)
class NetworkOptions:
    """Other machines that a run is shared with."""

    GROUP = "network"

    connect: Sequence[str] = option(
        [],
        "join a Zenoh network at this address, such as tcp/192.168.1.10:7447; repeatable",
        metavar="ADDRESS",
    )
    listen: Sequence[str] = option(
        [],
        "address on which other machines may join, such as tcp/0.0.0.0:7447; tcp/ is not encrypted,"
        " tls/ is; repeatable",
        metavar="ADDRESS",
    )
    mavlink: Sequence[str] = option(
        [],
        "connect a vehicle: udp://:14540, tcp://HOST:5760 or serial:///dev/ttyACM0:57600; of"
        " several vehicles at one address, ?system=2 chooses one; repeatable",
        metavar="ADDRESS",
    )
    node_name: str = option(
        "",
        "name on the Zenoh network, with a namespace for its topics, such as uav1/camera",
        metavar="NAME",
    )


@dataclass(frozen=True, kw_only=True)
class PlayingOptions(
    ViewingOptions, PaceOptions, NodeOptions, NetworkOptions, OutputOptions, MemoryOptions
):
    """Options of a command that plays a source through nodes."""


@dataclass(frozen=True, kw_only=True)
class TopicOptions(PlayingOptions):
    """Options of a command that plays topics."""

    topics: Sequence[str] = option(
        [], "play only these topics", action="extend", nargs="+", metavar="TOPIC"
    )
    image: str | None = option(
        None,
        "topic of the images to process (default: the first in gray or colour)",
        metavar="TOPIC|none",
    )
    odom: str | None = option(
        None,
        "topic from which the path is drawn (default: the first odometry), or two frames, given as"
        " /tf:PARENT.CHILD",
        metavar="TOPIC|none",
    )


@dataclass(frozen=True, kw_only=True)
class SizedOptions(PlayingOptions):
    """Options of a command whose images may be scaled."""

    size: str = option("", "scale the images to this size", metavar="WxH")
