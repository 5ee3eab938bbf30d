"""The types that a recording defines itself."""

import contextlib

import numpy as np
import pytest
from through import ROS1

from ros_visualise.core.errors import DamagedMessage
from ros_visualise.messages.definitions import Definitions

POINT = "geometry_msgs/msg/Point"


def test_a_type_may_be_defined_anew_after_it_was_read() -> None:
    types = Definitions("ros1")
    xyz = np.array([1.0, 2.0, 3.0]).tobytes()
    assert types.read(POINT, xyz).z == 3.0
    types.define(POINT, "float64 u\nfloat64 v\n")
    types.define("my/msg/Line", "geometry_msgs/Point[2] ends\n")
    assert types.read(POINT, xyz[:16]).v == 2.0
    assert types.read("my/msg/Line", xyz[:16] * 2).ends[1].u == 1.0
    assert types.write(POINT, types.read(POINT, xyz[:16])) == xyz[:16]
    assert ROS1.read(POINT, xyz).y == 2.0


RUN = "open('owned', 'w')"


@pytest.mark.parametrize("encoding", ["ros1", "cdr"])
@pytest.mark.parametrize(
    ("name", "text"),
    [
        (f"a/msg/B:\n    {RUN}\n    #", "int32 x"),
        (f"a/msg/B():\n  pass\n{RUN}#", "int32 x"),
        (f"a/msg/{RUN}", "int32 x"),
        ("a/msg/B", f"int32 x = {RUN}"),
        ("a/msg/B", f'int32 x\nstring S=\'\'\');{RUN}#\nstring T=\\"""+{RUN}+"""'),
        ("a/msg/B", f'int32 x\nstring S="{{{RUN}}}" + str({RUN})'),
        ("a/msg/B", f"int32[{RUN}] x"),
        ("a/msg/B", f"a/{RUN} x\n{'=' * 80}\nMSG: a/{RUN}\nint32 y"),
        ("a/msg/B", f"int32 __import__\nint32 class\nfloat64[] lambda {RUN}"),
    ],
)
def test_what_strangers_define_is_never_run(encoding, name, text, tmp_path, monkeypatch):
    """The library makes Python of definitions."""
    monkeypatch.chdir(tmp_path)
    definitions = Definitions(encoding)
    with contextlib.suppress(DamagedMessage):
        definitions.define(name, text)
        definitions.read(name, bytes(64))
    assert not list(tmp_path.iterdir())
