"""``trajectory``: the way that something went, as a text file and a picture."""

from __future__ import annotations

import json
from argparse import Namespace
from contextlib import closing
from dataclasses import asdict
from typing import Any

from ros_visualise.commands.interruptible import interruptible
from ros_visualise.commands.wording import counted
from ros_visualise.errors import UsageError
from ros_visualise.geometry.travel import Travel
from ros_visualise.printing import answer, say, shown
from ros_visualise.sinks.figure import FIGURE_FORMATS
from ros_visualise.sinks.files import TargetFile
from ros_visualise.sinks.names import check_targets
from ros_visualise.sinks.trajectory import FORMATS, save
from ros_visualise.sinks.trajectory_plot import plot_trajectory
from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.trajectories import Trajectory, read_trajectory


def run(args: Namespace) -> int:
    """Write the way, draw it if that is asked for, and say what it is."""
    _check(args)
    found, loss = interruptible(lambda: _read(args.input, args.topic))
    files = {args.output: "".join(FORMATS[args.format](found.path)).encode()}
    figures = _figures(found)
    if args.plot is not None:
        figure = plot_trajectory(found.path, _title(found, figures))
        files[args.plot] = FIGURE_FORMATS[args.plot.suffix.lower()](figure)
    save(files, args.overwrite)
    report = [json.dumps(_report(found, figures, args))]
    answer(report if args.json else _summary(found, figures))
    for note in loss.notes:
        say(f"ros-visualise: {args.input}: {note}")
    return 1 if loss or found.left_out.get("damaged") else 0


def _check(args: Namespace) -> None:
    """Refuse what cannot be written, before anything is read."""
    targets = [args.output] if args.plot is None else [args.output, args.plot]
    check_targets(targets, args.input)
    if args.plot is not None and args.plot.suffix.lower() not in FIGURE_FORMATS:
        kinds = " or ".join(FIGURE_FORMATS)
        raise UsageError(
            f"{args.plot}: a picture is drawn as SVG or PNG; give a name that ends in {kinds}"
        )
    for target in targets:
        TargetFile.check(target, args.overwrite)


def _read(path: str, topic: str | None) -> tuple[Trajectory, Loss]:
    with closing(open_recording(path)) as recording:
        return read_trajectory(recording, topic), recording.loss


def _figures(found: Trajectory) -> dict[str, Any]:
    travel = Travel()
    for stamp_ns, position in zip(
        found.path.stamps_ns.tolist(), found.path.positions_xyz.tolist(), strict=True
    ):
        travel.add(stamp_ns, position)
    return {"poses": len(found.path.stamps_ns), **asdict(travel.summary())}


def _title(found: Trajectory, figures: dict[str, Any]) -> str:
    return f"{shown(found.topic)}: {figures['length_m']:.2f} m in {figures['duration_s']:.1f} s"


def _report(found: Trajectory, figures: dict[str, Any], args: Namespace) -> dict[str, Any]:
    return {
        "path": str(args.input),
        "topic": found.topic,
        "frame": found.path.header.frame_id,
        "start": int(found.path.stamps_ns[0]) / 1e9,
        **figures,
        "left_out": found.left_out,
        "unordered": found.unordered,
        "repeated": found.repeated,
        "without_attitude": found.without_attitude,
    }


def _summary(found: Trajectory, figures: dict[str, Any]) -> list[str]:
    frame = found.path.header.frame_id
    poses = counted(figures["poses"], "pose")
    lines = [
        f"{found.topic}: {poses}{f' in the frame {frame}' if frame else ''}",
        f"length:     {figures['length_m']:.3f} m",
        f"duration:   {figures['duration_s']:.3f} s",
    ]
    if figures["mean_mps"] is not None:
        lines.append(f"mean speed: {figures['mean_mps']:.3f} m/s")
        lines.append(f"top speed:  {figures['top_mps']:.3f} m/s over a second")
    for why, count in found.left_out.items():
        lines.append(f"left out:   {count} {why}")
    if found.unordered:
        lines.append(f"sorted:     {found.unordered} came after later ones")
    if found.repeated:
        lines.append(
            f"stamps:     {found.repeated} are those of the pose before; programs that need each"
            " once will refuse them"
        )
    if found.without_attitude:
        lines.append(f"attitude:   {found.without_attitude} had none; written as that of the frame")
    return lines
