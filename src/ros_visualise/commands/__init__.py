"""Commands: a module for each, or a folder where one takes more than a file.

Each module holds a `Command` as ``COMMAND``. It is light to import: what is heavy is imported
where the command runs. Another package brings a command by an entry point of the group
``ros_visualise.commands``; see `ros_visualise.registry`.
"""

from __future__ import annotations

from argparse import ArgumentParser
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from ros_visualise.registry import Registry, holding

T = TypeVar("T")


@dataclass(frozen=True)
class Command(Generic[T]):
    """A command.

    Attributes:
        help: a line about it.
        add_arguments: adds its arguments to a parser.
        options: frozen dataclass with a field for each argument, by its ``dest``; a field with a
            default needs none.
        run: does it; gives the exit status. RosVisualiseErrors end it with one line.
    """

    help: str
    add_arguments: Callable[[ArgumentParser], None]
    options: Callable[..., T]
    run: Callable[[T], int]


COMMANDS = Registry(
    "commands",
    __name__,
    holding(Command, "COMMAND"),
    first=(
        *("demo", "sim", "video", "camera", "bag", "kitti", "explain"),
        *("info", "convert", "landmarks", "trajectory", "calibrate"),
        *("nodes", "plugins", "completion"),
    ),
)
"""All commands, in the order of ``--help``."""
