"""A short fuzz, and that it finds what is wrong."""

import os
import random
import subprocess
import sys
from pathlib import Path

import made_mcaps
import pytest

from fuzz import trial
from fuzz.mutants import damage

TESTS = Path(__file__).parents[1]


def fuzz(*arguments):
    paths = [str(TESTS), str(TESTS / "sources" / "recordings")]
    return subprocess.run(
        [sys.executable, "-m", "fuzz", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=100,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )


def test_a_hundred_mutants_do_no_harm(tmp_path):
    done = fuzz("--seed", 11, "--count", 100, "--made", "--keep", tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "100 mutants, 0 failures" in done.stdout


def test_the_same_seed_makes_the_same_damage():
    data = bytes(range(256)) * 40
    made = [damage(data, random.Random(f"7 {number}")) for number in range(50)]
    assert made == [damage(data, random.Random(f"7 {number}")) for number in range(50)]
    assert len({one for one in made if one != data}) > 40


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("raise ValueError", "exit status -1"),
        ("raise SystemExit(3)", "exit status 3"),
        ("return 1", "1 without a word"),
        ("return 2", "2 without a word"),
        ("print('\\x1b[2J')\n    return 0", "control characters"),
    ],
)
def test_what_no_command_may_do_is_found(monkeypatch, given, said):
    room = {}
    exec(f"def main(line):\n    {given}", room)
    monkeypatch.setattr(trial, "main", room["main"])
    faults = trial.run("info", "x").faults
    assert said in "".join(faults)


def test_messages_that_are_left_out_without_a_word_are_found(monkeypatch, tmp_path):
    path = tmp_path / "a.mcap"
    made_mcaps.write_mcap(path, made_mcaps.numbered(range(1, 21)))
    assert trial.examine(path, "mcap", tmp_path) == []
    monkeypatch.setattr(trial, "count", lambda *_: 21)
    assert "info: 20 of 21 messages, without a word" in trial.examine(path, "mcap", tmp_path)
