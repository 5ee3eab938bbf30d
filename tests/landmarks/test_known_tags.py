"""The file of tags: what it says, and one clear line for each thing that is wrong in it."""

import numpy as np
import pytest

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.landmarks.tags import Tag
from ros_visualise.landmarks.tags.known import parse_ids, read_known_tags

GOOD = """
standalone_tags:
  - {id: 3, size: 0.162}
  - {id: 4, size: 0.05, name: dock}
tag_bundles:
  - name: box
    layout:
      - {id: 10, size: 0.2}
      - {id: 11, size: 0.4, x: 1, y: 2, z: 3, qw: 0, qx: 0, qy: 1, qz: 0}
"""


def test_sizes_names_and_bundles_are_read(tmp_path):
    path = tmp_path / "tags.yaml"
    path.write_text(GOOD)
    known = read_known_tags(path)
    assert known.sizes == {3: 0.162, 4: 0.05}
    assert known.names == {4: "dock"}
    (box,) = known.bundles
    assert box.name == "box"
    square = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    np.testing.assert_allclose(box.corners_xyz[10], square * 0.1)
    turned = square * [-0.2, 0.2, 0] + [1, 2, 3]  # half a turn about y
    np.testing.assert_allclose(box.corners_xyz[11], turned, atol=1e-12)
    assert set(known.every) == {3, 4, 10, 11}


def test_a_file_without_tags_is_one(tmp_path):
    path = tmp_path / "tags.yaml"
    path.write_text("standalone_tags: []\ntag_bundles:\n")
    assert not read_known_tags(path).every


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- 1", "the file: give a mapping with keys from standalone_tags, tag_bundles"),
        ("tags: []", "the file: unknown key 'tags'; choose from standalone_tags, tag_bundles"),
        ("standalone_tags: 3", "standalone_tags: give a list"),
        (
            "standalone_tags: [3]",
            "standalone_tags, entry 1: give a mapping with keys from id, size, name",
        ),
        ("standalone_tags: [{id: 3}]", "entry 1: missing size"),
        ("standalone_tags: [{id: 3, size: 0}]", "size is 0; give the side of its square in metres"),
        ("standalone_tags: [{id: 3, size: big}]", "size is 'big'; give a number"),
        ("standalone_tags: [{id: 3, size: .nan}]", "size is nan; give a number"),
        ("standalone_tags: [{id: 3, size: 1.0e-9}]", "size is 1e-09; give the side of its square"),
        ("standalone_tags: [{id: 3, size: 1000}]", "size is 1000; give the side of its square"),
        ("standalone_tags: [{id: -1, size: 1}]", "id is -1; give an integer, 0 or more"),
        ("standalone_tags: [{id: 3, size: 1, name: ''}]", "name is ''; give a non-empty string"),
        ("standalone_tags: [{id: 3, siez: 1}]", "unknown key 'siez'; choose from id, size, name"),
        ("standalone_tags: [{id: 3, size: 1}, {id: 3, size: 1}]", "entry 2: duplicate tag 3"),
        ("tag_bundles: [{name: a, layout: []}]", "tag_bundles, entry 1: no tags in its layout"),
        (
            "tag_bundles: [{name: a, layout: [{id: 1, size: 1, qw: 3}]}]",
            "tag_bundles, entry 1, layout entry 1: qw, qx, qy, qz have norm 3; give a unit",
        ),
        (
            GOOD.replace("{id: 10,", "{id: 3,"),
            "layout entry 1: size 0.2, but 0.162 in standalone_tags (tag 3)",
        ),
        (
            "tag_bundles: [{name: a, layout: [{id: 1, size: 1, x: 1.0e+300}]}]",
            "x is 1e+300; give a number in metres",
        ),
        (
            "tag_bundles: [{name: a, layout: [{id: 1, size: 1}]},"
            " {name: b, layout: [{id: 1, size: 1}]}]",
            "tag 1 is in two bundles, 'a' and 'b'",
        ),
        (GOOD.replace("dock", "box"), "duplicate name 'box'; names must be unique"),
        ("a: [", "in line 1"),
        ("ignore_tags: [x]", "ignore_tags: id is 'x'; give an integer"),
        ("tag_id_remap: [{id: 1}]", "tag_id_remap, entry 1: missing remaps"),
        (
            "tag_id_remap: [{id: 1, remaps: [{remap_id: 2, start_time: a, end_time: 1}]}]",
            "tag_id_remap, entry 1, remap 1: start_time is 'a'; give a number of seconds",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, text, said):
    path = tmp_path / "tags.yaml"
    path.write_text(text)
    with pytest.raises(OpenError) as caught:
        read_known_tags(path)
    assert said in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_tags_are_ignored_and_change_their_id_for_a_time(tmp_path):
    path = tmp_path / "tags.yaml"
    path.write_text(
        "ignore_tags: [166]\ntag_id_remap:\n- id: 20\n  remaps:\n"
        "  - {remap_id: 420, start_time: 10.5, end_time: 20.0}\n"
    )
    known = read_known_tags(path)
    tags = [Tag("tag36h11", id, np.zeros((4, 2)), 0, 0.0) for id in (20, 166, 3, 213)]

    def ids(stamp_s):
        return [tag.id for tag in known.present(tags, int(stamp_s * 1e9), parse_ids("213, 4"))]

    assert (ids(10), ids(10.5), ids(20), ids(21)) == ([20, 3], [420, 3], [420, 3], [20, 3])
    with pytest.raises(UsageError, match="'x' is not the id of a tag"):
        parse_ids("1,x")


def test_a_file_that_is_not_there_is_said(tmp_path):
    with pytest.raises(OpenError, match="no such file; give a YAML file of tags"):
        read_known_tags(tmp_path / "none.yaml")
    with pytest.raises(OpenError, match="directory; give a YAML file of tags"):
        read_known_tags(tmp_path)
