"""The shipped network is the one that the recipe made, of what its manifest says."""

import hashlib
import json
from pathlib import Path

from ros_visualise.nodes.landmark_detector import OWN_MODEL

MANIFEST = Path(__file__).parents[2] / "training" / "manifest.json"
UNSEEN = ("vtest", "dji_00", "terrain2", "intel_car", "img_0", "image0", "kitti")


def test_the_shipped_file_is_the_result_of_the_manifest():
    manifest = json.loads(MANIFEST.read_text())
    assert hashlib.sha256(OWN_MODEL.read_bytes()).hexdigest() == manifest["result"]


def test_no_picture_of_validation_and_test_went_in():
    names = [name.lower() for name in json.loads(MANIFEST.read_text())["nothing"]]
    assert len(names) > 100
    assert not [name for name in names if name.startswith(UNSEEN)]
