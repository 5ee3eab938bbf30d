"""Where processes begin: from the first line on, whatever is still imported, Ctrl-C ends them."""

import _signal  # not signal, whose own imports could be interrupted

_signal.signal(_signal.SIGINT, _signal.SIG_DFL)

import atexit  # noqa: E402
import os  # noqa: E402

# Nodes are threads already; those of NumPy's library of matrices would wait for work at full load.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from ros_visualise.signals import DONE, STOPPED, ignore, leave, leave_at_once  # noqa: E402


def main() -> int:
    """``ros-visualise``; the exit status, see `ros_visualise.cli.main`."""
    leave_at_once()
    ended: list[int] = []
    atexit.register(leave, ended)  # before all others, so that it is called after them
    try:
        from ros_visualise import cli

        ended.append(cli.main())
        ignore()  # nothing is left to be ended
    except KeyboardInterrupt:
        ended.append(STOPPED)
    return ended[-1]


def run_executable(name: str) -> None:
    """A ROS executable, by its name; see `ros_visualise.executables`.

    It runs until it is asked to end, so that its exit status is 0 then, however early: with another
    one a launch says that it has died.
    """
    leave_at_once(DONE)
    ended = [1]  # after a bug, whose traceback is printed by then
    atexit.register(leave, ended)  # before all others, so that it is called after them
    from ros_visualise.executables import run

    try:
        run(name)
    except SystemExit as end:
        ended.append(int(end.code or 0))
        raise
