"""What may be recorded to, and what is said of what may not."""

from pathlib import Path

import pytest

from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import PARAMETER_EVENTS, open_recorder
from ros_visualise.sinks import mp4 as mp4_module
from ros_visualise.sinks.names import parse_target

IMAGE = TopicType("sensor_msgs/msg/Image")
TOPICS = {
    "/image_raw": IMAGE,
    "/camera_info": TopicType("sensor_msgs/msg/CameraInfo"),
    "/edges": IMAGE,
    "/edges_overlay": IMAGE,
}
ON_DEMAND = ("/edges_overlay",)


@pytest.mark.parametrize(
    ("target", "path", "topics"),
    [
        ("edges.mp4", "edges.mp4", ()),
        ("edges.mp4@/edges", "edges.mp4", ("/edges",)),
        ("a/run.mcap@/a,/b/c,/a", "a/run.mcap", ("/a", "/b/c")),
        ("me@home.mp4", "me@home.mp4", ()),
        ("me@home.mp4@/edges", "me@home.mp4", ("/edges",)),
    ],
)
def test_targets_are_parsed(target: str, path: str, topics: tuple[str, ...]) -> None:
    assert parse_target(target) == (Path(path), topics)


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("r.mcap", ("/image_raw", "/camera_info", "/edges", PARAMETER_EVENTS)),
        ("r.mcap@/edges_overlay,/edges", ("/edges_overlay", "/edges", PARAMETER_EVENTS)),
        ("r.mcap@/edges", ("/edges", PARAMETER_EVENTS)),
        ("r.bag@/edges", ("/edges",)),
        ("r", ("/image_raw", "/camera_info", "/edges", PARAMETER_EVENTS)),
        ("r/@/edges", ("/edges", PARAMETER_EVENTS)),
        ("r.mp4", ("/edges",)),
        ("r.MP4@/edges_overlay", ("/edges_overlay",)),
    ],
)
def test_topics_are_chosen(tmp_path: Path, target: str, expected: tuple[str, ...]) -> None:
    path, named = parse_target(f"{tmp_path}/{target}")
    with open_recorder(path, TOPICS, on_demand=ON_DEMAND, named=named) as recorder:
        assert recorder.topics == expected


@pytest.mark.parametrize(
    ("target", "expected"),
    [
        ("..", "not a valid name; give the name of a file or folder"),
        ("r.avi", r"r.avi: the name of a recording must end in .mcap, .bag, .mp4, .csv, .txt"),
        ("r.mp5", r"; did you mean .mp4\?"),
        (
            "r.bag@/nope",
            "no topic /nope; choose from /image_raw, /camera_info, /edges, /edges_over",
        ),
        (
            "r.mp4@/nope",
            "no topic /nope; choose from /image_raw, /camera_info, /edges, /edges_over",
        ),
        ("r.mp4@/edges,/image_raw", "can store only one image topic"),
        ("r.mp4@/camera_info", "can store only one image topic"),
    ],
)
def test_wrong_usage_is_refused(tmp_path: Path, target: str, expected: str) -> None:
    path, named = parse_target(f"{tmp_path}/{target}")
    with pytest.raises(UsageError, match=expected):
        open_recorder(path, TOPICS, named=named)
    assert not list(tmp_path.iterdir())


def test_a_video_needs_images(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no image topic"):
        open_recorder(
            f"{tmp_path}/r.mp4",
            {"/parameter_events": TopicType("rcl_interfaces/msg/ParameterEvent")},
        )


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".mp4"])
def test_targets_that_cannot_be_opened(tmp_path: Path, suffix: str) -> None:
    there = tmp_path / f"there{suffix}"
    there.write_text("precious")
    (folder := tmp_path / f"folder{suffix}").mkdir()
    refused = {
        there: rf"{there} exists; choose another name, or replace it with --overwrite",
        folder: "is a folder",
        tmp_path / "no" / f"r{suffix}": rf"no such folder: {tmp_path / 'no'}; create it first",
        there / f"r{suffix}": "cannot be written: Not a directory",
    }
    for path, expected in refused.items():
        with pytest.raises(OpenError, match=expected) as error:
            open_recorder(str(path), TOPICS)
        assert "\n" not in str(error.value)
    assert there.read_text() == "precious"


@pytest.mark.parametrize("suffix", [".mcap", ".bag", ".mp4"])
def test_a_folder_is_never_overwritten(tmp_path: Path, suffix: str) -> None:
    (folder := tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(OpenError, match="is a folder"):
        open_recorder(str(folder), TOPICS, overwrite=True)


def test_a_missing_encoder_is_said_before_a_file_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (there := tmp_path / "r.mp4").write_text("precious")
    monkeypatch.setattr(mp4_module, "_ENCODER", "libnone264")
    with pytest.raises(OpenError, match=r"without libnone264; record to \.mcap"):
        open_recorder(str(there), TOPICS, overwrite=True)
    assert there.read_text() == "precious"


def test_a_ros2_folder_is_replaced_only_if_it_is_one(tmp_path: Path) -> None:
    open_recorder(f"{tmp_path}/r", TOPICS).close()
    with pytest.raises(OpenError, match="exists; choose another name"):
        open_recorder(f"{tmp_path}/r", TOPICS)
    open_recorder(f"{tmp_path}/r", TOPICS, overwrite=True).close()
    (tmp_path / "r" / "thesis.tex").write_text("precious")
    with pytest.raises(OpenError, match="holds more than a ROS 2 bag"):
        open_recorder(f"{tmp_path}/r", TOPICS, overwrite=True)
    assert {p.name for p in (tmp_path / "r").iterdir()} == {
        "metadata.yaml",
        "r_0.mcap",
        "thesis.tex",
    }


@pytest.mark.parametrize(
    ("target", "options", "expected"),
    [
        (
            "r.bag",
            {"compression": "zstd"},
            "unsupported compression zstd; supported: none, lz4, bz2",
        ),
        (
            "r.mcap",
            {"compression": "bz2"},
            "unsupported compression bz2; supported: auto, lz4, none, zstd",
        ),
        ("r.mp4", {"compression": "lz4"}, "unsupported compression lz4; no compression"),
        ("r.bag", {"profile": "ros2"}, "can only store messages of ROS 1"),
        ("r", {"profile": "ros1"}, "can only store messages of ROS 2"),
    ],
)
def test_what_a_kind_of_file_cannot_hold(
    tmp_path: Path, target: str, options: dict[str, str], expected: str
) -> None:
    with pytest.raises(UsageError, match=expected):
        open_recorder(f"{tmp_path}/{target}", TOPICS, **options)
    assert not list(tmp_path.iterdir())
