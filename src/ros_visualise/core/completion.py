"""Completion of commands and options in a shell, by argcomplete.

The shell calls the program itself at each TAB, with ``_ARGCOMPLETE`` in its environment.
"""

from __future__ import annotations

import os
from argparse import ArgumentParser

from ros_visualise.core.errors import OpenError

SHELLS = ("bash", "zsh", "fish")
_PROGRAM = "ros-visualise"


def words_to_complete() -> list[str]:
    """Words after the program in the line that a shell completes; none if no shell asks."""
    return os.environ.get("COMP_LINE", "").split()[1:] if "_ARGCOMPLETE" in os.environ else []


def complete(parser: ArgumentParser) -> None:
    """Answer a shell that asks for completions, and exit; otherwise do nothing."""
    if "_ARGCOMPLETE" in os.environ:
        import argcomplete

        argcomplete.autocomplete(parser)


def shell_code(shell: str) -> str:
    """Code that a shell runs at its start to enable completion.

    Raises:
        OpenError: argcomplete is not installed.
    """
    try:
        from argcomplete.shell_integration import shellcode
    except ImportError:
        raise OpenError("not installed: argcomplete; pip install argcomplete") from None
    return shellcode([_PROGRAM], shell=shell)
