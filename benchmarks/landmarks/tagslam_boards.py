"""The pitch of TagSLAM's boards of 2x3 tags, which they have by their making: 0.150 m."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np

from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.data import CameraInfo, Hypothesis
from ros_visualise.estimation.mapping.intrinsics import assumed
from ros_visualise.estimation.mapping.problem import Problem, RigCamera, TagSighting
from ros_visualise.estimation.mapping.smoothing import SmoothedMap, smooth
from ros_visualise.estimation.mapping.unknowns import LARGER, SharedPrior
from ros_visualise.landmarks.pose import squares_poses
from ros_visualise.sources import open_source

SIZE_M, PITCH_M, COLUMNS, TAGS = 0.12, 0.15, 3, 6
THINNED = 4  # of the frames, which follow one another closely, so many make one view
SQUARE = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * SIZE_M / 2
Spot = tuple[np.ndarray, np.ndarray]
"""A tag's position and its covariance (3, 3)."""
Corners = dict[int, np.ndarray]


def pitch_table(folder: Path) -> None:
    """Distances of neighbours: the mean of each pair over all views, single views, and a map's."""
    info = _calibration(folder / "cameras.yaml")
    frames = list(_frames(folder / "tag_detections.bag"))
    print("| poses | views of pairs | a pair's mean off, median mm | one view off, median mm |")
    ways = {
        "ours": _ours,
        "OpenCV IPPE": _opencv(cv2.SOLVEPNP_IPPE),
        "OpenCV ITERATIVE": _opencv(cv2.SOLVEPNP_ITERATIVE),
    }
    for name, locate in ways.items():
        measured = defaultdict(list)
        for tags in frames:
            for pair, length, weight in _lengths(locate(tags, info)):
                measured[pair].append((length, weight))
        pairs = [np.array(several).T for several in measured.values()]
        means = np.array([np.average(lengths, weights=weights) for lengths, weights in pairs])
        single = np.concatenate([lengths for lengths, _ in pairs])
        off, one_off = (np.median(np.abs(v - PITCH_M)) * 1e3 for v in (means, single))
        print(f"| {name} | {len(single)} | {off:.2f} | {one_off:.2f} |")
    exact, inexact = RigCamera(), RigCamera(calibration=assumed(info))
    for larger_px, camera, title in (
        (0.0, exact, ""),
        (SharedPrior.larger_px, exact, ", how much too large estimated"),
        (SharedPrior.larger_px, inexact, ", and the calibration"),
    ):
        found = _smoothed(frames[::THINNED], info, SharedPrior(larger_px=larger_px), camera)
        spots = {
            id: (t, np.eye(3)) for id, t in zip(found.problem.names, found.tags.t, strict=True)
        }
        lengths = np.array([length for _, length, _ in _lengths(spots)])
        off, larger = np.median(np.abs(lengths - PITCH_M)) * 1e3, found.shared[LARGER]
        print(f"| all views at once{title} ({larger:.2f} px) | {len(lengths)} | {off:.2f} | - |")


def _smoothed(
    frames: Sequence[Corners], info: CameraInfo, prior: SharedPrior, camera: RigCamera
) -> SmoothedMap:
    """The map of all tags by all views at once."""
    names = sorted({id for tags in frames for id in tags})
    sightings = []
    for view, tags in enumerate(frames):
        corners = np.array(list(tags.values())).reshape(-1, 4, 2)
        for id, poses in zip(tags, squares_poses(corners, [SIZE_M] * len(tags), info), strict=True):
            told = [
                Hypothesis("", p.probability, p.position_xyz, p.quat_xyzw, p.covariance)
                for p in poses
            ]
            if told and len(tags) > 1:
                sightings.append(TagSighting(view, names.index(id), tags[id], SIZE_M, info, told))
    stamps_ns = np.arange(len(frames), dtype=np.int64)
    found = smooth(Problem(stamps_ns, names, sightings, cameras=[camera]), prior=prior)
    assert found is not None
    return found


def _calibration(path: Path) -> CameraInfo:
    camera = load_yaml(path)["cam0"]
    fx, fy, cx, cy = camera["intrinsics"]
    width, height = camera["resolution"]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return CameraInfo(height, width, K, np.array([*camera["distortion_coeffs"], 0.0]))


def _frames(path: Path) -> Iterator[Corners]:
    with closing(open_source(path)) as recording:
        for entry in recording.read():
            yield {int(one.id): one.corners_uv for one in entry.message.content.detections}


def _ours(tags: Corners, info: CameraInfo) -> dict[int, Spot]:
    corners = np.array(list(tags.values())).reshape(-1, 4, 2)
    found = squares_poses(corners, [SIZE_M] * len(tags), info)
    return {
        id: (several[0].position_xyz, several[0].covariance[:3, :3])
        for id, several in zip(tags, found, strict=True)
        if several
    }


def _opencv(method: int) -> Callable[[Corners, CameraInfo], dict[int, Spot]]:
    """Which knows of no covariance, so that all views count alike."""

    def locate(tags: Corners, info: CameraInfo) -> dict[int, Spot]:
        found = {}
        for id, corners in tags.items():
            done, _, t = cv2.solvePnP(SQUARE, corners, info.K, info.D, flags=method)
            if done:
                found[id] = t.ravel(), np.eye(3)
        return found

    return locate


def _lengths(spots: dict[int, Spot]) -> Iterator[tuple[Sequence[int], float, float]]:
    """Of each pair of neighbours on a board their distance, and the inverse of its variance."""
    for id, (spot, spread) in spots.items():
        steps = (1, COLUMNS) if id % COLUMNS < COLUMNS - 1 else (COLUMNS,)
        for other in (id + step for step in steps):
            if other in spots and other // TAGS == id // TAGS:
                way = spots[other][0] - spot
                length = float(np.linalg.norm(way))
                along = way / length
                yield (id, other), length, 1 / float(along @ (spread + spots[other][1]) @ along)
