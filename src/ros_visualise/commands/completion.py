"""The command ``completion``."""

from __future__ import annotations

from argparse import Namespace

from ros_visualise.completion import shell_code
from ros_visualise.printing import answer


def run(args: Namespace) -> int:
    """Print what the shell needs; 0."""
    answer(shell_code(args.shell).splitlines())
    return 0
