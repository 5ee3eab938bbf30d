"""What the commands do: a module for each, with ``run(args)`` that returns the exit status.

Another package brings a command by an entry point of the group ``ros_visualise.commands``; see
`ros_visualise.registry`. It names a `Command`, or a module with ``COMMAND``.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ros_visualise.errors import UsageError
from ros_visualise.registry import Registry


@dataclass(frozen=True)
class Command:
    """A command of another package.

    Attributes:
        help: a line about it.
        add_arguments: adds its arguments to a parser.
        run: does it; gives the exit status. RosVisualiseErrors end it with one line.
    """

    help: str
    add_arguments: Callable[[ArgumentParser], None]
    run: Callable[[Namespace], int]


def _read(held: Any, name: str) -> Command:
    found = getattr(held, "COMMAND", held)
    if not isinstance(found, Command):
        raise UsageError("holds no Command; give one, or a module with COMMAND")
    return found


COMMANDS = Registry("commands", "", _read)
"""The commands of other packages."""
