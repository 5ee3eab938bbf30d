"""What the command line answers where it was not asked rightly, and what shells learn from it."""

import json
import os
import subprocess
import sys
from argparse import ArgumentParser
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import cv2
import numpy as np
import pytest
from made_videos import numbered, write_video

from ros_visualise.commands import COMMANDS, main
from ros_visualise.running.arguments import add_arguments, argument, option

PROGRAM = Path(sys.executable).with_name("ros-visualise")


def answer_to(capsys, *words):
    try:
        status = main([*map(str, words)])
    except SystemExit as end:
        status = end.code
    said = capsys.readouterr()
    return status, said.out, said.err


def test_without_a_command_it_shows_help(capsys):
    status, out, err = answer_to(capsys)
    assert (status, err) == (0, "")
    assert "ros-visualise video flight.mp4" in out


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["vido", "x.mp4"], "COMMAND: invalid choice 'vido'; did you mean video?"),
        (["--port", "8080"], "give a command, file, folder, device or URL before --port"),
        (["demo", "--vew", "none"], "no option --vew; did you mean --view?"),
        (["demo", "--view", "wb"], "--view: invalid choice 'wb'; did you mean web?"),
        (["demo", "huski"], "scene: invalid choice 'huski'; did you mean husky?"),
        (["sim", "huskey"], "no robot 'huskey'; did you mean husky?"),
        (["demo", "landscape", "--set", "filter.gray=1"], "no node 'filter'; did you mean"),
        (
            ["demo", "landscape", "--set", "filters.grey=1"],
            "no parameter 'grey'; did you mean gray",
        ),
        (["demo", "landscape", "--node", "edge_detecter"], "no node 'edge_detecter'; did you mean"),
        (["demo", "landscape", "--preset", "stron"], "no preset 'stron'; did you mean strong?"),
    ],
)
def test_it_says_what_was_probably_meant(capsys, words, meant):
    status, out, err = answer_to(capsys, *words, *(["--view", "none"] if len(words) > 3 else []))
    assert (status, out) == (2, "")
    assert meant in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("name", COMMANDS.builtin)
def test_what_runs_a_command_is_found(name):
    module, _, function = str(COMMANDS.find(name).run).partition(":")
    assert module.startswith("<function") or callable(getattr(import_module(module), function))


@dataclass(frozen=True, kw_only=True)
class Shared:
    GROUP = "shared"

    loud: bool | None = option(None, "speak up")
    name: Sequence[str] = option([], "a name; repeatable", flag="--called")


@dataclass(frozen=True, kw_only=True)
class Options(Shared):
    source: Path = argument("the file")
    times: int = option(1, "how often")
    share: float | None = option(None, "how much")
    colors: bool = option(True, "without colours")
    quick: bool = option(False, "hurry")
    hidden: str = "no argument"


def read(*words):
    parser = ArgumentParser()
    add_arguments(parser, Options)
    return Options(**vars(parser.parse_args(words)))


def test_arguments_are_the_fields_of_options():
    assert read("a.txt") == Options(source=Path("a.txt"))
    words = "a.txt --times 2 --share .5 --no-colors --quick --no-loud --called x --called y"
    assert read(*words.split()) == Options(
        source=Path("a.txt"),
        times=2,
        share=0.5,
        colors=False,
        quick=True,
        loud=False,
        name=["x", "y"],
    )
    assert read("a.txt") == Options(source=Path("a.txt"))  # lists are not shared


def test_a_group_of_options_has_its_heading():
    parser = ArgumentParser()
    add_arguments(parser, Options)
    own, shared = parser.format_help().split("shared:")
    assert "--times" in own
    assert "--called" not in own.partition("options:")[2]
    assert "--loud, --no-loud" in shared


def test_of_a_file_it_tells_the_one_that_is_there(capsys, tmp_path):
    (tmp_path / "flight.mp4").write_bytes(b"")
    status, _, err = answer_to(capsys, "video", tmp_path / "flight.avi", "--view", "none")
    assert status == 2
    assert err.endswith("flight.avi: no such file; did you mean flight.mp4?\n")


PLAYED = ["--view", "none", "--rate", "0", "--json"]


def test_a_thing_is_shown_without_the_name_of_a_command(capsys, tmp_path):
    film = tmp_path / "film.mkv"
    write_video(film, numbered(4))
    assert (
        main(["video", str(film), *PLAYED[:4], "--record", str(tmp_path / "a.bag@/image_raw")]) == 0
    )
    (tmp_path / "pictures").mkdir()
    cv2.imwrite(str(tmp_path / "pictures" / "1.png"), np.zeros((9, 9), np.uint8))
    for name, messages in (("film.mkv", 4), ("a.bag", 4), ("pictures", 1)):
        capsys.readouterr()
        status, out, _ = answer_to(capsys, tmp_path / name, *PLAYED)
        assert status == 0
        assert json.loads(out)["topics"]["/image_raw"]["messages"] == messages
    (tmp_path / "log.txt").write_text("x")
    for thing, answer in (
        (tmp_path / "log.txt", "not a video that FFmpeg can read"),
        (tmp_path / "none.bag", "no such file; give a file, a folder, a URL or a command"),
        ("rtsp://127.0.0.1:1/x", "--rate, --loop and --start do not apply to a live camera"),
    ):
        status, _, err = answer_to(capsys, thing, *PLAYED)
        assert (status, err.count("\n")) == (2, 1)
        assert answer in err
    status, _, err = answer_to(capsys, "/dev/video77", "--view", "none")
    assert (status, err.count("\n")) == (2, 1)
    assert "no such device /dev/video77; devices: " in err


def completions(line):
    """What argcomplete offers at the end of a line, asked as bash does."""
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line}
    asked |= {"COMP_POINT": str(len(line)), "_ARGCOMPLETE_STDOUT_FILENAME": "/dev/stdout"}
    done = subprocess.run([PROGRAM], env={**os.environ, **asked}, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    return [word.strip() for word in done.stdout.replace("\v", "\n").split("\n") if word.strip()]


def test_shells_complete():
    assert completions("ros-visualise vid") == ["video"]
    assert completions("ros-visualise demo --prese") == ["--preset"]
    assert set(completions("ros-visualise demo --view ")) == {"web", "windows", "none"}
    assert {"seed", "soft"} <= set(completions("ros-visualise demo --preset s"))


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_each_shell_gets_what_it_needs(capsys, shell):
    status, out, _ = answer_to(capsys, "completion", shell)
    assert status == 0
    assert "ros-visualise" in out
    assert "_ARGCOMPLETE" in out
