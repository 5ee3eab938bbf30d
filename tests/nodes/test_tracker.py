"""Ids of detections over time."""

import cv2
import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment

from ros_visualise.core.errors import NoTransform, ParameterError
from ros_visualise.core.params import update
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
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.landmarks.tracking.camera_motion import ImageMotion, ground_motion
from ros_visualise.landmarks.tracking.tracker import assign, overlap
from ros_visualise.nodes import find, find_node
from ros_visualise.nodes.tracker import TrackerParams

MS = 1_000_000
K = np.array([[400.0, 0, 319.5], [0, 400, 239.5], [0, 0, 1]])


def box(u, v, side=30.0, score=0.9, **more):
    hypotheses = () if score is None else (Hypothesis("car", score),)
    return Detection(np.array([u, v]), np.array([side, side]), hypotheses=hypotheses, **more)


def found(stamp_ms, *several, **more):
    return Detections(tuple(several), Header(round(stamp_ms * MS), "camera"), **more)


class Run:
    """A tracker, and what it answers."""

    def __init__(self, **changes):
        self.params = update(TrackerParams(), changes)
        self.node, self.tree = find("tracker").make(self.params), FrameTree()

    def step(self, stamp_ms, *several, image=None, **more):
        self.answer = self.node.step(
            detections=found(stamp_ms, *several, **more),
            params=self.params,
            frames=self.tree,
            image=image,
        )
        return (
            {} if self.answer is None else {one.id: one for one in self.answer["tracks"].detections}
        )


def test_pairs_have_the_least_cost():
    rng = np.random.default_rng(0)
    for rows, columns in rng.integers(1, 20, (60, 2)):
        costs = rng.random((rows, columns)) ** rng.choice([0.2, 1, 3])
        limit = rng.uniform(0.2, 1)
        capped = np.minimum(costs, limit)
        best = capped[linear_sum_assignment(capped)].sum()
        i, j = assign(costs, limit)
        unpaired = min(rows, columns) - len(i)
        assert costs[i, j].sum() + unpaired * limit == pytest.approx(best, abs=1e-4)
        assert len({*i}) == len({*j}) == len(i)
        assert (costs[i, j] < limit).all()
    assert [len(one) for one in assign(np.zeros((0, 3)), 0.5)] == [0, 0]


def test_overlap_grows_with_the_margin():
    a, b = np.array([[0.0, 0, 10, 10]]), np.array([[5.0, 0, 10, 10], [20, 0, 10, 10]])
    assert overlap(a, b, np.zeros((1, 2)))[0] == pytest.approx([1 / 3, 0])
    assert overlap(a, b, np.full((1, 2), 10.0))[0] == pytest.approx([25 / 35, 1 / 5])


def idf1(truth, answers):
    """Share of boxes with the right id, each track matched to one object."""
    true_ids = sorted({id for frame in truth for id in frame})
    ids = sorted({id for frame in answers for id in frame})
    common = np.zeros((len(true_ids), len(ids)))
    for frame, answer in zip(truth, answers, strict=True):
        for id, center in frame.items():
            for other, one in answer.items():
                if np.abs(one.center_uv - center).max() < 15:
                    common[true_ids.index(id), ids.index(other)] += 1
    right = common[linear_sum_assignment(-common)].sum()
    return 2 * right / sum(map(len, (*truth, *answers)))


def test_traffic_with_misses_false_detections_and_uneven_times():
    rng = np.random.default_rng(3)
    run, truth, answers, now = Run(), [], [], 0.0
    start, speed = rng.uniform(50, 600, (14, 2)), rng.normal(0, 60, (14, 2))
    for _ in range(200):
        now += rng.choice([20, 40, 120])
        places = {id: start[id] + speed[id] * now / 1000 for id in range(14)}
        truth.append({id: p for id, p in places.items() if p.min() > 0 and p.max() < 640})
        seen = [
            box(*(p + rng.normal(0, 1.5, 2)), score=rng.uniform(0.2, 1))
            for p in truth[-1].values()
            if rng.random() > 0.1
        ]
        false = [box(*rng.uniform(0, 640, 2), score=0.4) for _ in range(rng.poisson(1))]
        answers.append(run.step(now, *seen, *false))
    assert idf1(truth, answers) > 0.9


def test_an_id_lasts_through_two_seconds_without_detections():
    run = Run(coast=0.3)
    for k in range(20):
        before = run.step(40 * k, box(100 + 4 * k, 100))
    for k in range(20, 70):
        run.step(40 * k)
    run.step(40 * 70, box(100 + 4 * 70, 100))
    assert [*run.step(40 * 71, box(100 + 4 * 71, 100))] == [*before] == ["1"]
    for k in range(72, 172):
        assert not run.step(40 * k) or k < 81  # published a little longer
    run.step(40 * 172, box(100 + 4 * 172, 100))
    assert [*run.step(40 * 173, box(100 + 4 * 173, 100))] == ["2"]


def test_a_missed_object_is_published_where_it_is_expected():
    run = Run(coast=0.1)
    for k in range(20):
        run.step(40 * k, box(100 + 4 * k, 100))
    assert run.step(800)["1"].center_uv == pytest.approx([180, 100], abs=1)
    assert run.step(840)["1"].center_uv == pytest.approx([184, 100], abs=1)
    assert not run.step(900)


def test_low_scores_continue_tracks_and_begin_none():
    run = Run()
    for k in range(5):
        assert not run.step(40 * k, box(300, 300, score=0.3))
    for k in range(5, 8):
        run.step(40 * k, box(100, 100, score=0.9), box(300, 300, score=0.3))
    for k in range(8, 12):
        assert [*run.step(40 * k, box(101, 100, score=0.2))] == ["1"]
    assert run.step(480, box(101, 100, score=None))["1"].hypotheses == ()  # none is certain


def test_who_leaves_the_image_takes_its_id_along():
    run, info, ids = Run(coast=0.0), CameraInfo(480, 640, K), []
    for k in range(60):
        left = 560 + 4 * k  # its left side; the image shows what is before 640
        width = min(60, 639.5 - left)
        several = [Detection(np.array([left + width / 2, 100]), np.array([width, 60]))]
        enters = 639.5 - 4 * max(k - 22, 0)  # another one comes in where it left
        if k > 24:
            size = np.array([min(60, 639.5 - enters), 60])
            several.append(Detection(np.array([enters + size[0] / 2, 100]), size))
        ids.append(run.step(40 * k, *several[k > 18 :], camera_info=info))
    assert [*ids[15]] == ["1"]
    assert [*ids[59]] == ["2"]


def test_detections_beside_the_image_have_ids_too():
    run, info = Run(), CameraInfo(48, 64, K)  # calibrated at another size
    for k in range(60):
        last = run.step(40 * k, box(300, 200), camera_info=info)
    assert [*last] == ["1"]


def test_weak_detections_in_a_row_begin_a_track():
    run = Run()
    seen = [len(run.step(40 * k, box(100, 100, score=0.4))) for k in range(6)]
    assert seen == [0, 0, 0, 0, 1, 1]


def test_an_object_turns_back():
    run = Run()
    there = [100 + 3 * k for k in range(60)]
    for k, u in enumerate((*there, *there[::-1])):
        last = run.step(40 * k, box(u, 100))
    assert [*last] == ["1"]


def test_stamps_that_repeat_go_back_or_jump():
    run = Run()
    for stamp in (0, 40, 40, 40, 80):
        last = run.step(stamp, box(100, 100))
    assert [*last] == ["1"]
    run.step(60, box(100, 100))
    assert run.answer is None
    assert run.node.report()["late"] == 1
    run.step(60_000, box(100, 100))
    assert [*run.step(60_040, box(100, 100))] == ["2"]
    run.node.reset()
    run.step(0, box(100, 100))
    assert [*run.step(40, box(100, 100))] == ["1"]


def test_objects_without_stamps_are_forgotten_too():
    run = Run()
    for _ in range(3):
        run.step(0, box(100, 100))
    for _ in range(200):
        last = run.step(0)
    assert not last
    run.step(0, box(100, 100))
    assert [*run.step(0, box(100, 100))] == ["2"]


def test_detections_without_pixels_are_ignored():
    run = Run()
    for k in range(3):
        last = run.step(40 * k, box(np.nan, 1), box(5, 5, side=0), box(50, 60, theta=0.5))
    assert [*last] == ["1"]
    assert last["1"].theta == 0.5


def test_classes_stay_apart_if_asked():
    other = Detection(
        np.array([101.0, 100]), np.array([30.0, 30]), hypotheses=(Hypothesis("van", 0.9),)
    )
    for same, expected in ((False, ["1"]), (True, ["1", "2"])):
        run = Run(same_class=same, coast=0.0)
        ids = {id for k in range(3) for id in run.step(40 * k, box(100, 100))}
        ids |= {id for k in range(3, 6) for id in run.step(40 * k, other)}
        assert sorted(ids) == expected


def noise_image(offset):
    rng = np.random.default_rng(0)
    wide = cv2.resize(rng.integers(0, 255, (15, 30), np.uint8), (960, 480))
    return Image(wide[100:420, offset : offset + 480], "mono8", Header(0, "camera"))


@pytest.mark.parametrize(("way", "expected"), [("image", ["1"]), ("none", ["1", "2"])])
def test_the_camera_turns(way, expected):
    run, ids = Run(camera_motion=way, coast=0.0, confirmations=1), set()
    for k in range(8):
        jump = 0 if k < 4 else 30
        ids |= run.step(40 * k, box(300 - jump, 160, side=10), image=noise_image(jump)).keys()
    ids |= run.step(400, box(270, 160, side=10), image=noise_image(30)).keys()
    assert sorted(ids) == expected


def test_motion_of_an_image_in_its_own_pixels():
    motion = ImageMotion()
    still = np.zeros((0, 4))
    assert motion.step(noise_image(0).pixels, still) is None
    H = motion.step(noise_image(12).pixels, still)
    assert pytest.approx(np.array([[1, 0, -12], [0, 1, 0], [0, 0, 1]]), abs=0.3) == H
    assert motion.step(np.zeros((320, 480), np.uint8), still) is None
    assert motion.unknown == 1


def looking_down(x, z, yaw=0.0):
    T = np.eye(4)
    c, s = np.cos(yaw), np.sin(yaw)
    T[:3, :3] = np.array([[c, s, 0], [s, -c, 0], [0, 0, -1.0]])
    T[:3, 3] = x, 0, z
    return T


def test_motion_of_the_ground_by_the_camera_s_poses():
    point = np.array([2.0, 1.0, 0.5])
    poses = looking_down(0, 10), looking_down(3, 12, 0.4)
    pixels = [K @ (T[:3, :3].T @ (point - T[:3, 3])) for T in poses]
    moved = ground_motion(K, *poses, 0.5) @ pixels[0]
    assert moved[:2] / moved[2] == pytest.approx(pixels[1][:2] / pixels[1][2])
    assert ground_motion(K, looking_down(0, 0.5), poses[1], 0.5) is None


def test_odometry_is_used_where_it_is_known():
    run, info = Run(coast=0.0), CameraInfo(480, 640, K)
    for k in range(10):
        x = 0 if k < 5 else 4 + 0.1 * k
        quat = rotations.from_matrix(looking_down(x, 10)[:3, :3])
        place = looking_down(x, 10)[:3, 3]
        run.tree.add(TransformStamped("camera", place, quat, Header(40 * k * MS, "odom")))
        last = run.step(40 * k, box(319.5 + 40 * (2 - x), 239.5), camera_info=info)
    assert [*last] == ["1"]
    spheres, lines, text = run.answer["markers"].markers
    assert spheres.points_xyz[0] == pytest.approx([2, -0.375, 0], abs=0.05)  # its lower side
    assert np.ptp(lines.points_xyz, axis=0).max() < 0.1
    assert (text.text, text.header.frame_id) == ("#1", "odom")
    alone = Run(camera_motion="odometry")
    with pytest.raises(NoTransform):
        alone.step(0, box(1, 1), camera_info=info)


def counts(answer):
    return {one.name: one.values for one in answer["counts"].statuses}


def test_lines_and_zones_count():
    run = Run(
        lines="gate: 0,115 640,115; side: 400,0 400,640",
        zones="yard: 50,150 250,150 250,250 50,250",
        stands_on="center",
        coast=0.0,
    )
    run.step(0)
    assert counts(run.answer)["gate"] == {"in": "0", "out": "0"}
    down = [100 + 3 * k for k in range(30)]
    shaking = [down[-1] - 3 * k for k in range(24)] + [115 + (-1) ** k for k in range(12)]
    last = {}
    for k, v in enumerate((*down, *shaking, *range(115, 88, -3)), 1):
        run.step(40 * k, box(100, v))
        last = counts(run.answer) if run.answer["counts"] else last
    assert last["gate"] == {"in": "1", "out": "1"}
    assert last["side"] == {"in": "0", "out": "0"}
    assert last["yard"] == {"inside": "0", "entered": "1"}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"lines": "gate: 1,2"}, "give NAME: U,V U,V with 2 points in pixels"),
        ({"lines": "a: 1,2 3,x"}, "give NAME: U,V"),
        ({"zones": "a: 1,2 3,4"}, "with 3 or more points"),
        ({"zones": "a: 0,0 1,0 1,1; a: 0,0 1,0 1,1"}, "give NAME"),
        ({"lines": "a: nan,0 1,1"}, "give NAME"),
        ({"low_score": 0.8}, "low_score=0.8 is above high_score=0.5"),
    ],
)
def test_bad_parameters(changes, expected):
    with pytest.raises(ParameterError, match=expected):
        update(TrackerParams(), changes)


def test_the_picture_shows_tracks_and_counts():
    run = Run(lines="gate: 0,200 480,200")
    for k in range(3):
        image = noise_image(0)
        run.step(40 * k, box(100, 100), image=image)
    shown = run.answer["debug_image"]
    assert shown.encoding == "bgr8"
    assert shown.pixels.shape == (320, 480, 3)
    assert (shown.pixels[85, 90:110] != image.pixels[85, 90:110, None]).any()


def test_it_takes_the_images_and_detections_of_a_pipeline():
    graph = image_pipeline("landscape").insert(find_node("landmark_detector"), "filters")
    whole = graph.insert(find_node("tracker"), "filters")
    assert whole.node("tracker").inputs == {
        "image": "/processed_image",
        "detections": "/detections",
    }
    after = graph.insert(find_node("tracker"), "landmark_detector")
    assert after.node("tracker").inputs == whole.node("tracker").inputs
