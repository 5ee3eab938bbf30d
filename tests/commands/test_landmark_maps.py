"""`ros-visualise landmarks --map`, of recordings of which all is known, and what is wrong there."""

import json
import re
import threading

import numpy as np
import pytest
from made_worlds import SIZE, turn
from recorded_tags import CALIBRATION, Flight

from ros_visualise.commands import main
from ros_visualise.commands.landmarks import mapping
from ros_visualise.core import signals
from ros_visualise.core.yaml_files import load_yaml
from ros_visualise.geometry.se3 import from_parts


@pytest.fixture
def mapped(monkeypatch, capsys, tmp_path):
    """The map of a flight: exit status, places by name, all that was said as JSON or in words."""
    monkeypatch.setattr("signal.signal", lambda *_: None)
    (tmp_path / "ost.yaml").write_text(CALIBRATION)

    def mapped(flight, *options):
        bag, out = flight.write(tmp_path / "flight.bag"), tmp_path / "map.yaml"
        given = ["--size", SIZE, "--calibration", tmp_path / "ost.yaml", "--map", out]
        status = main(["landmarks", *map(str, [bag, *given, *options])])
        said = capsys.readouterr()
        landmarks = load_yaml(out)["landmarks"] if out.exists() else []
        places = {one["name"]: np.array(one["pose"]["position"]) for one in landmarks}
        is_json = "--json" in options and said.out
        return status, places, json.loads(said.out) if is_json else said.out + said.err

    return mapped


def outliers(said):
    return {one["name"]: (one["kind"], one["text"]) for one in said["smoothing"]["outliers"]}


def off_m(flight, places):
    """By how much each tag is elsewhere than it is."""
    return {
        name: np.linalg.norm(place - flight.T_map_tag[int(name.rpartition("_")[2])][:3, 3])
        for name, place in places.items()
    }


def test_a_transform_that_is_turned_by_three_degrees_is_said_and_no_tag_is_blamed(mapped):
    flight = Flight()
    flight.off = np.array([2.0, -1.5, 1.6])
    status, places, said = mapped(flight, "--json")
    [mounting] = said["smoothing"]["mountings"]
    assert (status, mounting["wrong"], outliers(said)) == (0, True, {})
    np.testing.assert_allclose(np.linalg.norm(mounting["turn_degrees"]), 3.0, atol=0.4)
    assert "correct it" in mounting["text"]
    assert len(places) == 7


def test_a_transform_that_is_right_is_not_blamed(mapped):
    flight = Flight()
    status, places, said = mapped(flight, "--json")
    assert status == 0
    assert not said["smoothing"]["mountings"][0]["wrong"]
    assert max(off_m(flight, places).values()) < 0.05
    assert len(places) == 7


def test_what_is_wrong_with_tags_is_named_and_the_others_are_where_they_are(mapped):
    flight = Flight(views=60)
    elsewhere = from_parts(turn([0, 0, 1.0]), flight.T_map_tag[3][:3, 3] + [0.5, 0.2, 0.0])
    twin = from_parts(turn([0, 0, 0.5]), flight.T_map_tag[5][:3, 3] + [-0.4, 0.5, 0.0])

    def place_of(tag, view):
        there = flight.T_map_tag[tag]
        if tag == 3 and view % 60 >= 24:
            return [elsewhere]
        return [there, twin] if tag == 5 and view % 2 else [there]

    flight.place_of = place_of
    flight.size_of = lambda tag: SIZE * (1.25 if tag == 1 else 1.0)
    status, places, said = mapped(flight, "--json")
    found = outliers(said)
    assert status == 0
    assert {name: kind for name, (kind, _) in found.items()} == {
        "tag36h11_1": "size",
        "tag36h11_3": "moved",
        "tag36h11_5": "twice",
    }
    assert f"its side is {1.25 * SIZE:.3f} m, not {SIZE:.3f} m" in found["tag36h11_1"][1]
    assert "it moved by 0.5" in found["tag36h11_3"][1]
    off = off_m(flight, places)
    assert max(m for name, m in off.items() if name not in ("tag36h11_3", "tag36h11_5")) < 0.05


def test_a_camera_that_freezes_is_said_and_its_pictures_are_left_out(mapped):
    flight = Flight()
    flight.seen_at = lambda view: 14 if 14 <= view < 20 else view
    status, places, said = mapped(flight)
    assert status == 0
    assert max(off_m(flight, places).values()) < 0.05
    assert "skipped: 5 images identical to the previous one" in said


def test_tags_of_another_size_than_is_given_are_noticed_by_the_odometry(mapped):
    flight = Flight()
    flight.size_of = lambda tag: 1.2 * SIZE
    status, _, said = mapped(flight)
    assert status == 0
    [longer] = re.findall(r"distances from odometry are \+([\d.]+)", said)
    assert 18 < float(longer) < 22  # the focal length may be off by some of it
    assert "check the given tag size" in said


def test_a_clock_that_is_set_back_costs_no_more_than_what_is_said(mapped):
    flight = Flight()
    flight.stamps_ns[20:] -= 4 * 10**9  # set back in the middle of the recording
    status, places, _ = mapped(flight)
    assert status in (0, 1)
    assert max(off_m(flight, places).values()) < 0.2


def test_a_smoothing_that_takes_long_ends_with_ctrl_c_and_the_map_is_kept(mapped, monkeypatch):
    ended, wishes = threading.Event(), []
    note = signals.note

    def noted(request):
        wishes.append(request)
        return note(request)

    def forever(*_):
        wishes[-1].asked = True  # somebody presses Ctrl-C
        assert ended.wait(100)

    monkeypatch.setattr(signals, "note", noted)
    monkeypatch.setattr(mapping, "map_of", forever)
    status, places, said = mapped(Flight())
    assert not ended.is_set(), "it did not wait for the smoothing"
    ended.set()
    assert status == 130
    assert "contains unsmoothed landmarks" in said
    assert len(places) == 7


@pytest.mark.parametrize(("sigma", "is_trusted"), [(1e-3, True), (None, False)])
def test_a_calibration_counts_as_much_as_its_file_says(mapped, tmp_path, sigma, is_trusted):
    text = CALIBRATION
    if sigma is not None:
        numbers = ", ".join(str(float(one)) for one in (sigma**2 * np.eye(9)).ravel())
        text += f"intrinsics_covariance: {{rows: 9, cols: 9, data: [{numbers}]}}\n"
    given = tmp_path / "given.yaml"
    given.write_text(text)
    status, _, said = mapped(Flight(), "--json", "--calibration", given)
    [camera] = said["smoothing"]["calibrations"]
    assert (status, camera["intrinsics"][:4]) == (0, [600, 600, 320, 240])
    assert (camera["sigma"][0] <= 1e-3) is is_trusted
    assert abs(camera["off"][0]) < 4 * camera["sigma"][0]
