"""Entry points of all processes; Ctrl-C ends them from the first line on, also during imports."""

import _signal  # not signal, whose own imports could be interrupted

_signal.signal(_signal.SIGINT, _signal.SIG_DFL)

import atexit  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402

# Nodes are threads already; those of NumPy's library of matrices would wait for work at full load.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ros_visualise.core.signals import DONE, STOPPED, exit_at_once, ignore, leave  # noqa: E402


def main() -> int:
    """Run ``ros-visualise``; return its exit status, see `ros_visualise.commands.main`."""
    exit_at_once()
    ended: list[int] = []
    atexit.register(leave, ended)  # before all others, so that it is called after them
    try:
        from ros_visualise import commands

        ended.append(commands.main())
        ignore()  # nothing is left to be ended
    except KeyboardInterrupt:
        ended.append(STOPPED)
    return ended[-1]


def run_executable(name: str) -> None:
    """Run a ROS executable; see `ros_visualise.running.executables`.

    When it is asked to end, however early, its exit status is 0: with another one a launch reports
    that it has died.
    """
    exit_at_once(DONE)
    ended = [1]  # after a bug, whose traceback is printed by then
    atexit.register(leave, ended)  # before all others, so that it is called after them
    from ros_visualise.running.executables import run

    try:
        run(name)
    except SystemExit as end:
        ended.append(int(end.code or 0))
        raise


if __name__ == "__main__":
    sys.exit(main())
