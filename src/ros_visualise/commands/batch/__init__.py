"""``batch``: many recordings through one pipeline, into tables."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, count, option, period, port, positive
from ros_visualise.running.options import MemoryOptions, SettingOptions


@dataclass(frozen=True, kw_only=True)
class BatchOptions(SettingOptions, MemoryOptions):
    """Options of ``batch``."""

    input: Sequence[str] = argument(
        "recordings and videos: files, folders, patterns such as 'flights/**', and @LIST, a file"
        " with one of these in each line; or: status, retry or view, and the folder of results",
        nargs="+",
        metavar="INPUT",
    )
    out: Path | None = option(
        None, "folder for the results; finished work is not repeated", metavar="DIR"
    )
    pipeline: str = option(
        "images",
        "images: the nodes that `ros-visualise FILE` runs (default); landmarks or navigate: as with"
        " --landmarks or --navigate; none: only --node and --fields",
        choices=("images", "landmarks", "navigate", "none"),
    )
    node: Sequence[str] = option(
        [],
        "add a node, as `ros-visualise FILE --node` does; repeatable",
        metavar="NODE[@AFTER][,INPUT=TOPIC]",
    )
    preset: str = option("", "preset for the image nodes, such as soft", metavar="NAME")
    topics: Sequence[str] = option(
        [], "play only these topics", action="extend", nargs="+", metavar="TOPIC"
    )
    image: str | None = option(None, "image topic, or none (default: the first one)")
    odom: str | None = option(None, "topic with the robot's path, or none (default: the first one)")
    fields: Sequence[str] = option(
        [],
        "keep numeric fields, such as '/imu/data.angular_velocity.*'; repeatable",
        metavar="/TOPIC.FIELD",
    )
    record: Sequence[str] = option(
        [],
        "record each run to a file of this name, in DIR/files/RECORDING; repeatable",
        metavar="OUT[@TOPIC,...]",
    )
    export: Sequence[str] = option(
        [],
        "save the images that have detections, as JPEG files; repeatable",
        choices=("pictures",),
    )
    workers: int | None = option(
        None, "number of parallel tasks (default: one per processor)", type=count, metavar="N"
    )
    cluster: str = option(
        "",
        "run the tasks on a Dask cluster; give the address of its scheduler, such as"
        " tcp://192.168.1.10:8786, or local to start one on this machine; inputs"
        " and DIR must be on a disk that all machines of the cluster share",
        metavar="ADDRESS|local",
    )
    device: str = option(
        "cpu",
        "where networks run; cuda needs a GPU and onnxruntime-gpu, and falls back to cpu (default:"
        " cpu)",
        choices=("cpu", "cuda"),
    )
    segment: float | None = option(
        None,
        "split longer recordings into parts of this duration, such as 10m",
        type=period,
        metavar="TIME",
    )
    overlap: float = option(
        10.0,
        "start each part this much earlier, to warm up its nodes (default: 10s)",
        type=period,
        metavar="TIME",
    )
    timeout: float = option(
        3600.0, "abort a task after S seconds (default: 3600)", type=positive, metavar="S"
    )
    port: int = option(
        8080, "port of the page that `view` serves (default: %(default)s)", type=port
    )
    json: bool = option(False, "print a report as one JSON object")


COMMAND = Command(
    "run nodes over many recordings, and write tables of the results",
    BatchOptions,
    "ros_visualise.commands.batch.work:run",
)
