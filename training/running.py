"""Exit of the commands in this folder."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import NoReturn

from ros_visualise.core.errors import RosVisualiseError


def run(main: Callable[[], int]) -> NoReturn:
    """Run a command and exit: what is refused is one line, and Ctrl-C ends it without any."""
    try:
        status = main()
    except RosVisualiseError as error:
        print(error, file=sys.stderr)
        status = error.exit_status
    except KeyboardInterrupt:
        status = 130
    sys.exit(status)
