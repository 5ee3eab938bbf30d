"""``dataset``: pictures and labels for learning, of the results of a batch."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, count, not_negative, option


@dataclass(frozen=True, kw_only=True)
class DatasetOptions:
    """Options of ``dataset``."""

    results: Path = argument("folder of a batch's results", metavar="DIR")
    out: Path = argument("new folder for the data set", metavar="OUT")
    format: str = option(
        "coco",
        "coco (default) or yolo: images and boxes of detections; lerobot (format version 3):"
        " images, poses and actions of robots",
        choices=("coco", "yolo", "lerobot"),
    )
    validation: float = option(
        0.2,
        "fraction of the recordings used for validation, 0 to 1 (default: 0.2)",
        type=not_negative,
        metavar="SHARE",
    )
    every: int = option(
        1, "of the images with detections, use only every N-th", type=count, metavar="N"
    )
    action: str = option(
        "",
        "for lerobot, the topic of the robot's commands; the batch must have kept it, with --fields"
        " '/cmd_vel.*' (default: the velocity computed from the poses)",
        metavar="TOPIC",
    )


def run(options: DatasetOptions) -> int:
    """Write a data set, whole or not at all."""
    import os
    import shutil
    from importlib import import_module

    from ros_visualise.batch.datasets import DatasetSource
    from ros_visualise.core.errors import OpenError, UsageError
    from ros_visualise.core.printing import counted, print_result

    if options.validation > 1:
        raise UsageError(f"--validation {options.validation:g}: give a fraction from 0 to 1")
    if os.path.lexists(options.out):
        raise OpenError(f"{options.out}: already exists; give a new folder")
    writer = import_module(f"ros_visualise.batch.datasets.{options.format}")
    new = options.out.with_name(f"{options.out.name}.part")
    shutil.rmtree(new, ignore_errors=True)
    source = DatasetSource(options.results, options.validation, options.every, options.action)
    try:
        written = writer.write(source, new)
        new.rename(options.out)
    except OSError as error:
        raise OpenError(f"{options.out}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(new, ignore_errors=True)
    print_result([f"{options.out}: {counted(written, 'image')}"])
    return 0


COMMAND = Command("make a training data set from batch results", DatasetOptions, run)
