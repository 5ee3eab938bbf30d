"""The shipped network is the one that the recipe made, of what its manifest says."""

import ast
import hashlib
import json
import subprocess
from pathlib import Path

import pytest

from ros_visualise.nodes.landmark_detector import OWN_MODEL

ROOT = Path(__file__).parents[2]
MANIFEST = json.loads((ROOT / "training" / "manifest.json").read_text())
UNSEEN = ("vtest", "dji_00", "terrain2", "intel_car", "img_0", "image0", "kitti")


def digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def constants() -> dict[str, object]:
    """The numbers at the top of the recipe, which imports torch."""
    found = {}
    for node in ast.parse((ROOT / "training" / "recipe.py").read_text()).body:
        if isinstance(node, ast.Assign) and not isinstance(node.value, ast.Call | ast.Attribute):
            [target] = node.targets
            names = [one.id for one in getattr(target, "elts", [target])]
            values = ast.literal_eval(node.value)
            found |= zip(names, values if len(names) > 1 else [values], strict=True)
    return found


def test_the_shipped_file_is_the_result_of_the_manifest():
    assert digest(OWN_MODEL.read_bytes()) == MANIFEST["result"]


def test_no_picture_of_validation_and_test_went_in():
    names = [name.lower() for name in MANIFEST["nothing"]]
    assert len(names) > 100
    assert not [name for name in names if name.startswith(UNSEEN)]


def test_the_recipe_has_the_seeds_and_numbers_of_the_manifest():
    recipe = constants()
    assert MANIFEST["seed"] == recipe["SEED"]
    assert MANIFEST["nothing_seed"] == recipe["NOTHING_SEED"]
    assert [MANIFEST["worlds"], MANIFEST["nothing_worlds"]] == [
        recipe["WORLDS"],
        recipe["NOTHING_WORLDS"],
    ]
    assert [MANIFEST["steps"], MANIFEST["second-steps"]] == [
        recipe["STEPS"],
        recipe["SECOND_STEPS"],
    ]
    assert [MANIFEST["batch"], MANIFEST["second-batch"]] == [
        recipe["BATCH"],
        recipe["SECOND_BATCH"],
    ]
    assert tuple(MANIFEST["shares"]) == recipe["SHARES"]


def test_what_changed_in_the_code_since_is_said():
    now = {
        name: digest((ROOT / "training" / name).read_bytes())[:16]
        for name in MANIFEST["code"]
        if (ROOT / "training" / name).exists()
    }
    changed = {name for name, before in MANIFEST["code"].items() if now.get(name) != before}
    assert changed == MANIFEST["changed_since"].keys()


def test_the_code_is_that_of_the_commit():
    def content(name: str) -> bytes | None:
        command = ["git", "-C", str(ROOT), "show", f"{MANIFEST['commit']}:training/{name}"]
        done = subprocess.run(command, capture_output=True)
        return done.stdout if done.returncode == 0 else None

    try:
        found = {name: content(name) for name in MANIFEST["code"]}
    except FileNotFoundError:
        pytest.skip("no git")
    if None in found.values():
        pytest.skip("a clone without that commit")
    assert {name: digest(text)[:16] for name, text in found.items()} == MANIFEST["code"]
