"""Parameters that name files: whoever changes them while a node runs stays in one folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from ros_visualise.core.errors import OpenError, ParameterError
from ros_visualise.core.params import Parameters, specs
from ros_visualise.core.paths import set_folder
from ros_visualise.nodes import find_all
from ros_visualise.nodes.camera import CameraParams
from ros_visualise.nodes.landmark_localizer import LocalizerParams
from ros_visualise.sinks.files import save_again

TEXTS = {"size", "frame_id", "world", "tf_prefix", "board", "dictionary", "target", "frame"}
TEXTS |= {"fixed_frame", "ground_frame", "classes", "database_location", "class_prefix"}
TEXTS |= {"object_prefix", "moving", "gps_origin", "tf_parent", "tf_child", "families", "ignore"}
TEXTS |= {"address", "camera", "lens", "lines", "zones", "scale_by", "base_frame", "start"}
"""Parameters that are texts, and no names of files."""


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """The folder whose files may be named, with a link that leads out of it."""
    (made := tmp_path / "folder").mkdir()
    (made / "link.yaml").symlink_to(tmp_path / "precious.yaml")
    set_folder(made)
    yield made
    set_folder(Path())


def test_every_text_is_known_to_name_a_file_or_not():
    for node in find_all():
        for spec in specs(node.params):
            if spec.type is str:
                names_a_file = spec.file("/etc/passwd.yaml")
                assert names_a_file != (spec.name in TEXTS), f"{node.name}.{spec.name}"


def test_a_name_is_that_of_a_file_in_the_folder(folder: Path):
    parameters = Parameters(LocalizerParams())
    assert parameters.update({"save_to": "mine.yaml"}).save_to == str(folder / "mine.yaml")
    assert parameters.update({"save_to": str(folder / "b.yaml")}).save_to == str(folder / "b.yaml")
    assert parameters.update({"map": ""}).map == ""


@pytest.mark.parametrize(
    "name", ["/etc/x.yaml", "../precious.yaml", "sub/x", "file:///x.yaml", "link.yaml", ".x.yaml"]
)
def test_another_file_is_refused_and_nothing_changes(folder: Path, name: str):
    parameters = Parameters(LocalizerParams())
    for parameter in ("map", "save_to"):
        with pytest.raises(
            ParameterError, match=rf"^{parameter}: .*(plain name|outside the folder)"
        ):
            parameters.update({"ground": False, parameter: name})
    assert parameters.current == LocalizerParams(save_to=str(folder / "landmarks.yaml"))


def test_a_file_that_nobody_named_is_in_the_folder(folder: Path):
    parameters = Parameters(LocalizerParams(map="hall.yaml"))
    assert parameters.current.save_to == str(folder / "landmarks.yaml")
    assert parameters.current.map == "hall.yaml"  # whoever starts it may name any file
    assert parameters.update({"save_to": "landmarks.yaml"}) == parameters.current


def test_what_was_named_at_the_start_may_be_named_again(folder: Path):
    parameters = Parameters(LocalizerParams(map="/maps/hall.yaml"))
    parameters.update({"map": "/maps/hall.yaml", "ground": False})  # as rqt sends all of them
    parameters.update({"map": "mine.yaml"})
    assert parameters.update({"map": "/maps/hall.yaml"}).map == "/maps/hall.yaml"


def test_a_camera_is_no_way_to_read_files(folder: Path):
    parameters = Parameters(CameraParams())
    for uri in ("/dev/video1", "2", "test", "rtsp://192.168.1.10/stream"):
        assert parameters.update({"uri": uri}).uri == uri
    for uri in ("lavfi:movie=/home/secret.mp4", "file:///x.mp4", "/dev/../x", "lavfi://movie=/x"):
        with pytest.raises(ParameterError):
            parameters.update({"uri": uri})


def test_a_mission_has_a_name_or_is_a_file(folder: Path):
    [quadrotor] = [one for one in find_all() if one.name == "quadrotor"]
    parameters = Parameters(quadrotor.params())
    assert parameters.update({"mission": "square"}).mission == "square"
    assert parameters.update({"mission": "my.yaml"}).mission == str(folder / "my.yaml")
    with pytest.raises(ParameterError):
        parameters.update({"mission": "/etc/passwd"})


def test_a_file_of_others_is_not_replaced(folder: Path):
    (theirs := folder / "theirs.yaml").write_text("precious")
    with pytest.raises(OpenError, match="exists"):
        save_again(theirs, b"new")
    assert theirs.read_text() == "precious"
    set_folder(folder, overwrite=True)
    save_again(theirs, b"new")
    assert theirs.read_text() == "new"


def test_what_a_node_wrote_itself_is_replaced_until_somebody_changes_it(folder: Path):
    save_again(folder / "own.yaml", b"first")
    save_again(folder / "own.yaml", b"second")
    assert (folder / "own.yaml").read_text() == "second"
    (folder / "own.yaml").write_text("precious")
    with pytest.raises(OpenError, match="exists"):
        save_again(folder / "own.yaml", b"third")
    assert (folder / "own.yaml").read_text() == "precious"
