"""README.md and docs are right: their links lead somewhere, their commands exist."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from documents import DOCUMENTS, PACKAGE, block, commands, prose, steps

from ros_visualise.commands import COMMANDS, _parser
from ros_visualise.running.executables import names

OTHERS = ("CONTRIBUTING.md", "benchmarks/README.md", "benchmarks/ros2/README.md")
LINKED = tuple(PACKAGE / name for name in ("README.md", *OTHERS, "training/README.md"))
"""Beside those of docs, whose links the build of the site checks."""
WRITTEN = {name for path in DOCUMENTS for _, _, name in steps(path)}
"""Files that a tutorial has its reader write."""

MOST_LINES = 150
"""Of the README, which a newcomer reads whole."""


def shown(path: Path) -> str:
    return str(path.relative_to(PACKAGE))


def called(program: str) -> list[Any]:
    """Each call of a program as a parameter of a test."""
    return [
        pytest.param(words, id=f"{path.stem}: {' '.join(words)}"[:80])
        for path in DOCUMENTS
        for words in commands(path, program)
    ]


@pytest.fixture(scope="module")
def nodes() -> dict[str, set[str]]:
    """Names of the parameters of each node."""
    listed = subprocess.run(
        [sys.executable, "-m", "ros_visualise", "nodes", "--json"], capture_output=True, check=True
    )
    return {name: set(node["params"]) for name, node in json.loads(listed.stdout).items()}


def test_readme_is_short():
    assert len((PACKAGE / "README.md").read_text().splitlines()) <= MOST_LINES


@pytest.mark.parametrize("path", LINKED, ids=shown)
def test_links_lead_somewhere(path):
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(path)):
        if not re.match("https?:", target):
            name, _, anchor = target.partition("#")
            file = path.parent / name if name else path
            assert file.exists(), target
            assert not anchor or anchor in anchors(file), target


def anchors(path: Path) -> set[str]:
    """The anchors of the headings, as GitHub names them."""
    headings = re.findall("^#+ (.*)", prose(path), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", text).strip().lower().replace(" ", "-") for text in headings}


@pytest.mark.parametrize("words", called("ros-visualise"))
def test_command_lines_parse(words, nodes):
    if len(words) < 2:
        # what the text names, not a whole call; or something to show
        assert {*words} <= {*COMMANDS.names(), "THING", "drive.mcap", "photo.jpg"}
        return
    _parser(words).parse_args(words)
    options = list(pairwise(words))
    own = {value.partition("@")[0].rpartition(":")[2] for name, value in options if ":" in value}
    for name, value in options:
        if name == "--set":
            node, param = value.partition("=")[0].split(".")
            assert node in own or param in nodes[node] or node == "camera", value
        if name == "--node":
            file = value.partition(":")[0]
            added = value.partition("@")[0].partition(",")[0]
            assert added in {*nodes} or file in WRITTEN or (PACKAGE / file).exists()


@pytest.mark.parametrize("words", [*called("roslaunch"), *called("ros2")])
def test_launch_files_have_the_arguments(words):
    files = [(at, word) for at, word in enumerate(words) if ".launch" in word]
    for at, name in files if "NAME" not in str(files) else []:
        declared = arguments(PACKAGE / "launch" / name)
        given = {word.partition(":=")[0] for word in words[at + 1 :] if ":=" in word}
        assert given <= declared, name


def arguments(path: Path) -> set[str]:
    """The arguments that a launch file declares."""
    return {arg.attrib["name"] for arg in ElementTree.parse(path).getroot().findall("arg")}


@pytest.mark.parametrize("words", [*called("rosrun"), *called("ros2")])
def test_executables_exist(words):
    if "ros_visualise" in words[:2] and "launch" not in words:
        assert words[words.index("ros_visualise") + 1] in names()


def test_own_node_is_the_example():
    example = (PACKAGE / "examples" / "01_own_filter.py").read_text()
    assert example.endswith(block("posterize", "python"))
