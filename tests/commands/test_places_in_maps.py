"""`landmarks --map --places`, and `bag --navigate` by these places where no tag is in sight."""

import json
from itertools import takewhile

import flown_places
import numpy as np
import pytest
import visual_flight
from visual_flight import Flight

from ros_visualise.commands import main
from ros_visualise.commands.landmarks import mapping
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.messages.recorded import content
from ros_visualise.sources.opening import open_recording

START_M = 5.0
BACK = range(54, 30, -1)


@pytest.fixture(scope="module")
def mapped(tmp_path_factory):
    """A folder with a map of tags and places, and a second flight that sees no tag."""
    folder = tmp_path_factory.mktemp("mapped")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("signal.signal", lambda *_: None)
        ground = flown_places.ground()
        patch.setattr(visual_flight, "_texture", lambda: ground)
        first = flown_places.write_flight(folder / "first.mcap", range(56))
        flown_places.write_flight(folder / "second.mcap", BACK, START_M)
        options = ["--size", flown_places.SIDE_M, "--model", "none", "--map", folder / "field.yaml"]
        assert main(["landmarks", *map(str, [first, *options, "--places"])]) == 0
    return folder


def navigate(folder, monkeypatch, *options):
    monkeypatch.setattr("signal.signal", lambda *_: None)
    given = [folder / "second.mcap", "--navigate", folder / "field.yaml", "--view", "none"]
    given += ["--node", "place_recognizer", "--rate", "0", *options]
    return main(["bag", *map(str, given)])


def test_the_map_lists_places_beside_tags_and_what_they_look_like(mapped):
    values = load_yaml(mapped / "field.yaml")
    assert values["frame_id"] == "map"
    names = [one["class"] for one in values["landmarks"]]
    tags = list(takewhile(lambda name: name.startswith("tag36h11_"), names))
    assert tags == ["tag36h11_1", "tag36h11_2", "tag36h11_3"]
    places = names[len(tags) :]
    assert len(places) >= 5
    assert all(name.startswith("place_") for name in places)
    spread = [np.reshape(one["pose"]["covariance"], (6, 6)) for one in values["landmarks"]]
    sigmas = [np.sqrt(np.trace(one[:3, :3])) for one in spread]
    assert sigmas[-1] > 1.5 * sigmas[0]  # by odometry alone since the last tag
    with np.load(mapped / "field.places.npz") as file:
        assert len(file["counts"]) == len(places)
        assert len(file["descriptors"]) == file["counts"].sum()


def test_the_robot_is_localized_by_places_where_no_tag_is_in_sight(
    mapped, monkeypatch, tmp_path, capsys
):
    out = tmp_path / "out.mcap"
    assert navigate(mapped, monkeypatch, "--json", "--record", f"{out}@/navigation/pose") == 0
    nodes = json.loads(capsys.readouterr().out)["nodes"]
    assert nodes["place_recognizer"]["recognized"] >= 3
    flight, squares = Flight(), []
    recording = open_recording(out)
    for entry in recording.read(topics=["/navigation/pose"]):
        pose = content(entry.message)
        number = BACK[(pose.header.stamp_ns - flown_places.FIRST_NS) // 200_000_000]
        off = pose.position_xyz - flight.p(number)
        assert np.linalg.norm(off) < 0.25
        squares.append(off @ np.linalg.solve(pose.covariance[:3, :3], off))
    recording.close()
    assert len(squares) >= 10
    assert np.mean(squares) < 9  # 3 is right


def test_a_damaged_file_of_places_ends_the_run_in_one_line(mapped, monkeypatch, capsys):
    path = mapped / "field.places.npz"
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    try:
        assert navigate(mapped, monkeypatch) == 2
    finally:
        path.write_bytes(whole)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"ros-visualise: {path}: not a file of places: ")


def test_places_need_a_map_to_write_and_odometry(mapped, monkeypatch, capsys):
    monkeypatch.setattr("signal.signal", lambda *_: None)
    assert main(["landmarks", str(mapped / "first.mcap"), "--places"]) == 2
    assert "--places: requires --map OUT.yaml" in capsys.readouterr().err


@pytest.mark.parametrize("is_smoothed", [True, False])
def test_a_map_without_places_says_why_it_has_none(
    mapped, monkeypatch, tmp_path, capsys, is_smoothed
):
    def fail(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr("signal.signal", lambda *_: None)
    if is_smoothed:
        monkeypatch.setattr(mapping, "places_in", lambda *_: [])
    else:
        monkeypatch.setattr(mapping, "map_of", fail)
    out = tmp_path / "short.yaml"
    options = ["--size", flown_places.SIDE_M, "--model", "none", "--duration", 0.5, "--map", out]
    options += ["--places", "--json"]
    assert main(["landmarks", *map(str, [mapped / "first.mcap", *options])]) == 0
    why = "no place was found, or none that the tags locate"
    why = why if is_smoothed else "the map was not smoothed"
    said = capsys.readouterr()
    assert f"{tmp_path}/short.places.npz: not written: {why}" in said.err
    values = load_yaml(out)
    assert values["frame_id"] == "map"  # the recording has only odom
    found = json.loads(said.out)["landmarks"]
    assert {one["frame_id"] for one in found if one["pose"]} == {"map"}
    assert values["landmarks"]
    assert [one.name for one in tmp_path.iterdir()] == ["short.yaml"]
