"""Distances of surveyed tags: `python benchmarks/landmarks/tagslam.py FOLDER`.

The folder, TagSLAM's example_10, holds tag_detections.bag, cameras.yaml and tagslam.yaml. Of all
pairs of tags that were surveyed and are seen in one image, the distance of the two is compared with
that of the survey, in cm: over all sightings of pairs, and over the pairs themselves, each once.

- *one view, OpenCV*: cv2.solvePnPGeneric with IPPE_SQUARE, its first solution
- *one view*: `square_poses`, the likelier solution
- *all views of a pair*: one tag in the frame of the other, by the tracks of the localizer, in which
  the pose of the other tag is the robot's error, new in each view
- *all views at once*: as `ros-visualise landmarks --map` smooths them. First survey and corners
  count as TagSLAM is configured for this recording, with deviations of 0.5 m, 0.1 rad and 1 px;
  then corners as much as they are found to deviate; then the survey with 3 cm and 0.02 rad
- *TagSLAM*: its own result of this recording, with `--reference`: the bag of tagslam_test's test_10

Then of the positions of surveyed tags, how far they are from the survey.

`--too-large` takes so many pixels off each side of the tags: the detector of this recording sees
them larger than they are, which example_13 tells, whose pitch is known.
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags.highlevel import AnyReader

from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.data import CameraInfo, Detections, Floats, Hypothesis
from ros_visualise.estimation.localization.seen import sighting_of
from ros_visualise.estimation.localization.track import LandmarkTrack, begin
from ros_visualise.estimation.mapping.intrinsics import assumed
from ros_visualise.estimation.mapping.outward import outward_steps
from ros_visualise.estimation.mapping.problem import Problem, RigCamera, TagPrior, TagSighting
from ros_visualise.estimation.mapping.smoothing import smooth
from ros_visualise.estimation.mapping.unknowns import LARGER, PRINTED, MeasurementNoise, SharedPrior
from ros_visualise.geometry.se3 import cross, from_pose, inverse
from ros_visualise.landmarks.pose import PoseEstimate, squares_poses

WEIGHTS = (0.5, 0.1, 1.0), (0.5, 0.1, None), (0.03, 0.02, None)
"""Deviations of the survey, in metres and radians, and of corners; the first are TagSLAM's."""
SURVEYED_M = 1e-3  # what is given with a larger standard deviation is a guess
Pair = tuple[int, int]
View = dict[int, tuple[PoseEstimate, ...]]


class Recorded:
    """The recording: of each image the tags' corners (4, 2), and what was surveyed."""

    def __init__(self, folder: Path, too_large_px: float) -> None:
        tags = load_yaml(folder / "tagslam.yaml")
        (body,) = (body["top_floor"] for body in tags["bodies"] if "top_floor" in body)
        self.sizes = defaultdict(lambda: body["default_tag_size"])
        self.survey: dict[int, Floats] = {}
        self.poses: dict[int, tuple[Floats, Floats]] = {}
        for tag in body["tags"]:
            place = tag["pose"]
            self.sizes[tag["id"]] = tag["size"]
            turn = cv2.Rodrigues(np.array([place["rotation"][axis] for axis in "xyz"]))[0]
            self.poses[tag["id"]] = np.array([place["position"][axis] for axis in "xyz"]), turn
            if max(place["position_noise"].values()) <= SURVEYED_M:
                self.survey[tag["id"]] = np.array([place["position"][axis] for axis in "xyz"])
        self._left_out = set(body["ignore_tags"])
        self._renamed = [
            (one["id"], again) for one in tags["tag_id_remap"] for again in one["remaps"]
        ]
        self.info = _calibration(load_yaml(folder / "cameras.yaml")["cam0"])
        self._too_large_px = too_large_px
        self.is_shrunk = too_large_px > 0
        self.images = [image for image in self._read(folder / "tag_detections.bag") if image]

    def _read(self, bag: Path) -> Iterator[dict[int, Floats]]:
        with AnyReader([bag]) as reader:
            for connection, _, data in reader.messages():
                found = Detections.read(reader.deserialize(data, connection.msgtype))
                stamp_s = found.header.stamp_ns / 1e9
                tags = {self._name(int(one.id), stamp_s): one for one in found.detections}
                yield {
                    number: one.corners_uv - self._too_large_px * outward_steps(one.corners_uv)
                    for number, one in tags.items()
                    if number not in self._left_out
                }

    def _name(self, number: int, stamp_s: float) -> int:
        """Some were moved while it was recorded, and are others then."""
        for before, again in self._renamed:
            if number == before and again["start_time"] <= stamp_s <= again["end_time"]:
                return int(again["remap_id"])
        return number


def _calibration(camera: Mapping[str, Any]) -> CameraInfo:
    fx, fy, cx, cy = camera["intrinsics"]
    width, height = camera["resolution"]
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    return CameraInfo(height, width, K=K, D=np.array(camera["distortion_coeffs"]))


def located(recorded: Recorded) -> list[View]:
    """Of each image the poses of its tags."""
    views = []
    for image in recorded.images:
        sizes = [recorded.sizes[number] for number in image]
        poses = squares_poses(np.array(list(image.values())), sizes, recorded.info)
        views.append({n: one for n, one in zip(image, poses, strict=True) if one})
    return views


def by_opencv(recorded: Recorded) -> list[dict[int, Floats]]:
    """Of each image the positions of its tags."""
    square = np.array([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]]) / 2
    K, D = recorded.info.K, recorded.info.D

    def position(number: int, corners: Floats) -> Floats:
        from_upper_left = np.ascontiguousarray(corners[[3, 2, 1, 0]])
        points = square * recorded.sizes[number]
        found = cv2.solvePnPGeneric(points, from_upper_left, K, D, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        return np.asarray(found[2][0])[:, 0]

    return [{n: position(n, c) for n, c in image.items()} for image in recorded.images]


def single(positions: list[dict[int, Floats]]) -> dict[Pair, list[float]]:
    """The distance of each pair in each image."""
    found: dict[Pair, list[float]] = defaultdict(list)
    for places in positions:
        for a, b in combinations(sorted(places), 2):
            found[a, b].append(float(np.linalg.norm(places[a] - places[b])))
    return found


def combined(views: list[View]) -> dict[Pair, list[float]]:
    """The distance of each pair from all images, for each image in which it is."""
    tracks: dict[Pair, LandmarkTrack] = {}
    for number, view in enumerate(views):
        for a, b in combinations(sorted(view), 2):
            T_a_camera, covariance = _from_tag(view[a][0])
            sightings = [sighting_of(_hypothesis(one), T_a_camera) for one in view[b]]
            if (a, b) not in tracks:
                tracks[a, b] = LandmarkTrack(
                    "tag", b, True, begin(sightings, covariance, None), number
                )
                continue
            track = tracks[a, b]
            track.carry(np.zeros((6, 6)), covariance)
            fits = track.fits(sightings)
            if any(one.fit.is_inlier for one in fits):
                track.take(fits, number)
    return {
        pair: [float(np.linalg.norm(track.best.position_xyz))] * track.seen
        for pair, track in tracks.items()
    }


def _hypothesis(pose: PoseEstimate) -> Hypothesis:
    return Hypothesis("tag", pose.probability, pose.position_xyz, pose.quat_xyzw, pose.covariance)


def _from_tag(pose: PoseEstimate) -> tuple[Floats, Floats]:
    """T_tag_camera, and the covariance (6, 6) of its error in the tag's axes."""
    T = inverse(from_pose(pose.position_xyz, pose.quat_xyzw))
    R = T[:3, :3]
    J = np.block([[R, R @ cross(pose.position_xyz)], [np.zeros((3, 3)), R]])
    return T, J @ pose.covariance @ J.T


def joint_sightings(
    recorded: Recorded, views: list[View]
) -> tuple[list[tuple[int, View]], list[int], list[TagSighting]]:
    """Views of several tags with their numbers, the ids of these tags, and all their sightings."""
    several = [(k, view) for k, view in enumerate(views) if len(view) > 1]
    names = sorted({n for _, view in several for n in view})
    sightings = [
        TagSighting(
            number,
            names.index(n),
            recorded.images[k][n],
            recorded.sizes[n],
            recorded.info,
            [_hypothesis(pose) for pose in poses],
        )
        for number, (k, view) in enumerate(several)
        for n, poses in view.items()
    ]
    return several, names, sightings


def smoothed(
    recorded: Recorded,
    views: list[View],
    position_m: float,
    turn_rad: float,
    corners_px: float | None = None,
) -> dict[int, Floats]:
    """Positions (3,) of tags, by all views at once and the survey with these deviations.

    That of corners is estimated unless it is given.
    """
    several, names, sightings = joint_sightings(recorded, views)
    known = [
        TagPrior(names.index(n), place, np.full(3, position_m), turn, np.full(3, turn_rad))
        for n, (place, turn) in recorded.poses.items()
        if n in names
    ]
    stamps_ns = np.arange(len(several), dtype=np.int64)
    larger_px = 0.0 if recorded.is_shrunk else SharedPrior.larger_px
    prior = SharedPrior(larger_px=larger_px, printed=0.01)
    noise = None if corners_px is None else MeasurementNoise(extra_px=(corners_px,))
    cameras = [RigCamera(calibration=assumed(recorded.info))]
    problem = Problem(stamps_ns, names, sightings, surveyed=known, cameras=cameras)
    found = smooth(problem, noise, prior)
    assert found is not None
    larger, printed = found.shared[LARGER], 100 * found.shared[PRINTED]
    refused = int((~found.inliers).sum())
    print(
        f"survey +- {position_m} m: {len(sightings)} sightings, {refused} refused, corners off by"
        f" {found.noise.extra_px[0]:.2f} px, tags too large by {larger:.2f} px and {printed:.2f} %"
    )
    return dict(zip(found.problem.names, found.tags.t, strict=True))


def by_tagslam(bag: Path) -> dict[int, Floats]:
    """Positions (3,) of tags, as TagSLAM published them last."""
    places = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            for one in getattr(message, "transforms", ()):
                if one.child_frame_id.startswith("tag_"):
                    at = one.transform.translation
                    places[int(one.child_frame_id[4:])] = np.array([at.x, at.y, at.z])
    return places


def pairs_of(
    places: Mapping[int, Floats], seen: Mapping[Pair, list[float]]
) -> dict[Pair, list[float]]:
    """The distance of each pair, as often as it was seen."""
    return {
        (a, b): [float(np.linalg.norm(places[a] - places[b]))] * len(several)
        for (a, b), several in seen.items()
        if a in places and b in places
    }


def from_survey(title: str, places: Mapping[int, Floats], survey: Mapping[int, Floats]) -> str:
    """Median and 90th percentile of how far tags are from where they were surveyed, in cm."""
    off = [np.linalg.norm(places[n] - survey[n]) for n in survey if n in places]
    median, most = 100 * np.percentile(off, (50, 90))
    return f"| {title} | {len(off)} | {median:.1f} | {most:.1f} |"


def row(title: str, found: Mapping[Pair, list[float]], survey: Mapping[int, Floats]) -> str:
    """Median and 90th percentile of the errors in cm, over sightings and over pairs."""
    errors = {
        (a, b): np.abs(np.array(distances) - np.linalg.norm(survey[a] - survey[b]))
        for (a, b), distances in found.items()
        if a in survey and b in survey
    }
    each = np.concatenate(list(errors.values()))
    once = np.array([np.median(several) for several in errors.values()])
    cells = [f"{cm:.1f}" for one in (each, once) for cm in 100 * np.percentile(one, (50, 90))]
    return f"| {title} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--too-large", type=float, default=0.0, metavar="PX")
    parser.add_argument("--reference", type=Path, metavar="BAG")
    args = parser.parse_args()
    recorded = Recorded(args.folder, args.too_large)
    views = located(recorded)
    first = [{n: poses[0].position_xyz for n, poses in view.items()} for view in views]
    seen = single(first)
    pairs = [pair for pair in seen if set(pair) <= recorded.survey.keys()]
    sightings = sum(len(seen[pair]) for pair in pairs)
    print(f"{len(recorded.images)} images, {sightings} sightings of {len(pairs)} surveyed pairs")
    off = [np.abs(np.array(seen[pair]) - np.median(seen[pair])) for pair in pairs]
    print(f"one view and the median of its pair: {100 * np.median(np.concatenate(off)):.1f} cm\n")
    print(
        "| cm | sightings: median | 90 of 100 | pairs: median | 90 of 100 |\n|---|---|---|---|---|"
    )
    print(row("one view, OpenCV", single(by_opencv(recorded)), recorded.survey))
    print(row("one view", seen, recorded.survey))
    print(row("all views of a pair", combined(views), recorded.survey))
    maps = {} if args.reference is None else {"TagSLAM": by_tagslam(args.reference)}
    for position_m, turn_rad, corners_px in WEIGHTS:
        title = f"all views at once, survey +- {position_m} m"
        title += "" if corners_px is None else f", corners +- {corners_px} px"
        maps[title] = smoothed(recorded, views, position_m, turn_rad, corners_px)
    for title, places in maps.items():
        print(row(title, pairs_of(places, seen), recorded.survey))
    print("\n| positions, cm from the survey | tags | median | 90 of 100 |\n|---|---|---|---|")
    for title, places in maps.items():
        print(from_survey(title, places, recorded.survey))


if __name__ == "__main__":
    main()
