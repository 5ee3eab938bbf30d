"""The bounds of what is depended on: none is missing, and the versions of the tests lie within."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
tomllib: Any = pytest.importorskip("tomllib")  # of Python 3.11
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
DEPENDENCIES = [Requirement(text) for text in PROJECT["dependencies"]]
OPTIONAL = [Requirement(text) for name in EXTRAS if name != "system" for text in EXTRAS[name]]
BOUNDED = [one for one in DEPENDENCIES + OPTIONAL if one.specifier]


def pinned() -> dict[str, str]:
    """Package -> its version in the tests."""
    lines = (ROOT / "tests" / "constraints.txt").read_text().splitlines()
    pins = [line.split("==") for line in lines if "==" in line]
    return {canonicalize_name(name): version for name, version in pins}


@pytest.mark.parametrize("dependency", BOUNDED, ids=str)
def test_it_has_a_floor_and_a_bound_above(dependency):
    operators = {one.operator for one in dependency.specifier}
    assert operators >= {">=", "<"}


def test_every_dependency_of_the_package_is_bounded():
    assert not [one.name for one in DEPENDENCIES if not one.specifier]


def test_the_versions_of_the_tests_are_allowed():
    pins = pinned()
    refused = [
        f"{one} {pins[canonicalize_name(one.name)]}"
        for one in BOUNDED
        if canonicalize_name(one.name) in pins
        and pins[canonicalize_name(one.name)] not in one.specifier
    ]
    assert not refused
    assert len(pins) > len(BOUNDED)
