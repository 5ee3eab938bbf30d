"""Each tutorial works from its own text: files are written, commands run, outputs compared."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from documents import DOCUMENTS, steps
from reader import lend, run

TUTORIALS = [one for one in DOCUMENTS if one.parent.name == "tutorials" and one.stem != "index"]


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
@pytest.mark.usefixtures("opengl")
def test_tutorial_works_as_it_is_written(tutorial, recordings, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    lend(recordings, tmp_path)
    printed = ""
    for kind, text, name in steps(tutorial):
        if kind in ("python", "yaml", "xml"):
            Path(name).write_text(text)
        elif kind == "text":
            shown = lines(printed)
            missing = [one for one in lines(text) if not any(one in line for line in shown)]
            assert missing == [], printed
        elif kind == "sh":
            for line in text.splitlines():
                assert run(line, monkeypatch) == (2 if line.endswith("# fails") else 0), line
            printed = "\n".join(capfd.readouterr())


def lines(text: str) -> list[str]:
    """The lines with one blank between words, and N for each number; … stands for others."""
    kept = (line for line in text.splitlines() if line != "…")
    return [re.sub(r"\d+(\.\d+)?", "N", " ".join(line.split())) for line in kept]
