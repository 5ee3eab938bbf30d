"""Worlds of parts of real pictures without landmarks, to train on."""

import json
from types import MappingProxyType

import cv2
import negatives
import numpy as np
import pytest
from negatives import cut_part, files_in, write_worlds

from ros_visualise.landmarks.networks.candidates import Candidates
from ros_visualise.nodes.landmark_detector import OWN_MODEL


@pytest.fixture
def sources(tmp_path):
    folder = tmp_path / "sources"
    folder.mkdir()
    for number in range(3):
        picture = np.random.default_rng(number).integers(100, 120, (90 + 200 * number, 500, 3))
        cv2.imwrite(str(folder / f"{number}.png"), picture.astype(np.uint8))
    (folder / "notes.txt").write_text("no picture")
    return folder


def test_a_world_has_parts_without_labels_and_says_what_went_in(sources, tmp_path, monkeypatch):
    monkeypatch.setattr(negatives, "PER_WORLD", 5)
    files = files_in([sources])
    write_worlds(tmp_path / "out", files, 1, 7, OWN_MODEL)
    (folder,) = (tmp_path / "out").iterdir()
    labels = json.loads((folder / "labels.json").read_text())
    assert not any(labels["pictures"].values())
    assert len(labels["pictures"]) == 5
    assert cv2.imread(str(folder / "0004.jpg")).shape == (320, 320, 3)
    assert set(json.loads((folder / "sources.json").read_text())) == {"0.png", "1.png", "2.png"}


def test_parts_of_the_same_seed_are_the_same(sources, tmp_path, monkeypatch):
    monkeypatch.setattr(negatives, "PER_WORLD", 3)
    for out in ("a", "b"):
        write_worlds(tmp_path / out, files_in([sources]), 1, 7, OWN_MODEL)
    first, second = (tmp_path / out / "nothing_7_0" / "0002.jpg" for out in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_a_part_lies_inside_of_a_picture_of_any_shape():
    random = np.random.default_rng(3)
    for shape in ((40, 600), (600, 40), (320, 320), (1000, 2000)):
        picture = np.full((*shape, 3), 200, np.uint8)
        assert (cut_part(random, picture) == 200).all()


def test_what_may_be_there_without_a_label_is_hidden_and_the_hardest_part_is_kept(
    sources, tmp_path, monkeypatch
):
    class Guess:
        names = MappingProxyType({0: "helipad", 2: "post"})

        def detect(self, picture, *_):
            score = float(picture.mean()) / 255
            boxes = np.array([[1.0, 2, 30, 40], [5, 5, 9, 50]])
            return Candidates(boxes, np.array([score, 0.3]), np.array([0, 2]))

    monkeypatch.setattr(negatives, "PER_WORLD", 4)
    monkeypatch.setattr(negatives, "Network", lambda path: Guess())
    write_worlds(tmp_path / "out", files_in([sources]), 1, 7, OWN_MODEL)
    labels = json.loads((tmp_path / "out" / "nothing_7_0" / "labels.json").read_text())
    assert all(rows == [[2, 5, 5, 9, 50, 7, 50, -1]] for rows in labels["pictures"].values())
    parts = [np.full((320, 320, 3), level, np.uint8) for level in (20, 90, 50)]
    monkeypatch.setattr(negatives, "cut_part", lambda random, picture: parts[int(picture)])
    chosen = negatives._hard_part(np.random.default_rng(0), [0, 1, 2], Guess())
    assert chosen.hardness == pytest.approx(chosen.picture.mean() / 255)
