"""Reading trajectories, comparing them, writing and drawing them."""

from __future__ import annotations

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.commands.trajectory import TrajectoryOptions
from ros_visualise.commands.trajectory.inputs import Inputs, files_read, read_inputs
from ros_visualise.commands.trajectory.report import figures, summary, table, to_json
from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import counted, escaped, print_json, print_result, print_status
from ros_visualise.geometry.trajectory_errors import parse_delta
from ros_visualise.plotting.figure import FIGURE_FORMATS
from ros_visualise.plotting.trajectory_plot import (
    Plane,
    PlottedTrajectory,
    draw_in_text,
    planes_of,
    plot_trajectories,
)
from ros_visualise.running.interruptible import interruptible
from ros_visualise.sinks.files import check_new
from ros_visualise.sinks.names import parse_target
from ros_visualise.sinks.trajectory import FORMATS, save
from ros_visualise.sources.comparison import Comparison, compare
from ros_visualise.sources.trajectories import Trajectory

_UNITS_PER_MM = 96 / 25.4  # of figures
_ROWS = 28  # of what is drawn in a terminal
_COLUMNS = (40, 100)  # its least and most width

Compared = list[tuple[Trajectory, Comparison | None]]


def assess(options: TrajectoryOptions) -> int:
    """Read, compare, write and draw trajectories, and print a summary."""
    _check(options)
    inputs, compared = interruptible(lambda: _read_and_compare(options))
    drawn = _drawn(inputs, compared, options.label)
    planes = planes_of([one.path.positions_xyz for one in drawn], options.plane)
    files = _files(inputs, compared, drawn, planes, options)
    save(files, options.overwrite)
    if options.json:
        print_json(_report(inputs, compared, options))
    else:
        print_result(_lines(inputs, compared, drawn, planes, options))
    for file in files:
        print_status(f"{file}: written")
    for note in inputs.notes:
        print_status(f"ros-visualise: {note}")
    return 1 if inputs.notes or any(one.skipped.get("damaged") for one in inputs.all) else 0


def _check(options: TrajectoryOptions) -> None:
    """Reject wrong usage before anything is read."""
    parse_delta(options.delta)
    if options.align != "none" and options.truth is None:
        raise UsageError(
            f"--align {options.align}: needs the true trajectory; add --truth TOPIC|FILE"
        )
    beside = (parse_target(name)[1] for name in options.beside)
    count = max(1, len(options.topic)) + sum(max(1, len(topics)) for topics in beside)
    if options.output is not None and count > 1:
        raise UsageError(
            f"{options.output}: can store only one trajectory; choose one, or omit OUT"
        )
    check_new((options.output, options.plot), options.overwrite, *files_read(options))
    if options.plot is not None and options.plot.suffix.lower() not in FIGURE_FORMATS:
        kinds = " or ".join(FIGURE_FORMATS)
        raise UsageError(
            f"{options.plot}: plots are PNG, SVG or PDF files; give a name that ends in {kinds}"
        )


def _read_and_compare(options: TrajectoryOptions) -> tuple[Inputs, Compared]:
    inputs = read_inputs(options)
    truth, delta = inputs.truth, parse_delta(options.delta)

    def against(truth: Trajectory, found: Trajectory) -> Comparison:
        return compare(found, truth, options.align, delta, options.max_difference)

    return inputs, [
        (found, against(truth, found) if truth else None) for found in inputs.trajectories
    ]


def _drawn(inputs: Inputs, compared: Compared, labels: Sequence[str]) -> list[PlottedTrajectory]:
    """The truth below the others, which are aligned.

    Raises:
        UsageError: more labels than trajectories.
    """
    if len(labels) > len(inputs.all):
        paths = counted(len(inputs.all), "path")
        raise UsageError(f"--label: {counted(len(labels), 'name')} for {paths}")
    short = short_names([one.topic for one in inputs.all])
    names = [escaped(name) for name in (*labels, *short[len(labels) :])]
    truth = inputs.truth
    drawn = [] if truth is None else [PlottedTrajectory(names[-1], truth.path, is_truth=True)]
    for name, (found, one) in zip(names, compared, strict=False):
        path = one.trajectory.path if one else found.path
        errors = (one.moments, one.ate.translation_m) if one else None
        drawn.append(PlottedTrajectory(name, path, errors=errors))
    return drawn


def short_names(names: Sequence[str]) -> list[str]:
    """Names of topics and files, without the folders that are not needed to tell them apart."""

    def shortened(name: str, parts: int) -> str:
        path, at, topic = name.partition("@/")
        return "/".join(Path(path).parts[-parts:]) + at + topic if os.path.isfile(path) else name

    for parts in range(1, max(len(Path(name).parts) for name in names)):
        found = [shortened(name, parts) for name in names]
        if len({*found}) == len({*names}):
            return found
    return list(names)


def _files(
    inputs: Inputs,
    compared: Compared,
    drawn: list[PlottedTrajectory],
    planes: tuple[Plane, ...],
    options: TrajectoryOptions,
) -> dict[Path, bytes]:
    files = {}
    found, one = compared[0]
    if options.output is not None:
        if options.format == "tum" and not found.stamped:
            raise UsageError(
                f"{found.topic}: has no time stamps, which the TUM format requires; use --format"
                " kitti"
            )
        path = one.trajectory.path if one else found.path
        files[options.output] = "".join(FORMATS[options.format](path)).encode()
    if options.plot is not None:
        stamped = all(one.stamped for one in inputs.all)
        title = options.title
        if title is None:
            name = next(one.name for one in drawn if not one.is_truth)
            title = _title(name, found, len(compared))
        width = round(options.width * _UNITS_PER_MM)
        figure = plot_trajectories(drawn, planes, title, stamped, width)
        files[options.plot] = FIGURE_FORMATS[options.plot.suffix.lower()](figure)
    return files


def _title(name: str, found: Trajectory, count: int) -> str:
    values = figures(found)
    lasts = f" in {values['duration_s']:.1f} s" if found.stamped else ""
    more = f" and {count - 1} more" if count > 1 else ""
    return f"{name}: {values['length_m']:.2f} m{lasts}{more}"


def _report(inputs: Inputs, compared: Compared, options: TrajectoryOptions) -> dict[str, Any]:
    reports = [to_json(found, one, options) for found, one in compared]
    report: dict[str, Any] = reports[0] if len(reports) == 1 else {"trajectories": reports}
    if inputs.truth is not None:
        report["truth"] = to_json(inputs.truth, None, options)
    return report


def _lines(
    inputs: Inputs,
    compared: Compared,
    drawn: list[PlottedTrajectory],
    planes: tuple[Plane, ...],
    options: TrajectoryOptions,
) -> list[str]:
    lines = []
    if options.output is None:
        columns = np.clip(shutil.get_terminal_size().columns, *_COLUMNS)
        lines += draw_in_text(drawn, planes, int(columns), _ROWS)
    for found in inputs.all:
        lines += summary(found)
    for _, one in compared:
        if one is not None and inputs.truth is not None:
            lines += ["", *table(one, inputs.truth)]
    return lines
