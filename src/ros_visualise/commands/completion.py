"""``completion``: code that a shell needs to complete commands and options."""

from __future__ import annotations

from argparse import ArgumentParser
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.core.completion import SHELLS, shell_code
from ros_visualise.core.printing import answer


@dataclass(frozen=True)
class CompletionOptions:
    """Options of ``completion``."""

    shell: str


def add_arguments(parser: ArgumentParser) -> None:
    """For which shell."""
    parser.add_argument("shell", choices=SHELLS, help='for bash and zsh: eval "$(...)"')


def run(options: CompletionOptions) -> int:
    """Print the code; 0."""
    answer(shell_code(options.shell).splitlines())
    return 0


COMMAND = Command(
    "print what a shell needs to complete commands and options",
    add_arguments,
    CompletionOptions,
    run,
)
