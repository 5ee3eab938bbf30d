"""``completion``: shell code that completes commands and options."""

from __future__ import annotations

from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.core.completion import SHELLS, shell_code
from ros_visualise.core.printing import print_result
from ros_visualise.running.arguments import argument


@dataclass(frozen=True)
class CompletionOptions:
    """Options of ``completion``."""

    shell: str = argument('for bash and zsh: eval "$(...)"', choices=SHELLS)


def run(options: CompletionOptions) -> int:
    """Print the code; the exit status is 0."""
    print_result(shell_code(options.shell).splitlines())
    return 0


COMMAND = Command(
    "print a shell script that completes commands and options", CompletionOptions, run
)
