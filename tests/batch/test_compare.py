"""``compare`` finds what changed between two batches, and fails where it is beyond the limits."""

import json
import shutil
import subprocess
from xml.etree import ElementTree

import forked
import numpy as np
import pytest
from made_flights import FINDER, batch, command, drive
from made_videos import numbered, write_video

from ros_visualise.batch.comparison import FrameBoxes, iou, match


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Results before and after a change of one threshold; of the former twice."""
    folder = tmp_path_factory.mktemp("compared")
    (folder / "finder.py").write_text(FINDER)
    (folder / "in").mkdir()
    write_video(folder / "in" / "film.mkv", numbered(12))
    drive(folder / "in" / "drive.mcap")
    for name, level in (("before", 0), ("again", 0), ("after", 30)):
        done = batch(
            *(folder / "in", "--out", folder / name, "--node", f"{folder}/finder.py:finder"),
            *("--set", f"finder.level={level}", "--pipeline", "none", "--workers", 1),
        )
        # the drive has no images for the node
        assert done.returncode == 1, done.stderr
    return folder


def compare(*arguments: object) -> subprocess.CompletedProcess[str]:
    return forked.run(command("compare", *arguments), timeout=60)


def test_the_same_work_has_no_changes(results):
    done = compare(results / "before", results / "again", "--json")
    assert done.returncode == 0, done.stdout
    found = json.loads(done.stdout)
    assert {one["metric"] for one in found["changes"]} <= {"cpu", "step", "p99"}


def test_a_changed_threshold_is_found(results, tmp_path):
    xml, page = tmp_path / "changes.xml", tmp_path / "changes.html"
    options = ("--junit", xml, "--html", page, "--json")
    done = compare(results / "before", results / "after", *options)
    assert done.returncode == 1, done.stderr
    found = [one for one in json.loads(done.stdout)["changes"] if one["limit"] is not None]
    assert len(found) == 1
    assert (found[0]["metric"], found[0]["of"]) == ("lost", "/finder")
    assert (found[0]["before"], found[0]["after"], found[0]["change"]) == (24, 20, 4)
    assert found[0]["at_ns"] == 0
    suite = ElementTree.parse(xml).getroot()
    assert suite.get("failures") == "1"
    failed = [one for one in suite if one.find("failure") is not None]
    assert failed[0].get("classname") == "film.mkv"
    text = page.read_text()
    assert text.count("<img") == 2
    assert "film.mkv" in text


@pytest.mark.parametrize(
    ("limits", "status"),
    [
        ("lost: 4", 0),
        ("lost: 3", 1),
        ("/fin*: {lost: 5}", 0),
        ("/fin*: {lost: 5}\n/finder: {lost: 1}", 1),
        ("cpu: 0.000001\nlost: 10", 1),
        ("lots: 3", 2),
        ("lost: many", 2),
        ("- 3", 2),
    ],
)
def test_limits(results, tmp_path, limits, status):
    (tmp_path / "limits.yaml").write_text(limits)
    done = compare(results / "before", results / "after", "--limits", tmp_path / "limits.yaml")
    assert done.returncode == status, done.stdout + done.stderr
    assert len(done.stderr.splitlines()) == (status == 2)


def test_poses_are_compared_with_each_other_and_the_truth(tmp_path):
    for name, sigma in (("before", 0.01), ("after", 0.1)):
        drive(tmp_path / name / "drive.mcap", 200, sigma, truth=True)
        assert batch(tmp_path / name, "--out", tmp_path / f"{name}_out").returncode == 0
    done = compare(tmp_path / "before_out", tmp_path / "after_out", "--json")
    found = {
        one["metric"]: one for one in json.loads(done.stdout)["changes"] if one["of"] == "/odom"
    }
    assert found["ate_m"]["before"] == pytest.approx(0.01 * 3**0.5, rel=0.1)
    assert found["ate_m"]["after"] == pytest.approx(0.1 * 3**0.5, rel=0.1)
    assert found["position_m"]["change"] == pytest.approx(0.1 * 3**0.5, rel=0.2)
    assert "rotation_deg" not in found
    nees = found.get("nees", {"before": 3.0, "after": 3.0})
    assert nees["before"] == pytest.approx(3, rel=0.2), "of three exact rotations and positions"
    assert nees["after"] == pytest.approx(3, rel=0.2)


def test_recordings_are_known_by_their_content(results, tmp_path):
    shutil.copytree(results / "in", tmp_path / "other" / "deep")
    drive(tmp_path / "other" / "new.mcap", 20)
    done = batch(tmp_path / "other", "--out", tmp_path / "out", "--pipeline", "none")
    assert done.returncode == 0, done.stderr
    one = batch(results / "in", "--out", tmp_path / "all", "--pipeline", "none")
    assert one.returncode == 0
    found = json.loads(compare(tmp_path / "all", tmp_path / "out", "--json").stdout)["changes"]
    left = [(one["recording"], one["metric"]) for one in found if one["limit"] is not None]
    assert left == [("new.mcap", "recordings")]


def test_boxes_are_matched_by_overlap():
    boxes = np.array([[left, 0.0, 2, 2] for left in (0, 0.2, 1, 5)])
    overlaps = [iou(boxes[0], one) for one in boxes]
    assert overlaps == pytest.approx([1, 1.8 / 2.2, 1 / 3, 0])
    two = FrameBoxes(["a", "a"], boxes[:2])
    swapped = FrameBoxes(["a", "a"], two.boxes[::-1])
    assert match(two, swapped) == [1, 1]
    assert match(two, FrameBoxes(["b", "a"], two.boxes)) == [1]
    assert match(two, FrameBoxes([], np.zeros((0, 4)))) == []
