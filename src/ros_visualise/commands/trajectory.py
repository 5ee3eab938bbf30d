"""``trajectory``: the ways that things went, drawn, written as text, and held against the truth."""

from __future__ import annotations

import json
import shutil
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from ros_visualise.commands.interruptible import interruptible
from ros_visualise.commands.trajectory_comparison import Comparison, compare
from ros_visualise.commands.trajectory_inputs import Inputs, files_read, read_inputs
from ros_visualise.commands.trajectory_report import figures, summary, table, to_json
from ros_visualise.errors import UsageError
from ros_visualise.geometry.planes import Plane, planes_of
from ros_visualise.printing import answer, say, shown
from ros_visualise.sinks.figure import FIGURE_FORMATS
from ros_visualise.sinks.files import TargetFile
from ros_visualise.sinks.names import check_targets, parse_target
from ros_visualise.sinks.trajectory import FORMATS, save
from ros_visualise.sinks.trajectory_plot import Drawn, draw_in_text, plot_trajectories
from ros_visualise.sources.trajectories import Trajectory

_ROWS = 28  # of what is drawn in a terminal
_COLUMNS = (40, 100)  # its least and most width

Compared = list[tuple[Trajectory, Comparison | None]]


def run(args: Namespace) -> int:
    """Read the ways, compare them, write and draw what is asked for, and say what they are."""
    _check(args)
    inputs, compared = interruptible(lambda: _read_and_compare(args))
    drawn = _drawn(inputs, compared)
    planes = planes_of([one.path.positions_xyz for one in drawn], args.plane)
    save(_files(inputs, compared, drawn, planes, args), args.overwrite)
    if args.json:
        answer([json.dumps(_report(inputs, compared, args))])
    else:
        answer(_lines(inputs, compared, drawn, planes, args))
    for note in inputs.notes:
        say(f"ros-visualise: {note}")
    return 1 if inputs.notes or any(one.left_out.get("damaged") for one in inputs.all) else 0


def _check(args: Namespace) -> None:
    """Refuse what cannot be done, before anything is read."""
    if args.align != "none" and args.truth is None:
        raise UsageError(f"--align {args.align}: needs the true trajectory: add --truth TOPIC|FILE")
    beside = (parse_target(name)[1] for name in args.beside)
    count = max(1, len(args.topic)) + sum(max(1, len(topics)) for topics in beside)
    if args.output is not None and count > 1:
        raise UsageError(
            f"{args.output}: can hold only one trajectory; ask for one, or leave OUT away"
        )
    targets = [one for one in (args.output, args.plot) if one is not None]
    for read in files_read(args):
        check_targets(targets, read)
    if args.plot is not None and args.plot.suffix.lower() not in FIGURE_FORMATS:
        kinds = " or ".join(FIGURE_FORMATS)
        raise UsageError(
            f"{args.plot}: a picture is drawn as SVG or PNG; give a name that ends in {kinds}"
        )
    for target in targets:
        TargetFile.check(target, args.overwrite)


def _read_and_compare(args: Namespace) -> tuple[Inputs, Compared]:
    inputs = read_inputs(args)
    truth = inputs.truth
    return inputs, [
        (found, compare(found, truth, args) if truth else None) for found in inputs.trajectories
    ]


def _drawn(inputs: Inputs, compared: Compared) -> list[Drawn]:
    """The truth beneath the others, which lie as they were aligned."""
    truth = inputs.truth
    drawn = [] if truth is None else [Drawn(shown(truth.topic), truth.path, is_truth=True)]
    for found, one in compared:
        path = one.trajectory.path if one else found.path
        astray = (one.moments, one.ate.translation_m) if one else None
        drawn.append(Drawn(shown(found.topic), path, astray=astray))
    return drawn


def _files(
    inputs: Inputs,
    compared: Compared,
    drawn: list[Drawn],
    planes: tuple[Plane, ...],
    args: Namespace,
) -> dict[Path, bytes]:
    files = {}
    found, one = compared[0]
    if args.output is not None:
        if args.format == "tum" and not found.stamped:
            raise UsageError(f"{found.topic}: has no times, which TUM needs; take --format kitti")
        path = one.trajectory.path if one else found.path
        files[args.output] = "".join(FORMATS[args.format](path)).encode()
    if args.plot is not None:
        stamped = all(one.stamped for one in inputs.all)
        figure = plot_trajectories(drawn, planes, _title(found, len(compared)), stamped)
        files[args.plot] = FIGURE_FORMATS[args.plot.suffix.lower()](figure)
    return files


def _title(found: Trajectory, count: int) -> str:
    told = figures(found)
    lasts = f" in {told['duration_s']:.1f} s" if found.stamped else ""
    more = f" and {count - 1} more" if count > 1 else ""
    return f"{shown(found.topic)}: {told['length_m']:.2f} m{lasts}{more}"


def _report(inputs: Inputs, compared: Compared, args: Namespace) -> dict[str, Any]:
    reports = [to_json(found, one, args) for found, one in compared]
    report: dict[str, Any] = reports[0] if len(reports) == 1 else {"trajectories": reports}
    if inputs.truth is not None:
        report["truth"] = to_json(inputs.truth, None, args)
    return report


def _lines(
    inputs: Inputs,
    compared: Compared,
    drawn: list[Drawn],
    planes: tuple[Plane, ...],
    args: Namespace,
) -> list[str]:
    lines = []
    if args.output is None:
        columns = np.clip(shutil.get_terminal_size().columns, *_COLUMNS)
        lines += draw_in_text(drawn, planes, int(columns), _ROWS)
    for found in inputs.all:
        lines += summary(found)
    for _, one in compared:
        if one is not None and inputs.truth is not None:
            lines += ["", *table(one, inputs.truth, args)]
    return lines
