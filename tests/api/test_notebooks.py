"""The notebooks of the examples run from their first cell to their last, and show what they say."""

import ast
import json
from pathlib import Path

import pytest

from ros_visualise.core.supervision import PROCESS

NOTEBOOKS = Path(__file__).parents[2] / "examples" / "notebooks"


def shown(name):
    """Executes all cells as a kernel does; what each shows: the value of its last expression."""
    cells = json.loads((NOTEBOOKS / f"{name}.ipynb").read_text())["cells"]
    names = {"__name__": "__main__"}
    values = []
    for cell in cells:
        if cell["cell_type"] != "code":
            continue
        tree = ast.parse("".join(cell["source"]))
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, name, "exec"), names)
        values.append(last and eval(compile(ast.Expression(last.value), name, "eval"), names))
    return values


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path))


def test_images():
    _, frames, edges, _ = shown("images")
    assert [stamp_ns for stamp_ns, _, _ in frames] == [0, 10**9, 2 * 10**9]
    assert edges._repr_png_().startswith(b"\x89PNG")
    assert edges.pixels.any()


def test_trajectories():
    _, odometry, errors, summary, line = shown("trajectories")
    assert odometry._repr_html_().startswith("<svg")
    none, origin, se3, sim3 = errors
    assert none > 3 > origin > se3 > 0.05 > 1e-6 > sim3
    assert summary["rpe_m"][1] > 20
    assert line.startswith("0.000000000 ")


def test_nodes(capsys):
    *_, counts, last, _ = shown("nodes")
    assert len(counts) == 8
    assert counts == sorted(counts)
    assert last._repr_png_().startswith(b"\x89PNG")
    assert capsys.readouterr().out == "fragile failed: ValueError: too many edges\n"
    PROCESS.forget()
