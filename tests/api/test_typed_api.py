"""Programs that use the Python API are checked by `mypy --strict`, outside of this repository."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

RIGHT = """
import numpy as np
import ros_visualise as rv

version: str = rv.__version__
with rv.open("flight.mcap") as source:
    count: int = source.topics["/odom"].messages
    for sample in source.messages("/odom", kind=rv.Odometry):
        x: float = float(sample.message.position_xyz[0])
for frame in rv.frames("film.mp4"):
    height: int = frame.pixels.shape[0]
errors = rv.trajectory("a.tum").errors(rv.trajectory("b.tum"), align="se3")
rmse: float = errors.rmse_m
edges = rv.node_function("edge_detector", low=50)(np.zeros((9, 9), np.uint8))
width: int = edges.of("edges", rv.Image).width
for seen in rv.run(rv.pipeline("film.mp4"), "/edges", kind=rv.Image):
    stamp_ns: int = seen.message.header.stamp_ns
ids: list[str] = [tag.id for tag in rv.detect("tag.png")]
losses: tuple[str, ...] = rv.convert("a.bag", "a.mcap").losses
focal = float(rv.calibrate(["a.png"]).info.K[0, 0])
for one in rv.messages("a.bag"):
    kind: str = one.message.type_name
"""
WRONG = """
import ros_visualise as rv

rv.frames(7)
rv.trajectory("a").errors("b")
for seen in rv.messages("a", kind=rv.Odometry):
    seen.message.pixels
rv.convert("a", "b", profile="ros3")
rv.nothing
"""


@pytest.fixture(scope="module")
def checked(tmp_path_factory):
    """Lines of mypy on our examples, and on a right and a wrong program."""
    folder = tmp_path_factory.mktemp("outside")
    (folder / "right.py").write_text(RIGHT)
    (folder / "wrong.py").write_text(WRONG)
    for example in (ROOT / "examples").glob("[0-9]*.py"):
        (folder / f"example_{example.name}").write_text(example.read_text())
    page = (ROOT / "docs" / "reference" / "python.md").read_text()
    documented = re.findall("^```python\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    (folder / "documented.py").write_text("\n".join(documented))
    # OpenCV's own stubs lack names, as SimpleBlobDetector_Params.
    (folder / "mypy.ini").write_text(
        "[mypy]\n[mypy-cv2.*]\nfollow_imports = skip\nfollow_imports_for_stubs = true\n"
    )
    command = [sys.executable, "-m", "mypy", "--strict", "--no-error-summary"]
    files = sorted(str(path) for path in folder.glob("*.py"))
    done = subprocess.run([*command, *files], capture_output=True, text=True, cwd=folder)
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_right_programs_examples_and_documentation_pass(checked):
    assert [line for line in checked if not line.startswith("wrong.py")] == []


def test_mistakes_are_found(checked):
    wrong = [int(line.split(":")[1]) for line in checked if line.startswith("wrong.py")]
    assert sorted({*wrong}) == [4, 5, 7, 8, 9]
