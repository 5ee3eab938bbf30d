"""Finding the trajectory of a camera, and printing, writing and drawing it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from ros_visualise.commands.odometry import OdometryOptions
from ros_visualise.commands.odometry.inertial import InertialSteps
from ros_visualise.commands.odometry.inputs import CameraImage, CameraInput, Position, open_input
from ros_visualise.commands.odometry.places import PlaceRecorder
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.printing import counted, print_json, print_result, print_status
from ros_visualise.core.signals import STOPPED, StopRequest, noticed
from ros_visualise.data import Header, Imu
from ros_visualise.data import Path as PosePath
from ros_visualise.estimation.visual.background import MOVING_THINGS
from ros_visualise.estimation.visual.focal import find_focal_length, pinhole
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.estimation.visual.stretch import VisualPose
from ros_visualise.estimation.visual.turning import TURNING
from ros_visualise.geometry import rotations, se3
from ros_visualise.plotting.figure import FIGURE_FORMATS
from ros_visualise.plotting.trajectory_plot import PlottedTrajectory, planes_of, plot_trajectories
from ros_visualise.running.interruptible import interruptible
from ros_visualise.sinks.files import check_new
from ros_visualise.sinks.names import check_suffix
from ros_visualise.sinks.trajectory import FORMATS, save
from ros_visualise.vision.threads import fit_threads

_SUFFIXES = {".tum": "tum", ".kitti": "kitti"}
_FRAME = "camera_start"
_TRIED = 60  # images by which a focal length is estimated
_LONGEST_MS = 200  # of a readout
_UNSCALED, _UNTRACKED = "scale unknown", "not tracked"
_WITHOUT_UNIT = "scale unknown: lengths are in arbitrary units; give --height, --scale or --imu"
_UNCHECKED = (
    "not checked: if it is 1% wrong, rotations (and lengths by --height or stereo) are about 1%"
    " wrong"
)
_PIECES = (
    "tracking was lost: what happened meanwhile is unknown, so the parts of the trajectory may be"
    " misplaced relative to each other"
)


def find_trajectory(options: OdometryOptions) -> int:
    """Find, print, write and draw a trajectory; the exit status."""
    _check(options)
    found = interruptible(lambda: open_input(options))
    settings, notes = _settings(options), []
    if options.imu and not found.infos:
        raise UsageError(f"{options.input}: --imu needs a calibrated camera; give --calibration")
    if not found.infos:
        notes.append(_estimate_focal_length(found, options))
        settings = replace(settings, is_guessed=True)
    odometry = _odometry(found, options, settings)
    places = PlaceRecorder()
    with noticed() as request:
        stamps_ns, reasons = _follow(odometry, found, options, places, request)
    whole = odometry.finish()
    poses = [one for one in whole if one.in_metres or not _has_unit(options, found)]
    if not poses:
        why = _main_reason(odometry, reasons)
        raise OpenError(f"{options.input}: no trajectory in {len(stamps_ns)} images: {why}")
    poses, again = places.correct(poses, stamps_ns[0])
    save(_files(poses, stamps_ns, options), options.overwrite)
    reasons |= {one.stamp_ns: _UNSCALED for one in whole}
    report = {**_report(poses, stamps_ns, reasons, odometry), "places": again.as_dict()}
    if not options.imu:
        report["focal_length_px"] = float(found.infos[0].K[0, 0])
        report["focal_length_is_given"] = not settings.is_guessed
    notes += [_PIECES] * bool(odometry.counts["losses"])
    if isinstance(odometry, InertialSteps) and odometry.lens_fault:
        notes.append(odometry.lens_fault)
    notes += [*found.notes, *([] if poses[0].in_metres else [_WITHOUT_UNIT])]
    if options.json:
        print_json({"path": options.input, **report, "notes": notes})
    else:
        print_result([*_lines(report), *again.lines(_unit(report["in_metres"]))])
    for note in notes:
        print_status(f"ros-visualise: {options.input}: {note}")
    if request.asked:
        return STOPPED
    return int(bool(found.notes or odometry.counts["losses"]))


def _odometry(
    found: CameraInput, options: OdometryOptions, settings: VisualSettings
) -> VisualOdometry | InertialSteps:
    if options.imu:
        readout_s = None if options.readout is None else settings.readout_s
        return InertialSteps(found, options.corners, readout_s)
    return VisualOdometry(found.infos, found.cameras, settings)


def _follow(
    odometry: VisualOdometry | InertialSteps,
    found: CameraInput,
    options: OdometryOptions,
    places: PlaceRecorder,
    request: StopRequest,
) -> tuple[list[int], dict[int, str]]:
    """Process the input, up to a stop request; stamps of images, and why some had no pose yet."""
    stamps_ns: list[int] = []
    reasons: dict[int, str] = {}
    for one in tqdm(_part(found, options), unit=" images", disable=None, leave=False):
        if request.asked:
            break
        if isinstance(one, CameraImage):
            fit_threads(one.gray)
            stamps_ns.append(one.stamp_ns)
        _take(odometry, one)
        if not isinstance(one, CameraImage):
            continue
        if isinstance(odometry, VisualOdometry) and not options.keep_drift:
            places.look(odometry)
        if odometry.reason:
            reasons[one.stamp_ns] = odometry.reason
    return stamps_ns, reasons


def _main_reason(odometry: VisualOdometry | InertialSteps, reasons: dict[int, str]) -> str:
    """Why no image has a pose."""
    if odometry.done:
        return (
            "the scale could not be found; without --height or --scale, lengths are in arbitrary"
            " units"
        )
    counts = Counter(reasons.values())
    why = max(counts, key=lambda reason: counts[reason], default="too few images")
    why = MOVING_THINGS if MOVING_THINGS in counts else why
    if why == TURNING and isinstance(odometry, VisualOdometry) and odometry.settings.is_guessed:
        return f"{why}, or to move over flat ground; give --calibration to distinguish the two"
    return why


def _take(odometry: VisualOdometry | InertialSteps, one: CameraImage | Position | Imu) -> None:
    """Process an image or a measurement."""
    if isinstance(odometry, InertialSteps):
        if isinstance(one, Imu):
            odometry.feel(one)
        elif isinstance(one, CameraImage):
            odometry.step(one)
    elif isinstance(one, Position):
        odometry.measured(*one)
    elif isinstance(one, CameraImage):
        odometry.step(one.stamp_ns, one.gray, one.right)


def _check(options: OdometryOptions) -> None:
    """Reject wrong usage before anything is read."""
    outs = [Path(name) for name in options.out]
    for one in outs:
        check_suffix("--out", one, _SUFFIXES)
    check_suffix("--plot", options.plot, FIGURE_FORMATS)
    if options.imu and (options.height or options.scale):
        raise UsageError("--imu gives the scale: omit --height and --scale")
    if options.readout is not None and options.readout > _LONGEST_MS:
        raise UsageError(f"--readout {options.readout:g}: give milliseconds, at most {_LONGEST_MS}")
    if options.corners < 50:
        raise UsageError(f"--corners {options.corners}: give at least 50")
    check_new([*outs, options.covariances, options.plot], options.overwrite, options.input)


def _settings(options: OdometryOptions) -> VisualSettings:
    return VisualSettings(
        corners=options.corners,
        height=options.height or 0.0,
        readout_s=(options.readout or 0.0) / 1e3,
        has_positions=options.scale is not None,
    )


def _has_unit(options: OdometryOptions, found: CameraInput) -> bool:
    """True if lengths are to be metres."""
    return bool(options.height or options.scale or options.imu) or len(found.infos) > 1


def _estimate_focal_length(found: CameraInput, options: OdometryOptions) -> str:
    """Give a camera without a calibration one; a note on it."""
    views = [one for one in _part(found, options) if isinstance(one, CameraImage)]
    every = max(len(views) // _TRIED, 1)
    focal = find_focal_length([one.gray for one in views[: _TRIED * every : every]])
    found.infos = [pinhole(views[0].gray.shape, focal.widths)]
    pixels = focal.widths * views[0].gray.shape[1]
    how = (
        "estimated from the images as {:.0f} px; it can be wrong by half"
        if focal.is_estimated
        else "assumed to be {:.0f} px, because the images do not show it"
    )
    return f"no calibration: focal length {how.format(pixels)}; give --calibration"


def _part(found: CameraInput, options: OdometryOptions) -> Iterator[CameraImage | Position | Imu]:
    """The part of the input that is wanted."""
    first_ns, count = None, 0
    for one in found.read():
        stamp_ns = one.header.stamp_ns if isinstance(one, Imu) else one.stamp_ns
        first_ns = stamp_ns if first_ns is None else first_ns
        gone_s = (stamp_ns - first_ns) / 1e9
        if options.duration is not None and gone_s > (options.start or 0.0) + options.duration:
            return
        if gone_s < (options.start or 0.0):
            continue
        count += isinstance(one, CameraImage)
        if options.frames is not None and count > options.frames:
            return
        yield one


def _files(
    poses: list[VisualPose], stamps_ns: list[int], options: OdometryOptions
) -> dict[Path, bytes]:
    files = {}
    for target in map(Path, options.out):
        kind = _SUFFIXES[target.suffix.lower()]
        path = _path(poses if kind == "tum" else _for_each_image(poses, stamps_ns))
        head = f"# {_WITHOUT_UNIT}\n" if kind == "tum" and not poses[0].in_metres else ""
        files[target] = (head + "".join(FORMATS[kind](path))).encode()
    if options.covariances is not None:
        files[options.covariances] = "".join(map(_covariance_line, poses)).encode()
    if options.plot is not None:
        path = _path(poses)
        drawn = [PlottedTrajectory(Path(options.input).name, path)]
        title = f"{Path(options.input).name}: {_length(poses)}"
        figure = plot_trajectories(drawn, planes_of([path.positions_xyz], "auto"), title, True)
        files[options.plot] = FIGURE_FORMATS[options.plot.suffix.lower()](figure)
    return files


def _path(poses: list[VisualPose]) -> PosePath:
    T = se3.from_parts([one.R for one in poses], [one.p for one in poses])
    stamps_ns = np.array([one.stamp_ns for one in poses], np.int64)
    quats = rotations.from_matrix(T[:, :3, :3])
    return PosePath(stamps_ns, T[:, :3, 3], quats, Header(int(stamps_ns[-1]), _FRAME))


def _for_each_image(poses: list[VisualPose], stamps_ns: list[int]) -> list[VisualPose]:
    """The pose of each image, or the last one before it, for a format without times."""
    places = np.searchsorted([one.stamp_ns for one in poses], stamps_ns, side="right") - 1
    return [poses[max(place, 0)] for place in places]


def _covariance_line(pose: VisualPose) -> str:
    change = se3.about_itself(pose.p)
    values = (change @ pose.covariance @ change.T).ravel()
    return f"{pose.stamp_ns / 1e9:.9f} {' '.join(f'{value:.6e}' for value in values)}\n"


def _length(poses: list[VisualPose]) -> str:
    way = np.linalg.norm(np.diff([one.p for one in poses], axis=0), axis=1).sum()
    return f"{way:.3f} {'m' if poses[0].in_metres else 'units of length'}"


def _report(
    poses: list[VisualPose],
    stamps_ns: list[int],
    reasons: dict[int, str],
    odometry: VisualOdometry | InertialSteps,
) -> dict[str, Any]:
    last = poses[-1]
    change = se3.about_itself(last.p)
    deviations = np.sqrt(np.diag(change @ last.covariance @ change.T).clip(min=0))
    way = float(np.linalg.norm(np.diff([one.p for one in poses], axis=0), axis=1).sum())
    posed = {one.stamp_ns for one in poses}  # with those that got theirs afterwards
    missing = [reasons.get(one, _UNTRACKED) for one in stamps_ns if one not in posed]
    return {
        "images": len(stamps_ns),
        "poses": len(poses),
        "keyframes": odometry.counts["keyframes"],
        "losses": odometry.counts["losses"],
        "without_pose": dict(Counter(missing)),
        "in_metres": last.in_metres,
        "length": way,
        "end_sigma": float(np.linalg.norm(deviations[:3])),
        "end_sigma_deg": float(np.rad2deg(np.linalg.norm(deviations[3:]))),
    }


def _lines(report: dict[str, Any]) -> list[str]:
    unit = _unit(report["in_metres"])
    sigma, sigma_deg = report["end_sigma"], report["end_sigma_deg"]
    lines = [
        f"images:    {report['images']}, {report['poses']} with a pose,"
        f" {counted(report['keyframes'], 'keyframe')}",
        f"length:    {report['length']:.3f}{unit}",
        f"end:       +-{sigma:.3f}{unit}, +-{sigma_deg:.2f} degrees",
    ]
    if report.get("focal_length_is_given"):
        lines.append(f"focal:     {report['focal_length_px']:.0f} px, {_UNCHECKED}")
    lines += [
        f"no pose:   {counted(count, 'image')} ({why})"
        for why, count in report["without_pose"].items()
    ]
    if report["losses"]:
        lines.append(f"lost:      {counted(report['losses'], 'time')}")
    return lines


def _unit(in_metres: bool) -> str:
    return " m" if in_metres else " units"
