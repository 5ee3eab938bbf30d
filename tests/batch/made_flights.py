"""Small recordings for batches, and the rows of their results."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any
from unittest import mock

import duckdb
import numpy as np
from made_videos import numbered, write_video

from ros_visualise.commands import main
from ros_visualise.core import limits
from ros_visualise.data import Header, Image, Odometry, Twist
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder
from ros_visualise.sources.demux import open_container, video_stream

UNEQUAL = ("cpu_s", "wall_s", "peak_mb", "key", "path")
"""Columns that differ between two runs of the same work."""

FINDER = """
from dataclasses import dataclass
import numpy as np
from ros_visualise.data import Detection, Detections, Hypothesis, Image
from ros_visualise.nodes import node, param

@dataclass(frozen=True)
class FinderParams:
    level: int = param(0, "least green of the first pixel", min=0, max=255)

@node("finder", params=FinderParams, inputs={"image": Image}, outputs={"things": Detections})
def finder(image, params):
    "The corner, and the background if it is bright enough."
    found = [([8.0, 6.0], "corner")]
    if int(image.pixels[-1, -1, 1]) >= params.level:
        found.append(([24.0, 18.0], "ground"))
    size = np.array([16.0, 12.0])
    return Detections(tuple(
        Detection(np.array(center), size, hypotheses=(Hypothesis(name, 0.5),))
        for center, name in found
    ), image.header)
"""
"""A node that finds two things in an image of `numbered`; one of them if it is bright enough."""


def films(folder: Path, count: int, images: int = 8) -> list[Path]:
    """Films of different lengths."""
    folder.mkdir(parents=True, exist_ok=True)
    return [
        write_video(folder / f"film_{number:02d}.mkv", numbered(images + number))
        for number in range(count)
    ]


def drive(path: Path, count: int = 50, sigma: float = 0.0, truth: bool = False) -> Path:
    """A recording of odometry, 10 Hz at 1 m/s along x, with errors of a standard deviation."""
    path.parent.mkdir(parents=True, exist_ok=True)
    errors = np.random.default_rng(count).normal(0, sigma, (count, 3))
    kind, true = TopicType("nav_msgs/msg/Odometry"), "/ground_truth/odom"
    topics = {"/odom": kind, **({true: kind} if truth else {})}
    still, covariance = np.array([0.0, 0, 0, 1]), np.eye(6) * max(sigma, 0.01) ** 2
    with open_recorder(path, topics, live=False) as recorder:
        for number in range(count):
            place = np.array([number / 10, 0, 0])
            header = Header(1_000_000_000 + number * 100_000_000, "odom")
            for topic, error in zip(topics, (errors[number], 0.0), strict=False):
                odometry = Odometry(place + error, still, pose_covariance=covariance, header=header)
                recorder.write(topic, odometry, header.stamp_ns)
    return path


def camera_drive(
    path: Path, count: int = 20, shade: int = 0, size: tuple[int, int] = (64, 48)
) -> Path:
    """A recording of images, 10 Hz, with odometry at 20 Hz and commands at 5 Hz."""
    path.parent.mkdir(parents=True, exist_ok=True)
    kinds = {"/camera": Image, "/odom": Odometry, "/cmd_vel": Twist}
    topics = {name: TopicType(kind.type_name) for name, kind in kinds.items()}
    zero, still = np.zeros(3), np.array([0.0, 0, 0, 1])
    with open_recorder(path, topics, live=False) as recorder:
        for tick in range(2 * count):
            t_ns = 10**18 + tick * 50_000_000
            header = Header(t_ns, "odom")
            place = np.array([tick / 20, 0, 0])
            recorder.write("/odom", Odometry(place, still, header=header), t_ns)
            if tick % 4 == 0:
                recorder.write("/cmd_vel", Twist(np.array([tick / 4, 0, 0]), zero, header), t_ns)
            if tick % 2 == 0:
                pixels = numbered(count + 1, *size)[tick // 2] // 2 + np.uint8(shade)
                recorder.write("/camera", Image(pixels, "bgr8", Header(t_ns)), t_ns)
    return path


def command(*arguments: object) -> list[str]:
    return [sys.executable, "-m", "ros_visualise", *map(str, arguments)]


def batch(*arguments: object) -> subprocess.CompletedProcess[str]:
    """Run ``batch`` in this process, so that its tasks are forked from one for all tests."""
    words, out, err = ["batch", *map(str, arguments)], io.StringIO(), io.StringIO()
    with (
        mock.patch("signal.signal"),
        mock.patch.dict(os.environ, environment()),
        # else tasks would import pytest
        mock.patch.object(sys.modules["__main__"], "__file__", None, create=True),
        mock.patch.object(limits, "_max_memory"),
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        status = main(words)
    return subprocess.CompletedProcess(words, status, out.getvalue(), err.getvalue())


def environment() -> dict[str, str]:
    return os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def rows(results: Path, table: str, *without: str) -> list[tuple[Any, ...]]:
    """All rows of a table but for what differs from run to run, as sorted texts."""
    with duckdb.connect() as sql:
        names = [
            name
            for name, *_ in sql.execute(f"DESCRIBE FROM '{results}/{table}.parquet'").fetchall()
            if name not in (*UNEQUAL, *without) and not name.endswith("_ms")
        ]
        found = sql.execute(f"SELECT {', '.join(names)} FROM '{results}/{table}.parquet'")
        return sorted(found.fetchall(), key=repr)


def decoding_threads(film: Path) -> int:
    with open_container(film) as container:
        return int(video_stream(container, film).codec_context.thread_count)


def ask(results: Path, query: str) -> list[tuple[Any, ...]]:
    """The rows of a query whose ``{}`` is the folder."""
    with duckdb.connect() as sql:
        return sql.execute(query.format(results)).fetchall()
