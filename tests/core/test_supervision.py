"""Whoever fails beside the main thread is heard, counted, and takes nobody along."""

import ast
import logging
import subprocess
import sys
import threading
from pathlib import Path

import ros_visualise
from ros_visualise.core.errors import RosVisualiseError
from ros_visualise.core.supervision import Supervisor

PATIENCE_S = 30.0
ROOT = Path(ros_visualise.__file__).parent
STARTS_THREADS = {"Thread", "Timer", "start_new_thread", "ThreadPoolExecutor"}
OF_FUTURES = {
    "batch/local.py",
    "batch/plan.py",
    "sinks/conversion.py",
    "sources/recordings/series.py",
}
"""Whoever takes a message there gets what its making raised."""
COMMAND = """
import sys
from dataclasses import replace
from ros_visualise.core import supervision
from ros_visualise import commands
from ros_visualise.commands import nodes

def run(options):
    supervision.start("poller", lambda: 1 / 0).join()
    return {status}

nodes.COMMAND = replace(nodes.COMMAND, run=run)
sys.exit(commands.main(["nodes"]))
"""


def test_an_error_ends_its_thread_alone_and_is_said_with_its_place(caplog):
    supervisor = Supervisor()
    supervisor.start("poller", lambda: 1 / 0).join(PATIENCE_S)
    (failure,) = supervisor.failures
    assert failure.who == "poller"
    assert failure.kind == "ZeroDivisionError"
    assert failure.place.startswith("test_supervision.py:")
    (record,) = caplog.records
    assert record.levelno == logging.ERROR
    assert failure.place in record.message
    assert "ZeroDivisionError" in caplog.text


def test_a_poller_begins_again_and_its_errors_are_counted_but_said_once(caplog):
    supervisor = Supervisor()
    done = threading.Event()
    calls = []

    def poll():
        calls.append(1)
        if len(calls) < 4:
            raise ValueError(len(calls))
        done.set()

    thread = supervisor.start("poller", poll, again_s=0.0)
    assert done.wait(PATIENCE_S)
    thread.join(PATIENCE_S)
    assert not thread.is_alive()
    assert list(supervisor.failures.values()) == [3]
    assert len(caplog.records) == 1


def test_the_same_error_elsewhere_is_said_too(caplog):
    supervisor = Supervisor()

    def first():
        raise ValueError

    def second():
        raise ValueError

    for work in (first, second, first):
        assert not supervisor.attempt("reader", work)
    assert sorted(supervisor.failures.values()) == [1, 2]
    assert len(caplog.records) == 2


def test_an_exit_within_a_thread_is_a_failure():
    supervisor = Supervisor()
    supervisor.start("poller", sys.exit).join(PATIENCE_S)
    assert [failure.kind for failure in supervisor.failures] == ["SystemExit"]


def test_an_error_of_ours_is_one_line(caplog):
    def refuse():
        raise RosVisualiseError("the disk is full; make room")

    Supervisor().attempt("recorder", refuse)
    assert "the disk is full; make room" in caplog.text
    assert "Traceback" not in caplog.text


def test_what_succeeds_is_no_failure():
    supervisor = Supervisor()
    assert supervisor.attempt("reader", list)
    assert supervisor.failures == {}


def exit_status(of_work: int) -> int:
    code = COMMAND.format(status=of_work)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "poller failed: ZeroDivisionError" in done.stderr
    return done.returncode


def test_a_process_in_which_a_thread_failed_does_not_end_as_done():
    assert exit_status(0) == 1


def test_another_exit_status_stays():
    assert exit_status(130) == 130


def test_whatever_raises_in_a_thread_is_heard():
    class Death(BaseException):
        pass

    def die():
        raise Death

    supervisor = Supervisor()
    supervisor.start("reader", die).join(PATIENCE_S)
    assert [failure.kind for failure in supervisor.failures] == ["Death"]


def test_no_thread_is_started_past_the_supervisor():
    unsupervised = {
        str(path.relative_to(ROOT))
        for path in ROOT.rglob("*.py")
        if path.name != "supervision.py" and STARTS_THREADS & names_in(path.read_text())
    }
    assert unsupervised == OF_FUTURES


def names_in(text: str) -> set[str]:
    """Names that a file calls; none of a file without any that start threads."""
    if not any(name in text for name in STARTS_THREADS):
        return set()
    calls = (one.func for one in ast.walk(ast.parse(text)) if isinstance(one, ast.Call))
    return {ast.unparse(called).rpartition(".")[2] for called in calls}
