"""Values that no command can use are refused by one line, whatever they are."""

from collections.abc import Callable
from pathlib import Path

import pytest
from made_videos import numbered, write_video

from ros_visualise.commands import main

Refused = Callable[..., str]
LONG = "x" * 5000
PLAY = ["--view", "none", "--rate", "0"]


@pytest.fixture
def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Refused:
    """Runs a command in an empty folder; the line with which it is refused."""

    def refuse(*arguments: object) -> str:
        try:
            status = main([str(one) for one in arguments])
        except SystemExit as end:
            status = end.code
        found = capsys.readouterr()
        assert (status, found.out) == (2, "")
        (line,) = found.err.splitlines()
        return line

    return refuse


@pytest.fixture
def video(tmp_path: Path) -> Path:
    return write_video(tmp_path / "v.mkv", numbered(5))


@pytest.mark.parametrize(
    "command",
    [
        ["info", LONG],
        ["convert", LONG, "o.mcap"],
        ["trajectory", LONG, "o.tum"],
        ["video", LONG, *PLAY],
        ["camera", LONG, *PLAY[:2]],
        ["bag", LONG, *PLAY],
        ["kitti", LONG, *PLAY],
        ["demo", LONG],
        [LONG],
    ],
    ids=lambda command: command[0][:10],
)
def test_a_name_that_is_too_long(refused: Refused, command: list[str]) -> None:
    assert LONG in refused(*command)


def test_a_node_in_a_file_whose_name_is_too_long(refused: Refused, video: Path) -> None:
    assert "no such file" in refused("video", video, *PLAY, "--node", f"{LONG}.py:node")


@pytest.mark.parametrize("option", ["--start", "--duration"])
def test_times_beyond_all_stamps(refused: Refused, video: Path, option: str) -> None:
    for command in (["video", video, *PLAY], ["bag", video], ["convert", video, "o.mcap"]):
        for value in ("1e300", "1e10"):
            line = refused(*command, option, value)
            assert f"argument {option}: '{value}' is not a number" in line
            assert "1e+09" in line


def test_a_playlist_is_no_video(refused: Refused, video: Path, tmp_path: Path) -> None:
    before = video.read_bytes()
    (tmp_path / "l.ffconcat").write_text("ffconcat version 1.0\nfile v.mkv\n")
    (tmp_path / "l.m3u8").write_text(
        "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\nv.mkv\n#EXT-X-ENDLIST\n"
    )
    for name in ("l.ffconcat", "l.m3u8"):
        for command in (
            ["video", tmp_path / name, *PLAY, "--record", tmp_path / "v.mp4"],
            ["convert", tmp_path / name, tmp_path / "o.mcap"],
            ["info", tmp_path / name],
        ):
            line = refused(*command)
            assert f"{name}: a playlist, which only names videos; give one of them" in line
    assert video.read_bytes() == before
    assert {path.name for path in tmp_path.iterdir()} == {"v.mkv", "l.ffconcat", "l.m3u8"}


@pytest.mark.parametrize("scheme", ["file://", "concatf://"])
def test_a_camera_reads_no_file(refused: Refused, video: Path, scheme: str) -> None:
    listed = video.with_name("list")
    listed.write_text(f"file:{video}")
    line = refused(
        "camera", f"{scheme}{listed if 'concat' in scheme else video}", *PLAY[:2], "--frames", 2
    )
    assert line.startswith(f"ros-visualise: {scheme}")


@pytest.mark.parametrize("host", ["..", "a" * 300, "a..b"])
def test_a_host_that_cannot_be_a_name(refused: Refused, video: Path, host: str) -> None:
    line = refused("video", video, "--host", host, "--port", "8765")
    assert f"--host {host}: not an address of this machine" in line


def test_a_folder_to_record_to_without_a_name(refused: Refused, video: Path) -> None:
    line = refused("video", video, *PLAY, "--record-dir", "")
    assert "--record-dir: give the name of a folder" in line
