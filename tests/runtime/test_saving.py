"""Parameters that are saved, and loaded again by the command line."""

from collections import namedtuple
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum

import numpy as np
import pytest
from hub import Hub
from made_videos import write_video
from ruamel.yaml import YAML
from waiting import wait_for

from ros_visualise.commands import main
from ros_visualise.core.errors import OpenError, RecordingError, UsageError
from ros_visualise.core.params import Parameters, param
from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime import saving
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.saving import live_parameters, load, of_node, save, save_anew

SET = {
    "fps_control": {"fps": 7},
    "filters": {"blur": "median", "threshold": 77, "gray": False},
    "edge_detector": {"low": 11},
}


class Mode(Enum):
    OFF = "off"
    ON = "on"


@dataclass(frozen=True)
class Awkward:
    mode: Mode = param(Mode.OFF, "a word that is a bool elsewhere")
    small: float = param(1e-7, "a number without a point")
    whole: float = param(2.0, "a number that looks whole")
    text: str = param("12:30", "a text that is a number elsewhere")
    played: str = param("a.mp4", "what is played", saved=False)


def read(path):
    return YAML(typ="safe").load(path)


@pytest.fixture
def video(tmp_path):
    images = [np.full((48, 64, 3), 40 * number, np.uint8) for number in range(4)]
    return write_video(tmp_path / "v.mkv", images)


def test_the_command_line_loads_what_was_saved(video, tmp_path):
    runtime = LocalRuntime(image_pipeline("streamer", path=str(video)), None)
    for node, values in SET.items():
        runtime.parameters[node].update(values)
    save(live_parameters(runtime), tmp_path / "p.yaml")
    saved = read(tmp_path / "p.yaml")
    for node, values in SET.items():
        assert values.items() <= saved[node].items()
    assert "path" not in saved["streamer"]  # else it would be played in place of another
    given = [
        word
        for node, values in SET.items()
        for name, value in values.items()
        for word in ("--set", f"{node}.{name}={value}")
    ]
    assert recorded(video, tmp_path / "set.mcap", *given) == recorded(
        video, tmp_path / "loaded.mcap", "--params", str(tmp_path / "p.yaml")
    )
    assert recorded(video, tmp_path / "default.mcap") != (tmp_path / "set.mcap").read_bytes()


def recorded(video, path, *options):
    run = ("video", str(video), "--view", "none", "--rate", "0", "--record", str(path), *options)
    assert main([*run]) == 0
    return path.read_bytes()


def test_values_stay_what_they_are(tmp_path):
    save({"uav1/node": Parameters(Awkward())}, tmp_path / "p.yaml")
    expected = {"mode": "off", "small": 1e-7, "whole": 2.0, "text": "12:30"}
    assert read(tmp_path / "p.yaml") == {"uav1": {"node": expected}}
    assert type(read(tmp_path / "p.yaml")["uav1"]["node"]["whole"]) is float


def test_nothing_is_replaced(tmp_path):
    (path := tmp_path / "p.yaml").write_text("precious")
    with pytest.raises(OpenError, match="exists; choose another name"):
        save({"node": Parameters(Awkward())}, path)
    assert path.read_text() == "precious"


def test_names_and_nodes_that_cannot_be_saved(tmp_path):
    with pytest.raises(UsageError, match=r"p.mcap: give a name that ends in \.yaml"):
        save({"node": Parameters(Awkward())}, tmp_path / "p.mcap")
    with pytest.raises(UsageError, match="no node has parameters to save"):
        save({}, tmp_path / "p.yaml")
    with pytest.raises(OpenError, match="no such folder:"):
        save_anew({"node": Parameters(Awkward())}, tmp_path / "none")
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_nothing_behind(tmp_path, monkeypatch):
    usage = namedtuple("usage", "total used free")(10**9, 10**9, 0)
    monkeypatch.setattr("shutil.disk_usage", lambda _: usage)
    with pytest.raises(RecordingError, match="No space left on device; nothing was kept"):
        save({"node": Parameters(Awkward())}, tmp_path / "p.yaml")
    assert not list(tmp_path.iterdir())


def test_several_at_once_get_names_of_their_own(tmp_path, monkeypatch):
    monkeypatch.setattr(saving, "new_name", lambda: "p.yaml")
    with ThreadPoolExecutor(8) as pool:
        jobs = [pool.submit(save_anew, {"n": Parameters(Awkward())}, tmp_path) for _ in range(24)]
    assert len({job.result() for job in jobs}) == 24
    assert all(read(path)["n"]["small"] == 1e-7 for path in tmp_path.iterdir())


def test_each_process_saves_its_nodes_when_it_is_asked(tmp_path):
    hub = Hub()
    given = {"record_dir": str(tmp_path), "nodes": "fps_control filters"}
    with hub.running("pipeline", filters__blur="median", **given):
        path = answer(hub, "/pipeline/save_parameters")
    assert path.startswith(str(tmp_path / "parameters-"))
    saved = read(tmp_path / path)
    assert set(saved) == {"fps_control", "filters"}  # as pipeline.launch and --params take it
    assert saved["filters"]["blur"] == "median"


def test_the_viewer_saves_all_nodes(tmp_path):
    hub = Hub()
    given = {"view": "none", "record_dir": str(tmp_path)}
    nodes = hub.running("filters", blur="median"), hub.running("edge_detector", low=11)
    with nodes[0], nodes[1], hub.running("viewer", **given):
        service = "/viewer/save_parameters"
        saved = wait_for(
            lambda: len(found := read(tmp_path / answer(hub, service))) == 2 and found, "both nodes"
        )
    assert saved["filters"]["blur"] == "median"
    assert saved["edge_detector"]["low"] == 11


def test_a_file_of_parameters_wins(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("filters: {blur: median}\nuav1: {filters: {threshold: 7}}\n")
    hub = Hub()
    with hub.running("filters", params=str(file), threshold=9, blur="gaussian"):
        current = wait_for(lambda: hub.parameters.get("/filters"), "filters")[1].current
    assert (current.blur.value, current.threshold) == ("median", 9)
    given = {"nodes": "fps_control filters", "source": "none", "params": str(file)}
    with hub.running("pipeline", **given):
        current = wait_for(lambda: hub.parameters.get("/pipeline/filters"), "filters")[1].current
    assert current.blur.value == "median"


@pytest.mark.parametrize(
    ("text", "name", "expected"),
    [
        ("filters: {low: 1}", "/filters", {"low": 1}),
        ("filters: {low: 1}", "/uav1/filters", {"low": 1}),
        ("filters: {low: 1}\nuav1: {filters: {low: 2}}", "/uav1/filters", {"low": 2}),
        (
            "filters: {low: 1, high: 3}\nuav1: {filters: {low: 2}}",
            "/uav2/filters",
            {"low": 1, "high": 3},
        ),
        ("filters: {ros__parameters: {low: 1}}", "/filters", {"low": 1}),
        ("uav1: {filters: {low: 1}}", "/uav1", {}),
        ("other: {low: 1}", "/filters", {}),
    ],
)
def test_a_file_names_nodes_from_any_namespace_on(tmp_path, text, name, expected):
    (tmp_path / "mine.yaml").write_text(text)
    assert of_node(load(tmp_path / "mine.yaml"), name) == expected


def test_none_is_an_empty_text(tmp_path):
    hub = Hub()
    write_video(tmp_path / "v.mkv", [np.zeros((48, 64, 3), np.uint8)] * 3)
    given = {"path": str(tmp_path / "v.mkv"), "size": "none", "camera_info_url": "none"}
    with hub.running("streamer", **given):
        current = wait_for(lambda: hub.parameters.get("/streamer"), "streamer")[1].current
    assert current.size == ""


def answer(hub, service):
    """What a service answers as soon as there is one that can."""

    def call():
        try:
            return hub.services[service]()
        except (KeyError, UsageError):
            return None

    return wait_for(call, service)


@pytest.mark.parametrize("text", ["null: {fps: 3}", "fps_control: {null: 3}", "7: {fps: 3}"])
def test_names_that_are_none_are_refused_in_one_line(text, tmp_path):
    path = tmp_path / "p.yaml"
    path.write_text(text)
    with pytest.raises(OpenError, match=r"p.yaml: (null|7) is not a name; must hold NODE"):
        load(path)
