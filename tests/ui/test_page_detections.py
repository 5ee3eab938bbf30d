"""Detections over the images that they were made of."""

from dataclasses import replace

import numpy as np
import pytest
from scene_messages import S, image
from scene_runtime import Told

from ros_visualise.data import Detection, Detections, Header, Hypothesis, Image
from ros_visualise.graph import Graph, place
from ros_visualise.messages.definitions import Definitions
from ros_visualise.messages.recorded import Recorded
from ros_visualise.nodes import node
from ros_visualise.plotting.colors import color_of
from ros_visualise.sinks.encoding import Encoder
from ros_visualise.ui.boxes import Boxes, paint
from ros_visualise.ui.pane import Pane
from ros_visualise.ui.screen import Box
from ros_visualise.ui.shown import detections_of

GRAY = np.full((120, 160, 3), 90, np.uint8)
BOX = Detection(np.array([80.0, 60]), np.array([40.0, 20]), 0.0, (Hypothesis("dog", 0.9),))


def found(stamp_s=1.0, frame="camera", *several):
    return Detections(several or (BOX,), Header(int(stamp_s * S), frame))


def changed(picture):
    """Rows and columns of the pixels that are not as before."""
    return np.argwhere((picture != GRAY).any(axis=2))


class Clock:
    now_s = 100.0

    def __call__(self):
        return self.now_s


@pytest.fixture
def runtime():
    return Told(image=Image, found=Detections)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def boxes(runtime, clock):
    boxes = Boxes(runtime, lambda topic: ["/found"], clock)
    boxes.refresh("/image")
    return boxes


def test_a_box_its_class_and_its_score_are_painted():
    picture = paint(GRAY, [BOX], (160, 120))
    assert picture[50, 80].tolist() == picture[70, 80].tolist() == list(color_of("dog"))
    assert picture[60, 60].tolist() == picture[60, 100].tolist() == list(color_of("dog"))
    assert picture[60, 80].tolist() == [90, 90, 90]
    assert (changed(picture)[:, 0] < 48).sum() > 100  # the label stands above
    assert (GRAY == 90).all()


def test_corners_are_painted_where_they_are_known_and_scaled_with_the_picture():
    corners = np.array([[20.0, 100], [60, 100], [60, 110], [20, 110]])
    plain = replace(BOX, corners_uv=corners, hypotheses=())
    rows = changed(paint(GRAY, [plain], (160, 120)))[:, 0]
    assert (rows.min(), rows.max()) == (pytest.approx(100, abs=2), pytest.approx(110, abs=2))
    half = changed(paint(GRAY, [plain], (320, 240)))
    assert half[:, 0].min() == pytest.approx(50, abs=2)
    assert half[:, 1].max() == pytest.approx(30, abs=2)


def test_what_is_no_number_or_far_outside_is_no_harm():
    wild = replace(BOX, center_uv=np.array([1e30, -1e30]))
    broken = replace(BOX, center_uv=np.array([np.nan, 0]))
    assert len(changed(paint(GRAY, [broken], (160, 120)))) == 0
    assert paint(GRAY, [wild, broken], (160, 120)).shape == GRAY.shape


def test_an_image_waits_for_its_own_detections_and_no_other_gets_them(boxes, runtime):
    first, second = image(stamp_s=1.0), image(stamp_s=2.0)
    runtime.say(found=found(1.0))
    boxes.refresh("/image")
    assert boxes.choose(first) is first
    assert len(changed(boxes.draw(first, GRAY)))
    assert not len(changed(boxes.draw(second, GRAY)))
    assert boxes.choose(second) is None  # its detections are still made
    runtime.say(found=found(2.0))
    boxes.refresh("/image")
    assert boxes.choose(None) is second


def test_images_go_on_where_no_detections_come_any_more(boxes, runtime, clock):
    assert boxes.choose(image(stamp_s=1.0)) is not None  # none have ever come
    runtime.say(found=found(1.0))
    boxes.refresh("/image")
    assert boxes.choose(None) is not None
    assert boxes.choose(image(stamp_s=2.0)) is None
    clock.now_s += 5.0
    late = image(stamp_s=3.0)
    assert boxes.choose(late) is late


def test_a_second_detector_adds_to_the_image_that_is_shown(boxes, runtime):
    shown = image(stamp_s=1.0)
    runtime.say(found=found(1.0))
    boxes.refresh("/image")
    assert boxes.choose(shown) is shown
    other = replace(BOX, center_uv=np.array([30.0, 90]))
    runtime.say(found=found(1.0, "camera", other))
    assert boxes.refresh("/image")
    assert boxes.draw(shown, GRAY)[90, 10].tolist() == list(color_of("dog"))


def test_detections_of_another_camera_at_the_same_time_are_not_drawn(boxes, runtime):
    runtime.say(found=found(1.0, "right"))
    boxes.refresh("/image")
    assert not len(changed(boxes.draw(image(frame="left"), GRAY)))
    assert len(changed(boxes.draw(image(frame="right"), GRAY)))


def test_nothing_is_asked_for_while_they_are_hidden(boxes, runtime):
    assert runtime.asked["/found"] == 1
    boxes.visible = False
    boxes.refresh("/image")
    assert runtime.asked["/found"] == 0
    newest = image(stamp_s=7.0)
    assert boxes.choose(newest) is newest


def test_detections_belong_to_the_images_that_their_node_takes():
    @node("detector", inputs={"image": Image}, outputs={"found": Detections})
    def detector(image, params):
        return found()

    @node("tracker", inputs={"found": Detections}, outputs={"tracks": Detections})
    def tracker(found, params):
        return found

    @node("blur", inputs={"image": Image}, outputs={"image": Image})
    def blur(image, params):
        return image

    graph = Graph(
        None,
        (
            place(detector.declared, {"image": "/left"}, {"found": "/left/found"}),
            place(tracker.declared, {"found": "/recorded"}, {"tracks": "/tracks"}),
            place(blur.declared, {"image": "/left"}, {"image": "/blurred"}),
        ),
    )
    assert detections_of(graph, "/left") == ["/recorded", "/left/found", "/tracks"]
    assert detections_of(graph, "/right") == ["/recorded", "/tracks"]
    assert detections_of(graph, "/blurred") == []  # may be of another size


def test_of_very_many_boxes_the_likeliest_are_painted_and_the_rest_is_counted():
    unlikely = replace(BOX, hypotheses=(Hypothesis("dog", 0.1),))
    likely = replace(
        BOX, center_uv=np.array([80.0, 100]), hypotheses=(Hypothesis("cat", 0.9),), id="7"
    )
    picture = paint(GRAY, [unlikely] * 19_999 + [likely], (160, 120))
    assert picture[90, 80].tolist() == list(color_of("cat"))
    few = paint(GRAY, [unlikely, likely], (160, 120))
    corner = np.s_[110:, :20]  # where it says how many more there are
    assert (few[corner] == GRAY[corner]).all()
    assert (picture[corner] == 255).sum() > 100


def test_a_label_of_a_megabyte_is_cut():
    vast = replace(BOX, hypotheses=(Hypothesis("A" * 10**6, 0.5),))
    assert paint(GRAY, [vast], (160, 120)).shape == GRAY.shape


def test_what_was_found_in_images_that_are_not_shown_is_not_decoded(boxes, runtime):
    types = Definitions("cdr")

    def recorded(stamp_s, data=None):
        raw = Encoder("cdr").encode(found(stamp_s))
        return Recorded(Detections.type_name, data or raw, types, 0)

    passed, shown = recorded(1), recorded(2)
    broken = recorded(3, bytes(recorded(3).data)[:40])
    for message in (passed, shown, broken):
        runtime.say(found=message)
    boxes.refresh("/image")
    second = image(stamp_s=2.0)
    assert boxes.choose(second) is second
    assert boxes.draw(second, GRAY)[50, 80].tolist() == list(color_of("dog"))
    assert (passed._content, shown._content is None) == (None, False)
    third = image(stamp_s=3.0)
    assert boxes.choose(third) is third
    assert (boxes.draw(third, GRAY) == GRAY).all()


def test_windows_show_boxes_too(monkeypatch, boxes, runtime):
    shown = []
    monkeypatch.setattr("cv2.namedWindow", lambda *_: None)
    monkeypatch.setattr("cv2.imshow", lambda _, picture: shown.append(picture))
    pane = Pane("/image", Box(0, 0, 160, 120), runtime.subscribe("/image"), boxes)
    gray = Image(GRAY, "bgr8", Header(S, "camera"))
    runtime.say(image=gray, found=found(1.0))
    pane.update()
    assert shown[-1][50, 80].tolist() == list(color_of("dog"))[::-1]  # OpenCV has BGR
    assert Pane("/edges", Box(0, 0, 160, 120), runtime.subscribe("/image")).update() is None
    assert shown[-1][50, 80].tolist() == [90, 90, 90]
