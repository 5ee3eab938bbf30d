"""The command line: what can be asked for. Light to import; `ros_visualise.commands` do it."""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn

from ros_visualise.commands import COMMANDS
from ros_visualise.completion import SHELLS, complete
from ros_visualise.errors import RosVisualiseError
from ros_visualise.installation import check_installation
from ros_visualise.limits import DEFAULT_MEMORY, set_max_memory
from ros_visualise.near import near
from ros_visualise.options.calibrate import add_calibrate
from ros_visualise.options.landmarks import add_landmarks
from ros_visualise.options.shared import (
    MISSION,
    add_memory_option,
    add_playing_options,
    add_world_options,
    not_negative,
    positive,
)
from ros_visualise.options.trajectory import add_trajectory
from ros_visualise.printing import say, say_what_is_logged
from ros_visualise.signals import interrupt
from ros_visualise.simulation.robots import OURS, ROBOTS
from ros_visualise.supervision import status_of

_OPTION = re.compile("--[a-z][a-z-]*")
_CHOICE = re.compile(
    r"argument (?P<what>.*): invalid choice: '(?P<given>.*?)' \(choose from (?P<there>.*)\)"
)
_EXAMPLES = """examples:
  ros-visualise demo
  ros-visualise sim husky --world playpen --mission square
  ros-visualise video flight.mp4 --set filters.threshold=90
  ros-visualise video flight.mp4 --view none --rate 0 --record edges.mp4 --json
  ros-visualise camera rtsp://192.168.1.10/stream
  ros-visualise bag drive.bag --image /camera/image_raw
  ros-visualise kitti 2011_09_26/2011_09_26_drive_0009_sync
  ros-visualise explain canny photo.jpg
  ros-visualise landmarks photo.jpg --size 0.16 --calibration ost.yaml
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status.

    0 done; 1 the work failed or lost something; 2 wrong usage or an input that cannot be opened;
    130 stopped from outside; see `ros_visualise.signals`.

    Raises:
        KeyboardInterrupt: stopped before there was anything to close.
    """
    try:
        parser = _parser(sys.argv[1:] if arguments is None else arguments)
        complete(parser)
        args = parser.parse_args(arguments)
        if args.command is None:
            parser.print_help()
            return 0
        set_max_memory(args.max_memory)
        check_installation()
        run = args.run or import_module(f"ros_visualise.commands.{args.module}").run
        say_what_is_logged()
        interrupt()
        status: int = run(args)
        return status_of(status)
    except RosVisualiseError as error:
        say(f"ros-visualise: {error}")
        return error.exit_status
    except BrokenPipeError:  # whoever read the output has seen enough
        return 1


class _Parser(argparse.ArgumentParser):
    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """As argparse does it; an option that there is not is said first, with what was meant."""
        options = [name for name in self._option_string_actions if name.startswith("--")]
        given = list(args or () if self._subparsers is None else ())  # of a command, that is
        for text in given[: given.index("--")] if "--" in given else given:
            name = text.partition("=")[0]
            if _OPTION.fullmatch(name) and not any(one.startswith(name) for one in options):
                self.error(f"no option {name}{near(name, options, listed=False)}")
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        found = _CHOICE.search(message)
        if found and os.path.exists(found["given"]):
            path = found["given"]
            message = f"to play {path}: {self.prog} {_command_for(Path(path))} {path}"
        elif found:
            there = re.findall(r"[^', ]+", found["there"])
            message = f"{found['what']}: no '{found['given']}'{near(found['given'], there)}"
        say(f"{self.prog}: {message}; see {self.prog} --help")
        self.exit(2)


def _command_for(path: Path) -> str:
    from ros_visualise.sources.formats import suffixes

    is_recording = path.is_dir() or path.suffix.lower() in suffixes()
    return "bag" if is_recording else "video"


def _parser(given: Sequence[str] = ()) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="ros-visualise",
        description="See what a robot sees.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="show the version and exit")
    parser.set_defaults(max_memory=DEFAULT_MEMORY, run=None)  # of commands that read nothing
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    _add_playing(commands)
    _add_asking(commands)
    _add_plugins(commands, next((text for text in given if not text.startswith("-")), ""))
    return parser


def _add_playing(commands: Any) -> None:
    playing = argparse.ArgumentParser(add_help=False)
    add_playing_options(playing)
    playing.set_defaults(module="play")
    robots = _add_robots(commands, playing)
    video = commands.add_parser("video", parents=[playing], help="play a video file")
    video.add_argument(
        "input", metavar="FILE", help="any video that FFmpeg can read, or a folder of pictures"
    )
    camera = commands.add_parser("camera", parents=[playing], help="show a live camera")
    camera.add_argument(
        "input",
        metavar="DEVICE|URL|test",
        nargs="?",
        default="0",
        help="path or number of a device (default: 0), URL of a stream, or test for a test pattern",
    )
    for command in (*robots, video, camera):
        command.add_argument(
            "--size", metavar="WxH", default="", help="scale the images to this size"
        )
    _add_recordings(commands, playing)
    _add_explain(commands, playing)


def _add_explain(commands: Any, playing: argparse.ArgumentParser) -> None:
    explain = commands.add_parser(
        "explain",
        parents=[playing],
        help="lessons: how it works, step by step, on your own picture or recording",
    )
    explain.set_defaults(module="explain")
    explain.add_argument(
        "topic", metavar="TOPIC", nargs="?", help="the lesson; without it, all lessons are listed"
    )
    explain.add_argument(
        "input",
        metavar="FILE",
        nargs="?",
        help=f"a picture, a film, a recording, {OURS} (default: a sample that fits the lesson)",
    )
    explain.add_argument(
        "--export",
        type=Path,
        metavar="DIR",
        help="write the lesson to this folder: one HTML page, and its figures as PNG and SVG",
    )


def _add_robots(commands: Any, playing: argparse.ArgumentParser) -> tuple[Any, Any]:
    demo = commands.add_parser(
        "demo", parents=[playing], help="play a simulated quadrotor: the quickest way to see it all"
    )
    demo.add_argument(
        "scene",
        nargs="?",
        choices=(*ROBOTS.builtin, "landscape"),
        help="a simulated robot, or a drawn landscape, which needs no MuJoCo (default: quadrotor)",
    )
    sim = commands.add_parser("sim", parents=[playing], help=f"run a simulated robot: {OURS}")
    sim.add_argument("robot", metavar="ROBOT", help=f"{OURS}, or one of another package")
    add_world_options(sim)
    sim.add_argument(
        "--mission", metavar="SHAPE|FILE", help=f"{MISSION} (default: wait for commands)"
    )
    return demo, sim


def _add_recordings(commands: Any, playing: argparse.ArgumentParser) -> None:
    bag = commands.add_parser(
        "bag",
        parents=[playing],
        help="play a recording: .bag, .mcap, a ROS 2 folder, a flight log (.ulg, .SRT)",
    )
    bag.add_argument("input", metavar="PATH", help="the recording")
    kitti = commands.add_parser(
        "kitti", parents=[playing], help="play a drive of the KITTI data set"
    )
    kitti.add_argument(
        "input", metavar="DIR", help="folder of a drive, or of a date with one drive"
    )
    for command in (bag, kitti):
        command.add_argument(
            "--topics",
            action="extend",
            nargs="+",
            default=[],
            metavar="TOPIC",
            help="play only these topics",
        )
        command.add_argument(
            "--image",
            metavar="TOPIC|none",
            help="topic whose images go through the nodes (default: the first in gray or colour)",
        )
        command.add_argument(
            "--odom",
            metavar="TOPIC|none",
            help="topic that the path is drawn from (default: the first odometry), or two frames as"
            " /tf:PARENT.CHILD",
        )


def _add_asking(commands: Any) -> None:
    info = commands.add_parser("info", help="tell what is in a recording or a video")
    info.set_defaults(module="info")
    info.add_argument("input", metavar="FILE", help="a recording or a video")
    info.add_argument(
        "--check", action="store_true", help="read the whole file, and report what is damaged"
    )
    info.add_argument("--json", action="store_true", help="print it as one JSON object")
    add_memory_option(info)
    _add_convert(commands)
    add_landmarks(commands)
    add_trajectory(commands)
    add_calibrate(commands)
    nodes = commands.add_parser(
        "nodes", help="list all nodes with their topics, actions and parameters"
    )
    nodes.set_defaults(module="nodes")
    plugins = commands.add_parser(
        "plugins", help="list what other packages add, and what of it cannot be used"
    )
    plugins.set_defaults(module="plugins")
    plugins.add_argument("--json", action="store_true", help="print it as one JSON array")
    completion = commands.add_parser(
        "completion", help="print what a shell needs to complete commands and options"
    )
    completion.set_defaults(module="completion")
    completion.add_argument("shell", choices=SHELLS, help='for bash and zsh: eval "$(...)"')
    nodes.add_argument("--json", action="store_true", help="print it as one JSON object")


def _add_plugins(commands: Any, given: str) -> None:
    """The commands of other packages; the one that is given is imported."""
    there = set(commands.choices)
    for plugin in COMMANDS.plugins():
        if plugin.name in there:  # `plugins` says so
            continue
        there.add(plugin.name)
        known = COMMANDS.find(plugin.name) if plugin.name == given else None
        parser = commands.add_parser(plugin.name, help=f"from the package {plugin.package}")
        if known is not None:
            parser.description = known.help
            parser.set_defaults(run=known.run)
            known.add_arguments(parser)


def _add_convert(commands: Any) -> None:
    convert = commands.add_parser(
        "convert", help="write a recording, or a part of it, in another format"
    )
    convert.set_defaults(module="convert")
    convert.add_argument("input", metavar="SRC", help="the recording, of any kind")
    convert.add_argument(
        "output",
        metavar="DST",
        help="the new file, a .bag or .mcap; a name without either ending makes a ROS 2 folder",
    )
    convert.add_argument(
        "--topics",
        action="extend",
        nargs="+",
        default=[],
        metavar="TOPIC",
        help="only these topics",
    )
    convert.add_argument(
        "--start", type=not_negative, metavar="S", help="leave out the first S seconds"
    )
    convert.add_argument("--duration", type=positive, metavar="S", help="take only S seconds")
    convert.add_argument(
        "--compression",
        choices=("auto", "none", "lz4", "bz2", "zstd"),
        help="for a .bag: none (default), lz4 or bz2; for .mcap and ROS 2: auto (default; zstd"
        " for small messages, lz4 for images), none, lz4 or zstd",
    )
    convert.add_argument(
        "--profile",
        choices=("ros1", "ros2"),
        help="message types of an .mcap: ros2 (default), or ros1, which keeps a .bag's bytes",
    )
    convert.add_argument("--overwrite", action="store_true", help="replace DST if it exists")
    convert.add_argument("--json", action="store_true", help="print a report as one JSON object")
    add_memory_option(convert)


class _Version(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        super().__init__(option_strings, dest, nargs=0, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"{parser.prog} {version('ros_visualise')}")
        parser.exit()
