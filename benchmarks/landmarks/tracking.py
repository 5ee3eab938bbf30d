"""Ids over time: HOTA, MOTA and IDF1 of `tracker` on traffic seen by a drone, by TrackEval.

    pip install --no-deps trackeval tabulate [trackers supervision pydeprecate defusedxml]
    python benchmarks/landmarks/tracking.py [--seeds 3] [--seconds 40] [--film OUT.mp4]

The traffic is simulated: cars and lorries follow one another in lanes and stop at lights, people
walk in pairs and cross each other. A camera 45 m above looks down at 50 degrees while it turns,
drifts and shakes. What a detector finds is made from the true boxes: it misses objects for several
images, more so if they are partly covered; it finds things that are not there, some of them again
and again; boxes jitter, and those that overlap become one. Two bridges hide whoever passes below
for about two seconds.

The pose that `odometry` is given has errors of its own. The other tracker, if it is installed, is
ByteTrack of the package `trackers`, which knows neither stamps nor the camera's motion.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import math
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from ros_visualise.data import (
    CameraInfo,
    Detection,
    Detections,
    Header,
    Hypothesis,
    Image,
    TransformStamped,
)
from ros_visualise.geometry import rotations
from ros_visualise.geometry.frames import FrameTree
from ros_visualise.nodes.tracker import CameraMotion, Tracker, TrackerParams
from ros_visualise.sinks.mot_file import MotRecorder

WIDTH, HEIGHT, FOCAL = 1280, 720, 900.0
K = np.array([[FOCAL, 0, WIDTH / 2 - 0.5], [0, FOCAL, HEIGHT / 2 - 0.5], [0, 0, 1.0]])
HALF = 90.0  # metres, of the roads' length
BRIDGES = ((-54.0, 9.0), (52.0, 9.0))  # middle along x and half width
LANES = (-5.2, -1.75, 1.75, 5.2)


@dataclass
class Body:
    """A road user: along its lane, with length, width and height."""

    id: int
    size: tuple[float, float, float]
    lane: float
    heading: float
    along: float
    speed: float
    wish: float
    across: bool = False  # a road along y
    walks: bool = False
    missed: bool = False
    viewed_s: float = -10.0

    @property
    def center(self) -> np.ndarray:
        at = math.copysign(1, math.cos(self.heading)) * self.along
        return np.array([self.lane, at, 0.0] if self.across else [at, self.lane, 0.0])

    def corners(self) -> np.ndarray:
        length, width, height = self.size
        x, y = (width, length) if self.across else (length, width)
        box = np.array([[a, b, c] for a in (-1, 1) for b in (-1, 1) for c in (0, 2)], float)
        return self.center + box * [x / 2, y / 2, height / 2]


class Traffic:
    """Cars by the intelligent driver model, and people."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng, self._next = rng, 0
        self.bodies: list[Body] = []
        for across in (False, True):
            for lane in LANES:
                for along in np.arange(-HALF, HALF, rng.uniform(22, 32)):
                    self._add_car(lane, across, float(along))
        for _ in range(8):
            self._add_pair(float(rng.uniform(-HALF, HALF)))

    def step(self, now_s: float, dt_s: float) -> None:
        lanes: dict[tuple[bool, float], list[Body]] = {}
        for one in self.bodies:
            if not one.walks:
                lanes.setdefault((one.across, one.lane), []).append(one)
        for (across, _), several in lanes.items():
            several.sort(key=lambda one: -one.along)
            stop = now_s % 16 > 8 if across else now_s % 16 < 7
            ahead = None
            for one in several:
                gap = 1e3 if ahead is None else ahead.along - ahead.size[0] / 2 - one.along
                gap, lead = gap - one.size[0] / 2, ahead.speed if ahead else one.speed
                light = -9.5 - one.along - one.size[0] / 2
                if stop and 0 < light < gap:
                    gap, lead = light, 0.0
                wanted = 2 + max(0, one.speed * 1.2 + one.speed * (one.speed - lead) / 4.5)
                pull = 1.8 * (1 - (one.speed / one.wish) ** 4 - (wanted / max(gap, 0.3)) ** 2)
                one.speed = max(0.0, one.speed + max(pull, -7) * dt_s)
                ahead = one
        for one in self.bodies:
            one.along += one.speed * dt_s
        gone = [one for one in self.bodies if one.along > HALF]
        self.bodies = [one for one in self.bodies if one.along <= HALF]
        for one in gone:
            if one.walks:
                self._add_walker(one.lane, -HALF, one.wish, one.heading)
            else:
                self._add_car(one.lane, one.across, -HALF - self._rng.uniform(0, 15))

    def _add_car(self, lane: float, across: bool, along: float) -> None:
        r = self._rng
        lorry = r.random() < 0.12
        size = (8.5, 2.5, 3.2) if lorry else (r.uniform(3.9, 4.9), r.uniform(1.7, 1.9), 1.5)
        heading = 0.0 if lane < 0 else math.pi
        wish = r.uniform(7, 10) if lorry else r.uniform(8, 13)
        self._put(Body(0, size, lane, heading, along, wish, wish, across))

    def _add_pair(self, along: float) -> None:
        side, speed = self._rng.choice((-9.5, 9.5)), self._rng.uniform(1.0, 1.6)
        self._add_walker(side, along, speed, 0.0)
        self._add_walker(side + 0.8, along + 0.3, speed * 1.02, 0.0)
        self._add_walker(side + 0.4, -along - 5, speed, math.pi)

    def _add_walker(self, lane: float, along: float, speed: float, heading: float) -> None:
        size = (0.6, 0.6, 1.75)
        self._put(Body(0, size, lane, heading, along, speed, speed, walks=True))

    def _put(self, one: Body) -> None:
        self.name(one)
        self.bodies.append(one)

    def name(self, one: Body) -> None:
        """Give it a new id."""
        self._next += 1
        one.id = self._next


@dataclass
class Flight:
    """Pose of the camera over time; ``still`` is one on a mast."""

    rng: np.random.Generator
    still: bool = False
    shake: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def pose(self, now_s: float, dt_s: float) -> np.ndarray:
        """T_odom_camera."""
        if self.still:
            return _look(-32.0, -38.0, 45.0, 0.85, -50.0, np.zeros(3))
        decay = math.exp(-dt_s / 0.15)
        noise = self.rng.normal(0, math.radians(0.35), 3) * math.sqrt(1 - decay**2)
        self.shake = decay * self.shake + noise
        yaw = 0.75 + 0.45 * math.sin(2 * math.pi * now_s / 17)
        x, y = -34 + 12 * math.sin(2 * math.pi * now_s / 31), -38 + 6 * math.sin(now_s / 6)
        return _look(x, y, 45 + 4 * math.sin(now_s / 5), yaw, -50.0, self.shake)


def _look(
    x: float, y: float, z: float, yaw: float, pitch_deg: float, shake: np.ndarray
) -> np.ndarray:
    pitch = math.radians(pitch_deg)
    ahead = np.array(
        [math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)]
    )
    right = np.array([math.sin(yaw), -math.cos(yaw), 0])
    T = np.eye(4)
    T[:3, :3] = np.stack((right, np.cross(ahead, right), ahead), axis=1)
    T[:3, :3] = T[:3, :3] @ cv2.Rodrigues(shake)[0]
    T[:3, 3] = x, y, z
    return T


class Seen(NamedTuple):
    """A true object in an image: its box left, top, right, bottom, and its uncovered share."""

    id: int
    body: Body
    box: np.ndarray
    shown: float


def look(traffic: Traffic, T: np.ndarray, now_s: float) -> list[Seen]:
    """The objects that an image shows; who was out of view for a second has a new id."""
    found: list[tuple[float, Body, np.ndarray]] = []
    for one in traffic.bodies:
        local = (one.corners() - T[:3, 3]) @ T[:3, :3]
        if local[:, 2].min() < 1:
            continue
        pixels = local @ K.T
        pixels = pixels[:, :2] / pixels[:, 2:]
        whole = np.r_[pixels.min(0), pixels.max(0)]
        box = np.clip(whole, 0, [WIDTH - 1, HEIGHT - 1, WIDTH - 1, HEIGHT - 1])
        if _area(box) > 0.4 * _area(whole) and _area(box) > 40:
            found.append((float(local[:, 2].mean()), one, box))
            if now_s - one.viewed_s > 1:
                traffic.name(one)
            one.viewed_s = now_s
    found.sort(key=lambda one: one[0])
    seen = []
    for at, (_, body, box) in enumerate(found):
        covered = sum(_common(box, other) for _, _, other in found[:at]) / _area(box)
        below = any(
            abs(body.center[0] - middle) < half for middle, half in BRIDGES if not body.across
        )
        shown = 0.0 if below else max(0.0, 1 - covered)
        if shown > 0.25:
            seen.append(Seen(body.id, body, box, shown))
    return seen


class Detector:
    """What a network would make of it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._ghosts = rng.uniform([0, 0], [WIDTH, HEIGHT], (3, 2))

    def find(self, seen: list[Seen]) -> list[tuple[np.ndarray, float]]:
        r, found = self._rng, []
        for one in seen:
            # misses follow one another
            chance = (0.55 if one.body.missed else 0.07) + 0.35 * (1 - one.shown)
            one.body.missed = bool(r.random() < chance)
            if one.body.missed and r.random() < 0.7:
                continue
            score = r.normal(0.3 if one.body.missed else 0.78, 0.1) * one.shown**0.8
            w, h = one.box[2:] - one.box[:2]
            jitter = r.normal(0, 0.03, 4) * [w, h, w, h] + r.normal(0, 0.5, 4)
            found.append((one.box + jitter, float(np.clip(score, 0.02, 0.99))))
        found = self._merged(found)
        for place in (*r.uniform([0, 0], [WIDTH, HEIGHT], (r.poisson(0.5), 2)), *self._ghosts):
            if r.random() < 0.25:
                size = r.uniform(15, 60, 2)
                score = float(np.clip(r.normal(0.35, 0.15), 0.02, 0.9))
                found.append((np.r_[place - size / 2, place + size / 2], score))
        return [one for one in found if one[1] > 0.05]

    def _merged(self, found: list[tuple[np.ndarray, float]]) -> list[tuple[np.ndarray, float]]:
        kept: list[tuple[np.ndarray, float]] = []
        for box, score in found:
            for at, (other, its) in enumerate(kept):
                common = _common(box, other)
                share = common / (_area(box) + _area(other) - common)
                if share > 0.45 and self._rng.random() < 0.6:
                    both = np.r_[np.minimum(box[:2], other[:2]), np.maximum(box[2:], other[2:])]
                    kept[at] = both, max(score, its)
                    break
            else:
                kept.append((box, score))
        return kept


def _area(box: np.ndarray) -> float:
    return float(np.prod(np.clip(box[2:] - box[:2], 0, None)))


def _common(a: np.ndarray, b: np.ndarray) -> float:
    return _area(np.r_[np.maximum(a[:2], b[:2]), np.minimum(a[2:], b[2:])])


class Frame(NamedTuple):
    """An image, what is in it, what is found, and the true and the told pose of its camera."""

    stamp_ns: int
    seen: list[Seen]
    found: list[tuple[np.ndarray, float]]
    pose: np.ndarray
    told: np.ndarray
    gray: np.ndarray


def drive(seed: int, seconds: float, rate: float, still: bool, drawn: bool) -> Iterator[Frame]:
    """The frames of one scene, at a rate with a jitter of a fifth of the period."""
    rng = np.random.default_rng(seed)
    traffic, flight, detector = Traffic(rng), Flight(rng, still), Detector(rng)
    ground = _ground(np.random.default_rng(1)) if drawn else None
    bias, now = np.zeros(3), 0.0
    for _ in range(60):
        traffic.step(0.0, 0.1)
    while now < seconds:
        dt = rng.uniform(0.8, 1.2) / rate
        now += dt
        traffic.step(now, dt)
        T = flight.pose(now, dt)
        bias = 0.99 * bias + rng.normal(0, math.radians(0.04), 3)
        told = T.copy()
        told[:3, :3] = T[:3, :3] @ cv2.Rodrigues(bias)[0]
        told[:3, 3] += rng.normal(0, 0.05, 3)
        seen = look(traffic, T, now)
        gray = np.zeros((0, 0), np.uint8) if ground is None else _draw(ground, T, traffic.bodies)
        yield Frame(round(now * 1e9), seen, detector.find(seen), T, told, gray)


_PIXEL_M = 0.1


def _ground(rng: np.random.Generator) -> np.ndarray:
    side = round(260 / _PIXEL_M)
    picture = np.full((side, side), 110, np.float32)
    for size in (4, 16, 64, 256):
        noise = rng.normal(0, 12, (side // size + 1,) * 2).astype(np.float32)
        picture += cv2.resize(noise, (side, side), interpolation=cv2.INTER_CUBIC)
    middle, half = side // 2, round(8 / _PIXEL_M)
    for road in (np.s_[middle - half : middle + half, :], np.s_[:, middle - half : middle + half]):
        picture[road] = 70 + 0.3 * (picture[road] - 110)
    for lane in (-3.5, 0.0, 3.5):
        at = middle + round(lane / _PIXEL_M)
        for start in range(0, side, 80):
            picture[at - 1 : at + 1, start : start + 30] = 220
            picture[start : start + 30, at - 1 : at + 1] = 220
    return picture.clip(0, 255).astype(np.uint8)


def _draw(ground: np.ndarray, T: np.ndarray, bodies: list[Body]) -> np.ndarray:
    middle = (ground.shape[0] - 1) / 2
    to_world = np.array([[_PIXEL_M, 0, -middle * _PIXEL_M], [0, _PIXEL_M, -middle * _PIXEL_M]])
    R, p = T[:3, :3].T, T[:3, 3]
    H = K @ np.c_[R[:, :2], -R @ p] @ np.vstack((to_world, [0, 0, 1]))
    image = cv2.warpPerspective(ground, H, (WIDTH, HEIGHT), borderValue=110)
    for one in sorted(bodies, key=lambda one: -np.linalg.norm(one.center - p)):
        local = (one.corners() - p) @ T[:3, :3]
        if local[:, 2].min() > 1:
            pixels = local @ K.T
            hull = cv2.convexHull((pixels[:, :2] / pixels[:, 2:]).astype(np.float32))
            cv2.fillConvexPoly(image, hull.astype(np.int32), 40 + one.id * 67 % 200)
    for at, side in BRIDGES:
        box = np.array(
            [[at + a, 9 * b, 7] for a, b in ((-side, -1), (side, -1), (side, 1), (-side, 1))]
        )
        local = (box - p) @ T[:3, :3]
        if local[:, 2].min() > 1:
            pixels = local @ K.T
            cv2.fillConvexPoly(image, (pixels[:, :2] / pixels[:, 2:]).astype(np.int32), 150)
    return image


_INFO = CameraInfo(HEIGHT, WIDTH, K)


def message(frame: Frame) -> Detections:
    found = tuple(
        Detection(
            (box[:2] + box[2:]) / 2,
            np.maximum(box[2:] - box[:2], 1),
            0.0,
            (Hypothesis("vehicle", score),),
        )
        for box, score in frame.found
    )
    return Detections(found, Header(frame.stamp_ns, "camera"), _INFO)


def track(frames: list[Frame], path: Path, motion: str, film: str = "") -> list[float]:
    """Write the tracks of `tracker`; the CPU time of each of its steps, milliseconds."""
    params = TrackerParams(camera_motion=CameraMotion(motion))
    tracker, took_ms = Tracker(params), []
    codec = cv2.VideoWriter_fourcc(*"mp4v")
    video = cv2.VideoWriter(film, codec, 25, (WIDTH, HEIGHT)) if film else None
    with MotRecorder(path, "/tracks", True, False) as recorder:
        for frame in frames:
            found, tree = message(frame), FrameTree()
            quat = rotations.from_matrix(frame.told[:3, :3])
            told = TransformStamped(
                "camera", frame.told[:3, 3], quat, Header(frame.stamp_ns, "odom")
            )
            tree.add(told)
            image = None
            if frame.gray.size:
                image = Image(frame.gray, "mono8", found.header, _INFO)
            start = time.thread_time()
            answer = tracker.step(found, params, tree, image)
            took_ms.append(1e3 * (time.thread_time() - start))
            assert answer is not None
            recorder.write("/tracks", answer["tracks"])
            if video and answer["debug_image"]:
                video.write(answer["debug_image"].pixels)
    if video:
        video.release()
    return took_ms


def track_by_another(frames: list[Frame], path: Path) -> None:
    """Write the tracks of ByteTrack in the package `trackers`."""
    import supervision
    from trackers import ByteTrackTracker

    tracker = ByteTrackTracker(lost_track_buffer=75, frame_rate=25, minimum_consecutive_frames=2)
    with path.open("w") as file:
        for number, frame in enumerate(frames, 1):
            boxes = np.array([box for box, _ in frame.found]).reshape(-1, 4)
            scores = np.array([score for _, score in frame.found])
            found = supervision.Detections(
                boxes, confidence=scores, class_id=np.zeros(len(boxes), int)
            )
            tracked = tracker.update(found)
            for (left, top, right, bottom), id in zip(
                tracked.xyxy, tracked.tracker_id, strict=True
            ):
                if id >= 0:
                    size = f"{right - left:.2f},{bottom - top:.2f}"
                    file.write(
                        f"{number},{id + 1},{left + 1:.2f},{top + 1:.2f},{size},1,-1,-1,-1\n"
                    )


def track_by_truth(frames: list[Frame], path: Path) -> None:
    """Write every detection with the id of the true object that it overlaps most: the best ids."""
    with path.open("w") as file:
        for number, frame in enumerate(frames, 1):
            taken = set()
            for box, _ in sorted(frame.found, key=lambda one: -one[1]):
                shares = [
                    (
                        _common(box, one.box)
                        / _area(
                            np.r_[
                                np.minimum(box[:2], one.box[:2]), np.maximum(box[2:], one.box[2:])
                            ]
                        ),
                        one.id,
                    )
                    for one in frame.seen
                ]
                share, id = max(shares, default=(0.0, 0))
                if share > 0.4 and id not in taken:
                    taken.add(id)
                    size = f"{box[2] - box[0]:.2f},{box[3] - box[1]:.2f}"
                    file.write(
                        f"{number},{id},{box[0] + 1:.2f},{box[1] + 1:.2f},{size},1,-1,-1,-1\n"
                    )


def write_truth(frames: list[Frame], path: Path) -> None:
    rows = []
    for number, frame in enumerate(frames, 1):
        for one in frame.seen:
            left, top, right, bottom = one.box
            size = f"{right - left:.2f},{bottom - top:.2f}"
            rows.append(
                f"{number},{one.id},{left + 1:.2f},{top + 1:.2f},{size},1,1,{one.shown:.2f}"
            )
    path.write_text("\n".join(rows) + "\n")


def evaluate(folder: Path, lengths: dict[str, int], name: str) -> dict[str, float]:
    """HOTA, MOTA, IDF1 and switches of ids over all sequences, by TrackEval's reader."""
    import trackeval

    with contextlib.redirect_stdout(io.StringIO()):
        data = trackeval.datasets.MotChallenge2DBox(
            {
                "GT_FOLDER": str(folder / "truth"),
                "TRACKERS_FOLDER": str(folder / "tracks"),
                "TRACKERS_TO_EVAL": [name],
                "SEQ_INFO": lengths,
                "SKIP_SPLIT_FOL": True,
                "DO_PREPROC": False,
                "PRINT_CONFIG": False,
            }
        )
        settings = dict.fromkeys(
            (
                "PRINT_CONFIG",
                "PRINT_RESULTS",
                "OUTPUT_SUMMARY",
                "OUTPUT_DETAILED",
                "PLOT_CURVES",
                "TIME_PROGRESS",
            ),
            False,
        )
        metrics = [
            trackeval.metrics.HOTA(),
            trackeval.metrics.CLEAR(),
            trackeval.metrics.Identity(),
        ]
        result, _ = trackeval.Evaluator(settings).evaluate([data], metrics)
    both = result["MotChallenge2DBox"][name]["COMBINED_SEQ"]["pedestrian"]
    return {
        "HOTA": 100 * float(np.mean(both["HOTA"]["HOTA"])),
        "MOTA": 100 * both["CLEAR"]["MOTA"],
        "IDF1": 100 * both["Identity"]["IDF1"],
        "worst IDF1": 100
        * min(
            one["pedestrian"]["Identity"]["IDF1"]
            for seq, one in result["MotChallenge2DBox"][name].items()
            if seq != "COMBINED_SEQ"
        ),
        "switches": both["CLEAR"]["IDSW"],
    }


SCENES = {
    "25 Hz": (25.0, False),
    "8 Hz": (8.0, False),
    "25 Hz, still camera": (25.0, True),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--film", default="", help="of the first scene, with the tracks")
    options = parser.parse_args()
    ways = ["odometry", "image", "none"]
    with contextlib.suppress(ImportError):
        import trackers  # noqa: F401

        ways.append("trackers")
    ways.append("true ids")
    names = "scene", "camera's motion", "HOTA", "MOTA", "IDF1", "worst IDF1", "switches", "step, ms"
    print(f"| {' | '.join(names)} |")
    print(f"|{'---|' * len(names)}")
    for scene, (rate, still) in SCENES.items():
        measure(scene, rate, still, ways, options)


def measure(scene: str, rate: float, still: bool, ways: list[str], options: Any) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder, lengths, took_ms = Path(name), {}, {way: [] for way in ways}
        for seed in range(options.seeds):
            frames = list(drive(seed, options.seconds, rate, still, drawn="image" in ways))
            sequence, lengths[f"s{seed}"] = f"s{seed}", len(frames)
            (folder / "truth" / sequence / "gt").mkdir(parents=True)
            write_truth(frames, folder / "truth" / sequence / "gt" / "gt.txt")
            for way in ways:
                (folder / "tracks" / way / "data").mkdir(parents=True, exist_ok=True)
                path = folder / "tracks" / way / "data" / f"{sequence}.txt"
                if way == "trackers":
                    track_by_another(frames, path)
                elif way == "true ids":
                    track_by_truth(frames, path)
                else:
                    given = (
                        frames
                        if way == "image"
                        else [one._replace(gray=one.gray[:0]) for one in frames]
                    )
                    took_ms[way] += track(given, path, way)
            if options.film and not seed:
                track(frames, folder / "film.txt", "image", options.film)
                options.film = ""
        for way in ways:
            got = evaluate(folder, lengths, way)
            cells = [f"{value:.1f}" for value in got.values()]
            cells += [f"{np.median(took_ms[way]):.2f}" if took_ms[way] else ""]
            print(f"| {scene} | {way} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
