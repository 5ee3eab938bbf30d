"""``--cluster`` runs the same tasks on a Dask cluster, whose workers may be lost."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from made_flights import batch, command, environment, rows
from ports import free_port

from ros_visualise.batch.apart import Limits
from ros_visualise.batch.cluster import attempt
from ros_visualise.batch.plan import task_of
from ros_visualise.batch.results import Planned, Results
from ros_visualise.batch.task import run_task
from ros_visualise.batch.work import Work
from ros_visualise.commands.batch.work import _run

SLOW = """
import os, time
from ros_visualise.data import Image, Number
from ros_visualise.nodes import node

@node("slow", inputs={"image": Image}, outputs={"mean": Number})
def slow(image, params):
    "Takes its time."
    assert "MALLOC_TRIM_THRESHOLD_" not in os.environ  # with it, images take a sixth more time
    time.sleep(0.02)
    return Number(float(image.pixels.mean()), image.header)
"""
PATIENCE_S = 60


@pytest.fixture
def cluster(tmp_path):
    """The address of a scheduler, and its two workers, each a process group."""
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    dask, quiet = [sys.executable, "-m", "distributed.cli"], {"stderr": subprocess.DEVNULL}
    scheduler = [*("--host", "127.0.0.1", "--port", str(port)), "--no-dashboard", "--no-show"]
    worker = [address, "--nthreads", "1", "--no-dashboard", "--local-directory", str(tmp_path)]
    started = [
        subprocess.Popen(
            [*dask[:2], f"{dask[2]}.{name}", *options],
            env=environment() | {"MALLOC_TRIM_THRESHOLD_": "65536"},  # as Dask gives its workers
            start_new_session=True,
            **quiet,
        )
        for name, options in (
            ("dask_scheduler", scheduler),
            ("dask_worker", worker),
            ("dask_worker", worker),
        )
    ]
    yield address, started[1:]
    for process in started:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            continue
        finally:
            process.wait()


def test_a_lost_worker_loses_no_row(once, tmp_path, cluster):
    address, workers = cluster
    node = tmp_path / "slow.py"
    node.write_text(SLOW)
    films = (once / "in" / "film_*.mkv", "--node", f"{node}:slow", "--pipeline", "none")
    here = batch(*films, "--out", tmp_path / "here")
    assert here.returncode == 0, here.stderr
    out = tmp_path / "there"
    driver = subprocess.Popen(
        command("batch", *films, "--out", out, "--cluster", address, "--json"),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
    )
    kill_one_at_work(out / "tasks", workers)
    said, errors = driver.communicate(timeout=PATIENCE_S)
    assert driver.returncode == 0, errors
    assert json.loads(said)["done"] == 6
    for table in ("fields", "image_stats", "topics"):
        assert rows(out, table) == rows(tmp_path / "here", table), table
    assert not Results(out).failures()


def kill_one_at_work(tasks: Path, workers: list[subprocess.Popen[bytes]]) -> None:
    """Kill a worker, with all that it has started, while a process of it runs a task."""
    end_s = time.monotonic() + PATIENCE_S
    while time.monotonic() < end_s:
        for part in tasks.glob("*.part"):
            pid = int(part.name.split(".")[-2])
            for worker in workers:
                if group_of(pid) == worker.pid:
                    os.killpg(worker.pid, signal.SIGKILL)
                    return
        time.sleep(0.005)
    raise AssertionError("no task began")


def group_of(pid: int) -> int:
    try:
        return os.getpgid(pid)
    except ProcessLookupError:
        return 0


def test_a_disk_that_a_machine_does_not_share_is_a_row(tmp_path):
    results = Results(tmp_path)
    results.create()
    planned = Planned("key", "film.mkv", "/nowhere/film.mkv", 1, "")
    task = task_of(planned, Work(), results)
    unseen = attempt(run_task, task, Limits(60, 1 << 30))
    assert unseen.kind == "open"
    assert unseen.reason.startswith(f"/nowhere/film.mkv: not found on {socket.gethostname()}; ")
    assert _run(results, {"key": planned}, iter([(task, None)]), 1) == 1, "it wrote elsewhere"
    assert "on a disk that all machines share" in results.failure("key").reason


def test_a_missing_scheduler_is_one_line(once, tmp_path, monkeypatch):
    monkeypatch.setattr("ros_visualise.batch.cluster._PATIENCE_S", 0.2)
    from ros_visualise.commands import main

    monkeypatch.setattr("signal.signal", lambda *_: None)
    said = []
    monkeypatch.setattr("ros_visualise.commands.print_status", said.append)
    inputs, out = str(once / "in" / "film_00.mkv"), str(tmp_path / "out")
    assert main(["batch", inputs, "--out", out, "--cluster", "tcp://127.0.0.1:1"]) == 2
    assert "no scheduler answers" in said[0]
