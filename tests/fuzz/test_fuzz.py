"""A short fuzz, and that it finds what is wrong."""

import logging
import os
import random
import subprocess
import sys
from pathlib import Path

import made_mcaps
import pytest

from fuzz import page, trial
from fuzz.drops import drop
from fuzz.mutants import damage

TESTS = Path(__file__).parents[1]


def fuzz(*arguments):
    paths = [str(TESTS), str(TESTS / "sources" / "recordings")]
    return subprocess.run(
        [sys.executable, "-m", "fuzz", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=600,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
    )


@pytest.mark.timeout(600)
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


def test_a_record_that_is_gone_without_a_word_is_found(monkeypatch, tmp_path):
    whole, path = tmp_path / "whole.mcap", tmp_path / "a.mcap"
    made_mcaps.write_mcap(whole, made_mcaps.numbered(range(1, 21)))
    made_mcaps.write_mcap(path, made_mcaps.numbered(range(1, 20)))
    faults = trial.examine(path, "mcap", tmp_path, whole)
    assert "info: 19 of 20 messages, without a word" in faults
    assert "bag: 19 of 20 messages, without a word" in faults


@pytest.mark.parametrize("suffix", [".mcap", ".txt"])
def test_of_a_dropped_record_nothing_else_is_changed(tmp_path, suffix):
    whole, lacks = tmp_path / f"a{suffix}", tmp_path / f"b{suffix}"
    whole.write_text("one\ntwo\nthree\n")
    if suffix == ".mcap":
        made_mcaps.write_mcap(whole, made_mcaps.numbered(range(1, 21)))
    data = whole.read_bytes()
    for number in range(20):
        assert drop(whole, lacks, random.Random(number))
        left = lacks.read_bytes()
        cut = len(data) - len(left)
        assert cut > 0
        assert any(data[:at] + data[at + cut :] == left for at in range(len(left) + 1))


def test_what_breaks_in_the_page_is_found(tmp_path):
    [question] = [one for one in page.whole_messages(tmp_path) if one.name == "0.question"]
    assert page.send(question) == []
    try:
        raise ValueError("broken")
    except ValueError:
        logging.getLogger("anything").exception("of the page")
    assert page.send(question) == ["of the page: ValueError('broken')"]
