"""A script without a package that it needs ends with one line, and not with a traceback."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
HIDING = """
import runpy, sys
name, script, *words = sys.argv[1:]
sys.modules[name] = None
sys.argv = [script, *words]
sys.path[0] = script.rpartition("/")[0]
runpy.run_path(script, run_name="__main__")
"""


def without(package: str, script: str, *words: str) -> tuple[int, str]:
    command = [sys.executable, "-c", HIDING, package, str(ROOT / script), *words]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=60)
    return ended.returncode, ended.stderr


@pytest.mark.parametrize(
    ("package", "script"),
    [
        ("torch", "training/train.py"),
        ("onnx", "training/batches.py"),
        ("cv2", "training/evaluate.py"),
        ("cv2", "docs/pictures.py"),
    ],
)
def test_a_missing_package_is_one_line(package, script):
    status, printed = without(package, script)
    assert (status, printed.count("\n")) == (2, 1)
    assert f"{Path(script).name} needs {package}: pip install " in printed


def test_other_errors_keep_their_traceback():
    status, printed = without("math", "training/evaluate.py")
    assert status == 1
    assert "Traceback" in printed


def test_an_unknown_picture_of_the_documentation_is_one_line():
    status, printed = without("torch", "docs/pictures.py", "look")
    assert (status, printed.count("\n")) == (2, 1)
    assert printed.startswith("no picture look; choose from examples/01_own_filter,")
