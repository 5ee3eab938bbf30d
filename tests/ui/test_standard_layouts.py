"""Standard layouts: what a person sees first of a film, a robot, a log of numbers, and nothing."""

from contextlib import ExitStack, closing
from pathlib import Path

import pytest

from ros_visualise.data import NavSatFix
from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import image_pipeline, recording_pipeline
from ros_visualise.lessons.pipeline import lesson_pipeline
from ros_visualise.lessons.topics import canny
from ros_visualise.sources.opening import open_recording
from ros_visualise.ui.shell import layouts
from ros_visualise.ui.shell.layouts import standard_layout


def panels(place):
    """The panels of a layout, in the order of reading."""
    if "panel" in place:
        return [place["panel"]]
    children = next(place[name] for name in ("row", "column", "tabs") if name in place)
    return [name for child in children for name in panels(child)]


def shares(place):
    """All shares of the rows and columns in a layout."""
    found = [place["at"]] if "at" in place else []
    for name in ("row", "column"):
        for child in place.get(name, ()):
            found += shares(child)
    return found


def test_a_film_has_its_parameters_beside_its_images():
    layout = standard_layout(image_pipeline("landscape"))
    assert panels(layout) == ["nodes", "files", "image", "image", "image"]
    first, *_ = layout["row"][1]["row"][0]["column"]
    assert first["state"]["topic"] == "/controlled_stream"


def test_a_recording_without_images_has_its_topics_3d_and_a_plot_of_the_usual_numbers(recordings):
    with closing(open_recording(recordings / "bags/robot_localization_test1.bag")) as recording:
        layout = standard_layout(recording_pipeline(recording))
    assert panels(layout) == ["topics", "nodes", "files", "space", "plots"]
    plot = layout["row"][1]["column"][1]
    assert [pane["curves"] for pane in plot["state"]["panes"]] == [
        [f"/husky_velocity_controller/odom:pose.pose.position.{axis}" for axis in "xy"],
        [f"/imu/data:angular_velocity.{axis}" for axis in "xyz"],
    ]


def test_a_recording_of_unusual_places_has_them_y_over_x(recordings):
    with closing(open_recording(recordings / "bags/foxglove_example.bag")) as recording:
        layout = standard_layout(recording_pipeline(recording))
    assert panels(layout)[-2:] == ["space", "plots"]
    panes = layout["row"][1]["column"][1]["state"]["panes"]
    assert panes == [
        {"kind": "xy", "x": f"/{turtle}/pose:x", "curves": [f"/{turtle}/pose:y"]}
        for turtle in ("turtle1", "turtle2")
    ]


def test_a_recording_of_frames_alone_has_their_tree_below_3d(recordings):
    with closing(open_recording(recordings / "bags/evo_tf_example.bag")) as recording:
        assert panels(standard_layout(recording_pipeline(recording)))[-2:] == ["space", "frames"]


def test_a_flight_log_has_its_usual_numbers(recordings):
    path = recordings / "trajectory/px4_ulog/sample_log_small.ulg"
    with closing(open_recording(path)) as recording:
        layout = standard_layout(recording_pipeline(recording))
    panes = layout["row"][1]["column"][1]["state"]["panes"]
    assert [pane["curves"][0] for pane in panes] == [
        "/imu/data:angular_velocity.x",
        "/gps/fix:altitude",
    ]


def test_a_recording_without_numbers_has_its_messages(recordings):
    path = recordings / "tagslam/example_13/tag_detections.bag"
    with closing(open_recording(path)) as recording:
        layout = standard_layout(recording_pipeline(recording))
    (topic,) = recording.topics
    assert {"panel": "messages", "state": {"topic": topic}} in layout["row"]


def test_nothing_yet_offers_files():
    for graph in (None, Graph(None, ())):
        assert panels(standard_layout(graph))[0] == "files"


@pytest.mark.parametrize("count", range(1, 7))
def test_images_share_the_room(count):
    found = layouts._grid([f"/{number}" for number in range(count)])
    assert len(panels(found)) == count
    columns = found.get("row", [found])
    assert len({len(panels(column)) for column in columns}) <= 2


def test_a_lesson_about_images_has_no_3d_though_its_picture_has_a_position(recordings):
    photo = str(recordings / "video/DJI_0020.JPG")
    with ExitStack() as undo:
        graph = lesson_pipeline(canny.LESSON, photo, Path(), at_end=False, undo=undo)
    assert NavSatFix in {topic.type for topic in graph.topics.values()}
    assert "space" not in panels(standard_layout(graph))
    assert panels(standard_layout(graph)).count("image") == 6
