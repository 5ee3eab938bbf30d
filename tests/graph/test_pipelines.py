import sys
from dataclasses import replace

import pytest

from ros_visualise.core.errors import OpenError, ParameterError, UsageError
from ros_visualise.core.synchronizer import Latest
from ros_visualise.data import Image, Odometry, ParameterEvent, PoseWithCovarianceStamped
from ros_visualise.graph import place
from ros_visualise.graph.landmarks import with_known_places, with_tags
from ros_visualise.graph.pipelines import (
    alone,
    demo_pipeline,
    image_pipeline,
    simulation_pipeline,
)
from ros_visualise.graph.visual_odometry import with_visual_odometry
from ros_visualise.nodes import find, find_node, load, node
from ros_visualise.running.graphs import parse_insertion
from ros_visualise.simulation.rendering import choose_backend

OWN = """
from dataclasses import dataclass

from ros_visualise.data import Image
from ros_visualise.nodes import node
from ros_visualise.core.params import param


@dataclass(frozen=True)
class Params:
    amount: int = param(3, "how much", min=0, max=9)


@node("negative", params=Params, inputs={"image": Image}, outputs={"image": Image})
def Negative(image, params):
    '''The negative of an image.'''
    return image
"""


@pytest.fixture
def own(tmp_path):
    path = tmp_path / "own.py"
    path.write_text(OWN)
    return path


def topics_of(graph):
    return {n.name: (dict(n.inputs), dict(n.outputs)) for n in graph.members}


def test_the_image_pipeline_has_the_topics_of_the_ros_package():
    assert topics_of(image_pipeline("landscape")) == {
        "landscape": ({}, {"image": "/image_raw"}),
        "fps_control": ({"image": "/image_raw"}, {"image": "/controlled_stream"}),
        "filters": ({"image": "/controlled_stream"}, {"image": "/processed_image"}),
        "edge_detector": (
            {"image": "/processed_image"},
            {"edges": "/edges", "edges_overlay": "/edges_overlay"},
        ),
    }


def test_only_the_overlay_is_made_on_demand():
    topics = image_pipeline("landscape").topics
    assert [name for name, topic in topics.items() if topic.on_demand] == ["/edges_overlay"]


def test_the_path_is_made_of_odometry_from_outside():
    graph = alone(find_node("path"))
    ports = ["odom", "pose", "pose_cov", "fix", "tf", "tf_static"]
    assert topics_of(graph) == {"path": ({port: f"/{port}" for port in ports}, {"path": "/path"})}
    assert graph.inputs["/odom"] is Odometry
    assert graph.source is None
    assert graph.node("path").type.latched == {"path"}


@pytest.mark.parametrize("name", ["negative", "Negative"])
def test_a_node_of_ones_own_is_inserted_after_the_filters(own, name):
    found, after, _ = parse_insertion(f"{own}:{name}")
    assert after is None
    graph = topics_of(image_pipeline("landscape").insert(find_node(found), "filters"))
    assert list(graph) == ["landscape", "fps_control", "filters", "negative", "edge_detector"]
    assert graph["negative"] == ({"image": "/processed_image"}, {"image": "/negative"})
    assert graph["edge_detector"][0] == {"image": "/negative"}


def test_it_may_stand_elsewhere(own):
    found, after, _ = parse_insertion(f"{own}:negative@landscape")
    graph = topics_of(image_pipeline("landscape").insert(find_node(found), after))
    assert graph["negative"][0] == {"image": "/image_raw"}
    assert graph["fps_control"][0] == {"image": "/negative"}


def test_at_the_end_it_takes_the_edges(own):
    before = image_pipeline("landscape")
    graph = topics_of(before.insert(load(str(own), "negative"), "edge_detector"))
    assert graph["negative"][0] == {"image": "/edges"}


def test_a_node_that_publishes_something_else_leaves_the_images_as_they_were():
    @node("measure", inputs={"image": Image}, outputs={"settings": ParameterEvent})
    def measure(image, params):
        return ParameterEvent()

    graph = topics_of(image_pipeline("landscape").insert(measure.declared, "filters"))
    assert graph["measure"] == ({"image": "/processed_image"}, {"settings": "/measure"})
    assert graph["edge_detector"][0] == {"image": "/processed_image"}


def test_its_parameters_are_set_like_any_others(own):
    graph = image_pipeline("landscape").insert(load(str(own), "negative"), "filters")
    assert graph.configured({"negative": {"amount": "5"}}).node("negative").params.amount == 5
    with pytest.raises(ParameterError, match=r"negative: amount=10: must be from 0 to 9"):
        graph.configured({"negative": {"amount": 10}})


def test_what_is_not_there_is_answered_with_what_is(own):
    graph = image_pipeline("landscape")
    with pytest.raises(UsageError, match=r"no node 'blur'; choose from landscape, fps_control"):
        graph.configured({"blur": {}})
    with pytest.raises(ParameterError, match=r"fps_control: no parameter 'rate'; choose from fps"):
        graph.configured({"fps_control": {"rate": 1}})
    with pytest.raises(UsageError, match=r"declares no node 'Positive'; choose from Negative"):
        load(str(own), "Positive")
    with pytest.raises(OpenError, match="no such file"):
        load("missing.py", "Positive")
    with pytest.raises(UsageError, match="already"):
        graph.insert(graph.node("filters").type, "filters")


def test_two_files_of_one_name_do_not_break_one_another(own, tmp_path):
    other = tmp_path / "elsewhere" / own.name
    other.parent.mkdir()
    other.write_text(own.read_text().replace("amount", "strength"))
    first, second = load(str(own), "negative"), load(str(other), "negative")
    assert sys.modules[first.params.__module__].__file__ == str(own)
    assert sys.modules[second.params.__module__].__file__ == str(other)


def test_an_unknown_built_in_name_is_answered_with_those_that_there_are():
    with pytest.raises(
        UsageError, match=r"no node 'demo'; choose from autopilot, calibrator, camera"
    ):
        find("demo")


def test_an_unknown_robot_is_answered_with_those_that_there_are():
    for name in "rover", "landscape":
        with pytest.raises(UsageError, match=f"no robot '{name}'; choose from husky, quadrotor"):
            simulation_pipeline(name)


def test_the_demo_is_a_robot_on_its_mission_or_any_source_of_images():
    robot = demo_pipeline("husky", (320, 240)).source
    assert (robot.name, robot.params.mission) == ("husky", "default")
    assert (robot.params.camera_width, robot.params.camera_height) == (320, 240)
    drawn = demo_pipeline("landscape", (320, 240)).source
    assert (drawn.name, drawn.params.size) == ("landscape", "320x240")


def test_a_topic_that_is_taken_is_called_after_the_node():
    @node("edges", inputs={"image": Image}, outputs={"image": Image})
    def edges(image, params):
        return image

    inserted = image_pipeline("landscape").insert(edges.declared, "filters")
    assert inserted.topics["/edges"].publisher == "edge_detector"
    assert inserted.topics["/edges/image"].publisher == "edges"


def test_what_travels_on_topics_are_messages():
    with pytest.raises(UsageError, match=r"float is not a message type; choose from Camera.*Image"):
        node("measure", inputs={"image": Image}, outputs={"sharpness": float})


@pytest.mark.parametrize("port", ["on_demand", "latched"])
def test_what_is_said_of_outputs_is_of_those_that_there_are(port):
    with pytest.raises(UsageError, match="node measure: no output 'edges'; choose from image"):
        node("measure", inputs={"image": Image}, outputs={"image": Image}, **{port: ("edges",)})


@node(
    "locator",
    inputs={"image": Image, "odom": Odometry},
    outputs={"settings": ParameterEvent},
    sync=Latest("image"),
    frames=True,
)
def locator(image, odom, params, frames):
    """Has several inputs."""


def test_a_node_of_several_inputs_takes_topics_by_its_place_their_names_and_types():
    simulated = simulation_pipeline("husky")
    graph = topics_of(simulated.insert(locator.declared, "filters"))
    assert graph["locator"][0] == {
        "image": "/processed_image",
        "odom": "/odom",  # and not /ground_truth/odom
        "tf": "/tf",
        "tf_static": "/tf_static",
    }
    assert graph["edge_detector"] == topics_of(simulated)["edge_detector"]


def test_its_inputs_may_be_chosen_and_it_then_stands_behind_whoever_publishes_them():
    _, after, topics = parse_insertion("own.py:locator@husky,image=/edges,odom=/ground_truth/odom")
    graph = topics_of(simulation_pipeline("husky").insert(locator.declared, after, topics))
    assert graph["locator"][0]["image"] == "/edges"
    assert graph["locator"][0]["odom"] == "/ground_truth/odom"
    assert list(graph) == ["husky", "fps_control", "filters", "edge_detector", "locator", "path"]


def test_an_input_that_nothing_fits_is_named_with_what_there_is():
    landscape, husky = image_pipeline("landscape"), simulation_pipeline("husky")
    with pytest.raises(
        UsageError, match="locator: needs a topic of type Odometry for its input odom; none is"
    ):
        landscape.insert(locator.declared, "filters")
    with pytest.raises(UsageError, match=r"input odom; add ,odom=TOPIC .* one of /odom, "):
        husky.insert(locator.declared, "filters", {"odom": "/imu/data"})
    with pytest.raises(UsageError, match="locator: no input 'boxes'; choose from image, odom, tf"):
        husky.insert(locator.declared, "filters", {"boxes": "/odom"})


@pytest.mark.parametrize("text", ["own.py:N,image", "own.py:N,image=", "rectify,image=/a,image=/b"])
def test_inputs_are_chosen_by_name_and_topic(text):
    with pytest.raises(UsageError, match=r"give a node as NODE, NODE@AFTER or .*INPUT=/topic"):
        parse_insertion(text)


@pytest.mark.parametrize("text", ["own.py", "own.py:", "own:Negative", ":Negative"])
def test_a_node_is_given_by_file_and_name_or_is_built_in(text):
    with pytest.raises(UsageError, match=r"choose from .*rectify.*FILE\.py:NAME"):
        find_node(text)


def test_a_built_in_node_is_inserted_under_its_own_topic():
    name, after, _ = parse_insertion("rectify@camera")
    added = find_node(name)
    camera = image_pipeline("camera")
    graph = topics_of(camera.insert(added, after))
    assert graph["rectify"] == ({"image": "/image_raw"}, {"image_rect": "/image_rect"})
    assert graph["fps_control"][0] == {"image": "/image_rect"}
    assert topics_of(alone(added))["rectify"] == graph["rectify"]


def test_after_a_source_of_many_topics_a_node_takes_the_images_that_are_processed():
    graph = simulation_pipeline("husky").insert(find("rectify"), "husky")
    assert graph.node("rectify").inputs == {"image": "/image_raw"}


def test_a_source_is_no_node_to_insert():
    with pytest.raises(UsageError, match="camera is a source, not a node"):
        find_node("camera")


def test_a_file_that_does_not_run_says_why(own):
    own.write_text("import no_such_module")
    with pytest.raises(OpenError, match="ModuleNotFoundError: No module named 'no_such_module'"):
        load(str(own), "negative")


def test_of_two_nodes_that_show_one_picture_one_is_put_aside():
    def aside(graph):
        return [member.name for member in graph.members if member.aside]

    assert aside(image_pipeline("landscape")) == ["landscape"]
    assert aside(simulation_pipeline("husky")) == ["fps_control"]  # the robot has buttons


def navigating(robot):
    return with_tags(simulation_pipeline(robot), None, "")


def test_who_navigates_is_held_against_the_truth_where_there_is_one():
    graph = navigating("husky")
    inputs = graph.node("pose_error").inputs
    assert inputs == {"pose": "/navigation/pose", "truth": "/ground_truth/odom"}


def test_who_navigates_takes_an_imu_and_gps_where_they_are():
    inputs = navigating("husky").node("landmark_navigator")
    assert inputs.inputs["imu"] == "/imu/data"
    assert inputs.inputs["gps"] == "/fix"


@pytest.mark.parametrize(
    ("topics", "is_live", "is_taken"),
    [
        (("/initialpose",), False, True),
        (("/initialpose", "/amcl_pose"), False, False),
        (("/initialpose", "/amcl_pose"), True, True),
    ],
)
def test_an_initial_pose_recorded_for_amcl_is_left_to_amcl(topics, is_live, is_taken, caplog):
    graph = simulation_pipeline("husky")
    kinds = graph.source.type.outputs | dict.fromkeys(topics, PoseWithCovarianceStamped)
    source = replace(
        graph.source,
        type=replace(graph.source.type, outputs=kinds, live=is_live),
        outputs={**graph.source.outputs, **{one: one for one in topics}},
    )
    navigator = with_tags(replace(graph, source=source), None, "").node("landmark_navigator")
    assert ("initialpose" in navigator.inputs) is is_taken
    assert ("ignoring /initialpose" in caplog.text) is not is_taken


@pytest.mark.parametrize("navigate", [False, True])
def test_a_pad_to_land_on_is_no_landmark(navigate):
    graph = with_tags(simulation_pipeline("quadrotor"), True, "" if navigate else None)
    mapping = graph.node("landmark_navigator" if navigate else "landmark_localizer")
    assert mapping.params.moving == graph.node("landing_target").params.target


@pytest.mark.parametrize("navigate", [False, True])
def test_one_alone_tells_where_odom_is_in_the_map(navigate):
    graph = with_tags(simulation_pipeline("husky"), True, "" if navigate else None)
    assert graph.source.params.map_to_odom is not navigate


def test_the_demo_goes_on_where_nothing_can_render(monkeypatch, caplog):
    pytest.importorskip("mujoco", reason="pip install 'ros_visualise[sim]' to run this")
    monkeypatch.setenv("MUJOCO_GL", "off")
    choose_backend.cache_clear()
    source = demo_pipeline().source
    choose_backend.cache_clear()
    assert source.name == "landscape"
    assert "MUJOCO_GL=off disables rendering" in caplog.text


def test_odometry_by_eye_is_what_a_navigator_corrects_and_rests_first():
    graph = with_visual_odometry(simulation_pipeline("quadrotor"), True, True)
    graph = with_tags(graph, None, "map.yaml")
    eye, navigator = graph.node("visual_odometry"), graph.node("landmark_navigator")
    assert eye.inputs["image"] == "/image_raw"  # before the filters
    assert (eye.inputs["imu"], eye.inputs["reference"]) == ("/imu/data", "/odom")
    assert "tf" not in eye.outputs  # base_link has a parent
    assert navigator.inputs["odometry"] == eye.outputs["odometry"]
    assert navigator.params.imu is False
    assert graph.source.params.mission_delay > 0.5


@pytest.mark.parametrize("map_file", ["", "map.yaml"])
def test_a_navigator_takes_the_places_of_a_recognizer_and_shares_its_map(map_file):
    graph = with_tags(simulation_pipeline("quadrotor"), None, map_file)
    assert with_known_places(graph) is graph
    inputs = {"image": "/image_raw", "odometry": "/odom"}
    graph = with_known_places(graph.joined(place(find_node("place_recognizer"), inputs)))
    assert graph.node("landmark_navigator").inputs["places"] == "/places"
    assert graph.node("place_recognizer").params.map == map_file


def test_odometry_by_eye_is_added_only_if_asked_for_or_needed():
    simulated = simulation_pipeline("quadrotor")
    assert with_visual_odometry(simulated, None, True) is simulated
    assert with_visual_odometry(simulated, False, True) is simulated
    with pytest.raises(UsageError, match="--visual-odometry: needs images"):
        with_visual_odometry(alone(find_node("path")), True, False)
