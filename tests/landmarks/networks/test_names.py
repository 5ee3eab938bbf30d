"""Names of classes: of Ultralytics' metadata, of text files, and what is none."""

import pytest

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.landmarks.networks.names import load_names, names_in, numbers_of


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("{0: 'person', 1: 'bicycle'}", {0: "person", 1: "bicycle"}),
        ("""{2: "driver's", 7: 'a, b: {c}'}""", {2: "driver's", 7: "a, b: {c}"}),
        ("['cat', 'dog']", {0: "cat", 1: "dog"}),
        (r"{0: 'it\'s', 1: 'caf\xe9'}", {0: "it's", 1: "café"}),
        ("{0: 'two\\nlines\\x1b[31m'}", {0: "twolines[31m"}),
        ("", {}),
        ("__import__('os').system('true')", {0: "os", 1: "true"}),
        ("[" * 100_000, {}),
        ("-" * 100_000 + "1", {}),
        ("{999999999: 'far', 1: 'near'}", {1: "near"}),
        (r"{0: '\N{nothing}', 1: 'x'}", {0: r"\N{nothing}", 1: "x"}),
    ],
)
def test_names_in_metadata(text, names):
    assert names_in({"names": text}) == names


def test_names_of_any_length_are_bounded():
    assert names_in({"names": "{0: '" + "x" * 500_000 + "'}"}) == {0: "x" * 100}
    assert names_in({"names": "'x'," * 300_000}) == {}
    assert len(names_in({"names": "'x'," * 200_000})) == 10_000
    assert names_in({}) == {}


def test_a_file_has_one_name_a_line(tmp_path):
    path = tmp_path / "names.txt"
    path.write_text("helipad\n\n  tag board \n")
    assert load_names(str(path)) == {0: "helipad", 2: "tag board"}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\xff\xfe\x00", "not a text file; give one class name"),
        (b"x\n" * 20_000, "too long; give one class name"),
        (b"x" * 2_000_000, "too long; give one class name"),
        (None, "no such file; give a text file"),
    ],
)
def test_a_file_that_is_none_is_said(data, said, tmp_path):
    path = tmp_path / "names.txt"
    if data is not None:
        path.write_bytes(data)
    with pytest.raises(OpenError, match=said) as caught:
        load_names(str(path))
    assert str(caught.value).startswith(str(path))


def test_classes_are_named_or_numbered():
    names = {0: "helipad", 3: "tag board"}
    assert numbers_of("", names) is None
    assert numbers_of(" , ", names) is None
    assert numbers_of("tag board, 7", names) == {3, 7}
    with pytest.raises(ParameterError, match="no class 'cat'; choose from helipad, tag board"):
        numbers_of("helipad, cat", names)
    with pytest.raises(ParameterError, match="choose from numbers, as no class has a name"):
        numbers_of("cat", {})
    many = {number: f"n{number}" for number in range(50)}
    with pytest.raises(ParameterError, match=r"n19, \.\.\.$"):
        numbers_of("cat", many)
