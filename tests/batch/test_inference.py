"""Tasks of a batch have their networks run by one process for each GPU; here on the CPU."""

import os
import signal
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_flights import batch, rows
from made_videos import write_video

from ros_visualise.batch import inference
from ros_visualise.commands import main
from ros_visualise.landmarks.networks.session import Provider

WITH_NETWORK = ("--pipeline", "none", "--node", "landmark_detector@streamer", "--workers", "2")
CLOSE = 1e-3


def flights(folder, count, images):
    """Films of a helipad that moves."""
    folder.mkdir()
    for number in range(count):
        shown = np.full((images, 240, 320, 3), (60, 140, 90), np.uint8)
        for tick, picture in enumerate(shown):
            centre = (100 + 5 * tick + 10 * number, 120)
            cv2.circle(picture, centre, 60, (70, 70, 70), -1)
            cv2.circle(picture, centre, 54, (255, 255, 255), 4)
            text = (centre[0] - 25, centre[1] + 25)
            cv2.putText(picture, "H", text, 0, 2.4, (255, 255, 255), 10)
        write_video(folder / f"{number}.mkv", shown)
    return folder


@pytest.fixture(scope="module")
def expected(tmp_path_factory):
    """Films, and the results of a batch that finds no GPU: its tasks run their networks."""
    folder = tmp_path_factory.mktemp("networks")
    flights(folder / "in", 2, 4)
    done = batch(folder / "in", "--out", folder / "out", *WITH_NETWORK, "--device", "cuda")
    assert done.returncode == 0, done.stderr
    assert "--device cuda: no GPU, or no onnxruntime-gpu; networks run on the CPU" in done.stderr
    return folder


@pytest.fixture
def started(monkeypatch):
    """The servers that a batch in this process starts, on the CPU."""
    servers = []

    class Noted(inference._GpuServer):
        def __enter__(self):
            servers.append(self)
            return super().__enter__()

    monkeypatch.setattr(inference, "_GpuServer", Noted)
    monkeypatch.setattr(inference, "_PROVIDER", Provider.CPU)
    monkeypatch.setattr(inference, "gpus", lambda: 1)
    monkeypatch.setattr(inference, "_LOOK_S", 0.1)
    monkeypatch.setattr("signal.signal", lambda *_: None)
    return servers


def on_gpu(folder, out):
    words = [str(folder), "--out", str(out), *WITH_NETWORK, "--device", "cuda"]
    return main(["batch", *words])


def assert_same_rows(found, expected):
    for table in ("topics", "detections"):
        pairs = list(zip(rows(found, table), rows(expected, table), strict=True))
        assert pairs
        for one, other in pairs:
            for value, true in zip(one, other, strict=True):
                if isinstance(true, float):
                    assert value == pytest.approx(true, abs=320 * CLOSE)
                else:
                    assert value == true


def test_rows_are_those_of_tasks_with_their_own_networks(expected, started, tmp_path):
    assert on_gpu(expected / "in", tmp_path / "out") == 0
    assert_same_rows(tmp_path / "out", expected / "out")
    assert len(rows(tmp_path / "out", "detections")) == 8
    [server] = started
    assert not server._process.is_alive()


def ticks(process):
    """CPU time of a process, in hundredths of a second."""
    fields = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
    return int(fields[11]) + int(fields[12])


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_a_lost_server_is_started_again_and_no_row_is_lost(
    expected, started, tmp_path, monkeypatch, how
):
    monkeypatch.setattr(inference, "_HANG_S", 4.0)
    lost = []

    def lose():
        while not list((tmp_path / "out" / "tasks").glob("*.part")):
            time.sleep(0.01)
        lost.append(started[0]._process.pid)
        idle = ticks(lost[0])
        while ticks(lost[0]) < idle + 3:  # until it works
            time.sleep(0.005)
        os.kill(lost[0], how)

    loser = threading.Thread(target=lose, daemon=True)
    loser.start()
    assert on_gpu(expected / "in", tmp_path / "out") == 0
    loser.join(1)
    assert started[0]._process.pid != lost[0]
    assert_same_rows(tmp_path / "out", expected / "out")


def test_a_server_that_always_ends_fails_tasks_with_a_reason(
    expected, started, tmp_path, monkeypatch
):
    monkeypatch.setattr(inference, "_LOOK_S", 0.1)  # less than a film takes
    monkeypatch.setattr(inference._GpuServer, "_answers", lambda self: False)
    assert on_gpu(expected / "in" / "0.mkv", tmp_path / "out") == 1
    [failure] = rows(tmp_path / "out", "failures")
    assert "crash" in failure
    assert "the process that runs the networks has ended" in failure
