"""YAML files that are small and stand for much are refused in one line, and quickly."""

import sys

import forked
import pytest

from ros_visualise.core.yaml_files import MANY_VALUES, BadYaml, load_yaml

NINE = "[" + ",".join(["lol"] * 9) + "]"
LAUGHS = f"a0: &a0 {NINE}\n" + "".join(
    f"a{n}: &a{n} [{','.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 10)
)


@pytest.fixture
def load(tmp_path):
    def write_and_load(text):
        path = tmp_path / "file.yaml"
        path.write_text(text)
        return load_yaml(path)

    return write_and_load


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (LAUGHS, "more than 32768 values in line 5"),
        ("a: &a [1, *a]", "more than 32768 values"),
        (LAUGHS.replace("[", "{<<: [").replace("]", "]}"), "YAML|values|mapping"),
        ("a: " + "[" * 100_000, "nested more than 50 deep in line 1"),
        ("a: [" + "1," * 250_000 + "]", "more than 32768 values"),
        ("#" * (5 << 20), "more than 1 MiB"),
        ("a: " + "9" * 5000, "a text file of keys and values"),
        ("%YAML 1.1\n---\na: 1" + ":01" * 300_000, "more than 65536 characters"),
        ("a: *b", "undefined alias 'b' in line 1"),
    ],
    ids=[
        "laughs",
        "itself",
        "merged",
        "deep",
        "many",
        "long",
        "digits",
        "sexagesimal",
        "undefined",
    ],
)
def test_what_is_too_much_is_refused(load, text, why):
    with pytest.raises(BadYaml, match=why):
        load(text)


def test_a_part_may_be_named_again(load):
    assert load("a: &a {x: 1}\nb: *a\nc: {<<: *a, y: 2}") == {
        "a": {"x": 1},
        "b": {"x": 1},
        "c": {"x": 1, "y": 2},
    }


@pytest.mark.parametrize(
    "content", [LAUGHS, "filters: " + "[" * 100_000, "filters: {threshold: " + "9" * 5000 + "}"]
)
def test_parameters_that_are_too_much_are_one_line(tmp_path, content):
    path = tmp_path / "mine.yaml"
    path.write_text(content)
    done = forked.run(
        [sys.executable, "-m", "ros_visualise", "demo", "landscape", "--params", path], timeout=60
    )
    assert done.returncode == 2
    [line] = done.stderr.splitlines()
    assert f"{path}: not YAML: " in line


@pytest.mark.parametrize(("lists", "limit"), [(40, 1 << 15), (140, 1 << 17)])
def test_what_holds_matrices_may_be_larger(tmp_path, lists, limit):
    path = tmp_path / "map.yaml"
    path.write_text(f"a: &a [{'1,' * 1000}]\nb: [{'*a,' * lists}]\n")
    with pytest.raises(BadYaml, match=f"more than {limit} values"):
        load_yaml(path, limit)
    if limit < MANY_VALUES:
        assert len(load_yaml(path, MANY_VALUES)["b"]) == lists
