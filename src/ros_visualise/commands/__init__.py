"""Commands: a module for each, or a folder where one takes more than a file; and their parser.

Each module holds a `Command` as ``COMMAND``. It is light to import: what is heavy is imported
where the command runs. Another package brings a command by an entry point of the group
``ros_visualise.commands``; see `ros_visualise.core.registry`.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Generic, NoReturn, TypeVar

from ros_visualise.core.completion import complete, words_to_complete
from ros_visualise.core.errors import RosVisualiseError, did_you_mean
from ros_visualise.core.installation import check_installation
from ros_visualise.core.limits import set_max_memory
from ros_visualise.core.printing import print_log, print_status
from ros_visualise.core.registry import Registry, holding
from ros_visualise.core.signals import interrupt
from ros_visualise.core.supervision import status_of
from ros_visualise.running.arguments import add_arguments
from ros_visualise.running.options import MemoryOptions

T = TypeVar("T")

_OPTION = re.compile("--[a-z][a-z-]*")
_ADDRESS = re.compile("[a-z][a-z0-9+.-]*://", re.IGNORECASE)
_SERVER = re.compile("wss?://", re.IGNORECASE)
_CHOICE = re.compile(
    r"argument (?P<what>.*): invalid choice: '(?P<given>.*?)' \(choose from (?P<there>.*)\)"
)
_EXAMPLES = """examples:
  ros-visualise demo
  ros-visualise drive.mcap
  ros-visualise flight.mp4 flight.ulg --offset flight_ulg=1.5
  ros-visualise sim husky --world playpen --mission square
  ros-visualise video flight.mp4 --set filters.threshold=90
  ros-visualise video flight.mp4 --view none --rate 0 --record edges.mp4 --json
  ros-visualise camera rtsp://192.168.1.10/stream
  ros-visualise ws://192.168.1.10:8765
  ros-visualise bag drive.bag --image /camera/image_raw
  ros-visualise kitti 2011_09_26/2011_09_26_drive_0009_sync
  ros-visualise explain canny photo.jpg
  ros-visualise landmarks photo.jpg --size 0.16 --calibration ost.yaml
"""


@dataclass(frozen=True)
class Command(Generic[T]):
    """A command.

    Attributes:
        help: a line about it.
        options: frozen dataclass with a field for each argument, see
            `ros_visualise.running.arguments`.
        run: does it; gives the exit status. RosVisualiseErrors end it with one line. As
            ``MODULE:FUNCTION`` it is imported when it is called.
    """

    help: str
    options: type[T]
    run: Callable[[T], int] | str

    def __call__(self, options: T) -> int:
        """Do it; the exit status."""
        if not isinstance(self.run, str):
            return self.run(options)
        module, _, function = self.run.partition(":")
        return int(getattr(import_module(module), function)(options))


COMMANDS = Registry(
    "commands",
    __name__,
    holding(Command, "COMMAND"),
    first=(
        *("demo", "sim", "video", "camera", "live", "bag", "kitti", "view", "explain"),
        *("info", "convert", "landmarks", "odometry", "trajectory", "calibrate", "tags"),
        *("batch", "query", "compare", "dataset", "nodes", "plugins", "docs", "completion"),
    ),
)
"""All commands, in the order of ``--help``."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit status.

    0 done; 1 the work failed or lost something; 2 wrong usage or an input that cannot be opened;
    130 stopped from outside; see `ros_visualise.core.signals`.

    Raises:
        KeyboardInterrupt: stopped before there was anything to close.
    """
    try:
        given = sys.argv[1:] if arguments is None else arguments
        given = _with_command(given)
        parser = _parser(words_to_complete() or given)
        complete(parser)
        found = vars(parser.parse_args(given))
        name = found.pop("command")
        if name is None:
            parser.print_help()
            return 0
        command = COMMANDS.find(name)
        options = command.options(**found)
        if isinstance(options, MemoryOptions):
            set_max_memory(options.max_memory)
        check_installation()
        print_log()
        interrupt()
        return status_of(command(options))
    except RosVisualiseError as error:
        print_status(f"ros-visualise: {error}")
        return error.exit_status
    except BrokenPipeError:  # the reader of the output has ended
        return 1


class _Parser(argparse.ArgumentParser):
    _is_mixing = False

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse as argparse does; report an unknown option first, with a similar one.

        argparse fills an optional argument at the first gap, so one after an option is left over.
        """
        options = [name for name in self._option_string_actions if name.startswith("--")]
        if self._subparsers is not None:
            self._check_first(args[0] if args else "")
        given = list(args or () if self._subparsers is None else ())  # of a command, that is
        for text in given[: given.index("--")] if "--" in given else given:
            name = text.partition("=")[0]
            if _OPTION.fullmatch(name) and not any(one.startswith(name) for one in options):
                self.error(f"no option {name}{did_you_mean(name, options, listed=False)}")
        found, extra = super().parse_known_args(args, namespace)
        if not extra or self._is_mixing or self._subparsers is not None:
            return found, extra
        self._is_mixing = True
        found, extra = self.parse_known_intermixed_args(args)
        if extra:  # the error of a command names its own help
            self.error(f"unrecognized arguments: {' '.join(extra)}")
        return found, extra

    def _check_first(self, given: str) -> None:
        """Report an option that comes before its command."""
        name = given.partition("=")[0]
        own = self._option_string_actions
        if name.startswith("-") and not any(one.startswith(name) for one in own):
            self.error(f"give a command, file, folder, device or URL before {name}")

    def error(self, message: str) -> NoReturn:
        found = _CHOICE.search(message)
        if found and re.search("[./]", found["given"]):
            message = f"{found['given']}: no such file; give a file, a folder, a URL or a command"
        elif found:
            there = re.findall(r"[^', ]+", found["there"])
            hint = did_you_mean(found["given"], there)
            message = f"{found['what']}: invalid choice '{found['given']}'{hint}"
        print_status(f"{self.prog}: {message}; see {self.prog} --help")
        self.exit(2)


def _with_command(given: Sequence[str]) -> Sequence[str]:
    """The arguments with the command that shows the files that come first, if any do."""
    first = given[0] if given else ""
    if first == "view" and len(given) > 1 and os.path.exists(given[1]):
        return _with_command(given[1:])
    if first in COMMANDS.names() or first.startswith("-"):
        return given
    if _SERVER.match(first):
        return ["live", *given]
    is_device = first.startswith("/dev/") and not (os.path.isfile(first) or os.path.isdir(first))
    if _ADDRESS.match(first) or is_device:
        return ["camera", *given]
    if not first or not os.path.exists(first):
        return given
    is_several = len(given) > 1 and os.path.exists(given[1])
    return ["bag" if is_several else _command_for(Path(first)), *given]


def _command_for(path: Path) -> str:
    from ros_visualise.sources.formats import suffixes
    from ros_visualise.sources.opening import is_recording
    from ros_visualise.sources.trajectory_files import is_trajectory_file

    is_named = path.suffix.lower() in suffixes()  # one that is damaged is best named by its reader
    return "bag" if is_recording(path) or is_named or is_trajectory_file(path) else "video"


def _parser(given: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The parser of all commands; where one is given, it alone is imported and has arguments."""
    parser = _Parser(
        prog="ros-visualise",
        description="See what a robot sees: give a command, or a file, folder, device or URL.",
        epilog=_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, help="show the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    named = next((text for text in given if not text.startswith("-")), "")
    names = COMMANDS.names()
    is_listed = named not in names or given[0] != named  # the help of all
    for name in names:
        commands.add_parser(name, help=_about(name) if is_listed else "")
    if named in names:
        command, chosen = COMMANDS.find(named), commands.choices[named]
        add_arguments(chosen, command.options)
        if named not in COMMANDS.builtin:
            chosen.description = command.help
    return parser


def _about(name: str) -> str:
    if name in COMMANDS.builtin:
        return COMMANDS.find(name).help
    package = next(one.package for one in COMMANDS.plugins() if one.name == name)
    return f"from the package {package}"


class _Version(argparse.Action):
    def __init__(self, option_strings: Sequence[str], dest: str, help: str) -> None:
        super().__init__(option_strings, dest, nargs=0, default=argparse.SUPPRESS, help=help)

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from importlib.metadata import version

        print(f"{parser.prog} {version('ros_visualise')}")
        parser.exit()
