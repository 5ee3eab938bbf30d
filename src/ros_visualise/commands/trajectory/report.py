"""Report of ``trajectory``: lines for people, an object for programs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from ros_visualise.commands.trajectory import TrajectoryOptions
from ros_visualise.core.printing import counted, in_columns
from ros_visualise.data import Floats
from ros_visualise.geometry.se3 import from_parts
from ros_visualise.geometry.trajectory_errors import PoseErrors, statistics
from ros_visualise.geometry.travel import Travel
from ros_visualise.sources.comparison import Comparison
from ros_visualise.sources.trajectories import Trajectory

_COLUMNS = ("rmse", "mean", "median", "std", "min", "max")


def to_json(
    found: Trajectory, compared: Comparison | None, options: TrajectoryOptions
) -> dict[str, Any]:
    """The report as JSON; see the documentation."""
    report = {
        "path": str(options.input),
        "topic": found.topic,
        "frame": found.path.header.frame_id,
        "start": int(found.path.stamps_ns[0]) / 1e9 if found.stamped else None,
        **figures(found),
        "skipped": found.skipped,
        "unordered": found.unordered,
        "repeated": found.repeated,
        "without_attitude": found.without_attitude,
    }
    if compared is not None:
        report["errors"] = _errors(compared)
    return report


def figures(found: Trajectory) -> dict[str, Any]:
    """Number of poses, length, duration and speeds."""
    travel = Travel()
    for stamp_ns, position in zip(
        found.path.stamps_ns.tolist(), found.path.positions_xyz.tolist(), strict=True
    ):
        travel.add(stamp_ns, position)
    values = {"poses": len(found.path.stamps_ns), **asdict(travel.summary())}
    return values if found.stamped else {**values, "duration_s": None}


def summary(found: Trajectory) -> list[str]:
    """Lines on a trajectory and its anomalies."""
    values, frame = figures(found), found.path.header.frame_id
    where = f" in the frame {frame}" if frame else ""
    lines = [
        f"{found.topic}: {counted(values['poses'], 'pose')}{where}",
        f"length:     {values['length_m']:.3f} m",
    ]
    if found.stamped:
        lines.append(f"duration:   {values['duration_s']:.3f} s")
    if values["mean_mps"] is not None:
        lines.append(f"mean speed: {values['mean_mps']:.3f} m/s")
        lines.append(f"top speed:  {values['top_mps']:.3f} m/s over a second")
    for why, count in found.skipped.items():
        lines.append(f"skipped:    {count} {why}")
    if found.unordered:
        lines.append(f"order:      {counted(found.unordered, 'pose')} out of order; sorted by time")
    if found.repeated:
        lines.append(
            f"stamps:     {found.repeated} repeat the previous one; some programs reject such files"
        )
    if found.without_attitude:
        lines.append(f"attitude:   {found.without_attitude} missing; written as identity rotations")
    return lines


def table(compared: Comparison, truth: Trajectory) -> list[str]:
    """The errors, as the package evo defines them."""
    rows = [["", *_COLUMNS, "pairs"]]
    for name, errors in _measures(compared).items():
        numbers = statistics(errors)
        row = [name, *(f"{numbers[column]:.6f}" for column in _COLUMNS)]
        rows.append([*row, str(len(errors))])
    lines = [f"{compared.trajectory.topic} against {truth.topic}: {_how(compared, truth)}"]
    lines += in_columns(rows, numbers=True)
    if not compared.turns:
        flat = " and ".join(compared.without_attitude)
        lengths = ", and the RPE compares the lengths of the steps" * (compared.rpe is not None)
        lines.append(f"(no rotations in {flat}: no errors in degrees{lengths})")
        if compared.align == "origin":
            lines.append("(aligned by a first attitude that may be unknown; try --align se3)")
    if compared.rpe is None:
        lines.append(f"(no RPE, because no two poses are {compared.delta.words} apart)")
    return lines


def _how(compared: Comparison, truth: Trajectory) -> str:
    pairs = counted(len(compared.moments), "pose")
    frames = compared.trajectory.path.header.frame_id, truth.path.header.frame_id
    if compared.align == "none":
        differ = all(frames) and frames[0] != frames[1]
        how = f"not aligned{f', though the frames differ ({frames[0]}, {frames[1]})' * differ}"
    else:
        scale = f", scale {compared.alignment.s:.6f}" if compared.align == "sim3" else ""
        how = f"aligned by {compared.align}{scale}"
    apart = f" at most {compared.apart_s:.4f} s apart" if truth.stamped else ""
    return f"{pairs}{apart}, {how}"


def _measures(compared: Comparison) -> dict[str, Floats]:
    found = {"ATE (m)": compared.ate.translation_m}
    if compared.turns:
        found["ATE (deg)"] = compared.ate.rotation_deg
    if compared.rpe is not None:
        found[f"RPE (m) over {compared.delta.words}"] = compared.rpe.translation_m
        if compared.turns:
            found[f"RPE (deg) over {compared.delta.words}"] = compared.rpe.rotation_deg
    return found


def _errors(compared: Comparison) -> dict[str, Any]:
    alignment = compared.alignment
    return {
        "poses": len(compared.moments),
        "apart_s": compared.apart_s,
        "align": compared.align,
        "scale": alignment.s,
        "T_truth_frame": from_parts(alignment.R, alignment.t).tolist(),
        "delta": str(compared.delta),
        "ate": _values(compared.ate, compared.turns),
        "rpe": _values(compared.rpe, compared.turns),
    }


def _values(errors: PoseErrors | None, turns: bool) -> dict[str, Any] | None:
    if errors is None:
        return None
    rotation = statistics(errors.rotation_deg) if turns else None
    translation = statistics(errors.translation_m)
    return {
        "pairs": len(errors.translation_m),
        "translation_m": translation,
        "rotation_deg": rotation,
    }
