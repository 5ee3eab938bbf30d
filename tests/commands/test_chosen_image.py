"""Which images of a recording the nodes get, and which are shown."""

from contextlib import closing
from functools import partial

import pytest
from played_bags import QUICK, image, images, write_bag

from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import recording_pipeline
from ros_visualise.sources.opening import open_recording
from ros_visualise.ui.shown import first_shown

DEPTH = partial(image, encoding="16UC1", pixel=2)


@pytest.fixture
def bag(tmp_path):
    """Depth, an image without pixels, and two that the nodes can take."""
    empty = partial(image, width=0, height=0)
    topics = {"a_depth": DEPTH, "b_empty": empty, "c_gray": image, "d_gray": image}
    return write_bag(tmp_path / "r.bag", **{name: images(make) for name, make in topics.items()})


def taken(path, image=None):
    with closing(open_recording(path)) as recording:
        graph = recording_pipeline(recording, image=image)
    topic = graph.node("fps_control").inputs["image"]
    assert first_shown(graph, graph.node("player")) == topic
    return topic


def test_the_first_images_in_gray_or_colours_are_taken_and_shown(bag):
    assert taken(bag) == "/c_gray"


def test_what_came_out_of_image_nodes_already_is_taken_last(tmp_path):
    bag = write_bag(tmp_path / "r.bag", controlled_stream=images(), image_raw=images())
    assert taken(bag) == "/image_raw"


def test_those_that_are_chosen_are_taken_and_shown(bag):
    assert taken(bag, "/d_gray") == "/d_gray"
    assert taken(bag, "/a_depth") == "/a_depth"


def test_where_there_is_depth_alone_it_is_shown(tmp_path):
    bag = write_bag(tmp_path / "r.bag", a=images(DEPTH), b=images(DEPTH))
    assert taken(bag) == "/a"


def test_topics_without_messages_are_no_images(tmp_path):
    assert taken(write_bag(tmp_path / "r.bag", a=images(count=0), b=images())) == "/b"
    bag = write_bag(tmp_path / "empty.bag", a=images(count=0), depth=images(count=0))
    with closing(open_recording(bag)) as recording:
        assert [node.name for node in recording_pipeline(recording).members] == ["player"]


def test_a_node_that_nobody_listens_to_shows_its_first_images(bag):
    with closing(open_recording(bag)) as recording:
        graph = recording_pipeline(recording, image="")
        assert first_shown(graph, graph.node("player")) == "/a_depth"
        graph = recording_pipeline(recording)
    assert first_shown(graph, graph.node("edge_detector")) == "/edges"
    alone = Graph(None, (graph.node("edge_detector"),))
    assert first_shown(alone, alone.nodes[0]) == "/edges"


def test_all_images_of_the_chosen_topic_pass(run, bag):
    status, said = run("bag", bag, *QUICK)
    assert (status, "/edges: 5 messages" in said) == (0, True)


def test_where_no_images_pass_the_nodes_one_of_ones_own_comes_after_the_recording(
    run, bag, tmp_path
):
    own = tmp_path / "own.py"
    own.write_text(
        "from ros_visualise.data import Image\n"
        "from ros_visualise.nodes import node\n"
        "@node('passing', inputs={'image': Image}, outputs={'image': Image})\n"
        "def passing(image, params):\n"
        "    return image\n"
    )
    added = f"{own}:passing,image=/d_gray"
    status, said = run("bag", bag, *QUICK, "--image", "none", "--node", added)
    assert (status, "/passing: 5 messages" in said) == (0, True)
