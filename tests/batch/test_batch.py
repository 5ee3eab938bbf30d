"""``batch`` runs many recordings, each in a process of its own, and survives all that they do."""

import json
import os
import random
import shutil
import signal
import subprocess
import time
from contextlib import closing

import forked
import pytest
from made_flights import ask, batch, command, decoding_threads, drive, environment, films, rows
from made_videos import numbered, write_video

from ros_visualise.batch.apart import Limits, apart
from ros_visualise.batch.inputs import FoundInput, content_of, find_inputs
from ros_visualise.batch.plan import plan
from ros_visualise.batch.results import Results
from ros_visualise.batch.tables import LISTED, TABLES
from ros_visualise.batch.work import Work
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.landmarks.networks.session import Provider
from ros_visualise.sources import open_source

ROWS = ("topics", "poses", "fields", "image_stats", "segments")

BAD_NODE = """
import os, signal, time
import numpy as np
from pathlib import Path
from ros_visualise.data import Image, Number
from ros_visualise.nodes import node

@node("bad", inputs={"image": Image}, outputs={"number": Number})
def bad(image, params):
    "Hangs, crashes, eats memory or fails, by the width of the image."
    if image.width == 40:
        time.sleep(1000)
    if image.width == 48:
        os.kill(os.getpid(), signal.SIGKILL)
    if image.width == 56:
        held = np.ones(50 << 20)
        time.sleep(len(held) / 1e5)
    if image.width == 64:
        raise ValueError("too wide")
    flag = Path(__file__).with_name("flag")
    if image.width == 72 and not flag.exists():
        flag.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return Number(float(image.width), image.header)
"""


@pytest.fixture
def bad_node(tmp_path):
    node = tmp_path / "bad.py"
    node.write_text(BAD_NODE)
    return node


def test_what_fails_is_a_row_and_stops_nothing_else(tmp_path, bad_node):
    folder, out = tmp_path / "flights", tmp_path / "out"
    folder.mkdir()
    for width in (32, 48, 56, 64, 72):
        write_video(folder / f"{width}.mkv", numbered(3, width, 24))
    (folder / "empty.mcap").touch()
    (folder / "noise.mp4").write_bytes(bytes(range(256)) * 20)
    (folder / "notes.txt").write_text("no recording")
    with open(folder / "huge.bag", "wb") as file:
        file.truncate(1 << 33)
    os.mkfifo(folder / "pipe.bag")
    limit = ("--max-memory", "400M", "--workers", 2)
    done = batch(folder, "--out", out, "--node", f"{bad_node}:bad@streamer", "--json", *limit)
    assert done.returncode == 1, done.stderr
    report = json.loads(done.stdout)
    assert (report["tasks"], report["done"], report["left"]) == (9, 3, 0)
    assert "3 done (1 with errors), 0 left, 6 failed" in batch("status", out).stdout
    query = "SELECT recording, kind, attempts FROM '{}/failures.parquet'"
    assert set(ask(out, query)) == {
        ("48.mkv", "crash", 3),
        ("56.mkv", "memory", 3),
        ("64.mkv", "node", 1),
        ("empty.mcap", "open", 1),
        ("noise.mp4", "open", 1),
        ("huge.bag", "open", 1),
        ("pipe.bag", "open", 1),
    }
    counted = "SELECT recording, count(*) FROM '{}/fields.parquet' GROUP BY ALL"
    assert dict(ask(out, counted)) == {"32.mkv": 3, "72.mkv": 3}
    reason = "SELECT reason FROM '{}/failures.parquet' WHERE kind = 'node'"
    assert "too wide" in ask(out, reason)[0][0]
    assert not list((out / "tasks").glob("*.part"))

    bad_node.write_text(BAD_NODE.replace("signal.SIGKILL", "0").replace("50 << 20", "1"))
    again = batch("retry", out, "--json", *limit)
    assert {one["recording"] for one in json.loads(again.stdout)["failures"]} == {
        *("64.mkv", "empty.mcap", "noise.mp4", "huge.bag", "pipe.bag")
    }


def test_what_hangs_is_a_row(tmp_path, bad_node):
    film = write_video(tmp_path / "40.mkv", numbered(3, 40, 24))
    options = ("--node", f"{bad_node}:bad@streamer", "--timeout", 0.5)
    assert batch(film, "--out", tmp_path / "out", *options).returncode == 1
    query = "SELECT recording, kind, attempts, reason FROM '{}/failures.parquet'"
    assert ask(tmp_path / "out", query) == [
        ("40.mkv", "timeout", 3, "not finished after 0.5 s; raise --timeout")
    ]


def test_killed_at_any_moment_and_begun_again_it_has_the_same_rows(once, tmp_path):
    chance = random.Random(os.environ.get("PYTEST_SEED", "batch"))
    out = tmp_path / "out"
    arguments = (once / "in", "--out", out, "--fields", "/odom.twist.*", "--workers", 2)
    for done in sorted(chance.sample(range(10), 3)):
        driver = forked.Forked(
            command("batch", *arguments),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env=environment(),
        )
        tasks = out / "tasks"
        while driver.poll() is None and len(list(tasks.glob("*"))) <= done:
            time.sleep(0.002)
        driver.kill()
        driver.wait()
    done = batch(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    for table in ROWS:
        assert rows(out, table) == rows(once / "out", table), table
    again = json.loads(batch(*arguments, "--json").stdout)
    assert (again["run"], again["done"]) == (0, 10)


def test_rows_are_those_of_a_single_run(once, tmp_path):
    source = once / "in" / "drive_2.mcap"
    single = tmp_path / "single.mcap"
    forked.run(command("bag", source, "--view", "none", "--rate", 0, "--record", f"{single}@/odom"))
    with closing(open_source(single)) as recording:
        expected = [
            (one.message.header.stamp_ns, *one.message.content.position_xyz.tolist())
            for one in recording.read(topics=["/odom"])
        ]
    query = "SELECT t_ns, x, y, z FROM '{}/poses.parquet' WHERE recording = 'drive_2.mcap'"
    assert ask(once / "out", query) == expected
    far = (
        "SELECT distance_m, duration_s FROM '{}/recordings.parquet' WHERE path LIKE '%drive_2.mcap'"
    )
    assert ask(once / "out", far)[0] == pytest.approx((4.0, 4.1), abs=0.01)


def test_content_decides_what_is_done(once, tmp_path):
    shutil.copytree(once / "in", tmp_path / "in")
    shutil.copytree(once / "out", tmp_path / "out")
    arguments = (tmp_path / "in", "--out", tmp_path / "out", "--fields", "/odom.twist.*", "--json")
    renamed = os.fsdecode(os.fsencode(tmp_path) + b"/in/renamed_\xfc.mkv")
    (tmp_path / "in" / "film_00.mkv").rename(renamed)
    shutil.copy(tmp_path / "in" / "film_01.mkv", tmp_path / "in" / "twice.mkv")
    drive(tmp_path / "in" / "new.mcap", 20)
    done = batch(*arguments)
    report = json.loads(done.stdout)
    assert (report["run"], report["tasks"], report["done"]) == (1, 12, 12)
    assert "10 of 11 tasks already done" in done.stderr, "a copy has none of its own"
    names = {
        name for (name,) in ask(tmp_path / "out", "SELECT recording FROM '{}/recordings.parquet'")
    }
    assert {"renamed_\\udcfc.mkv", "twice.mkv", "new.mcap"} <= names
    assert "film_00.mkv" not in names
    assert rows(tmp_path / "out", "image_stats")
    report = json.loads(batch(*arguments, "--set", "path.rate=1").stdout)
    assert report["run"] == 11, "another parameter, for all but the copy"


def test_segments_have_the_rows_of_the_whole(tmp_path):
    write_video(tmp_path / "long.mkv", numbered(40) * 3)
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    assert batch(tmp_path / "long.mkv", "--out", whole).returncode == 0
    split = batch(
        tmp_path / "long.mkv", "--out", parts, "--segment", "1s", "--overlap", "0.5s", "--json"
    )
    assert json.loads(split.stdout)["tasks"] == 5, split.stderr
    assert rows(parts, "image_stats") == rows(whole, "image_stats")
    assert len(rows(whole, "image_stats")) == 4 * 120
    drive(tmp_path / "drive.mcap", 60)
    kept = batch(tmp_path / "drive.mcap", "--out", parts, "--segment", "1s", "--json")
    assert json.loads(kept.stdout)["tasks"] == 1
    assert "not split, because the whole recording is needed by path" in kept.stderr


def test_damaged_films_are_decoded_in_one_thread_so_that_rows_stay_the_same(once):
    film = once / "in" / "film_00.mkv"
    assert apart(decoding_threads, film, Limits(60, 1 << 30)) == 1


def test_tables_are_described_with_units(once):
    readme = (once / "out" / "README.md").read_text()
    for table, columns in {**TABLES, **LISTED}.items():
        assert f"## {table}:" in readme
        query = f"SELECT value FROM parquet_kv_metadata('{{}}/{table}.parquet') WHERE key = 'units'"
        units = json.loads(ask(once / "out", query)[0][0])
        assert units == {**units, **{one.name: one.unit for one in columns if one.unit}}


def test_recordings_and_pictures_are_kept(tmp_path):
    write_video(tmp_path / "film.mkv", numbered(3))
    done = batch(tmp_path / "film.mkv", "--out", tmp_path / "out", "--record", "edges.mcap@/edges")
    assert done.returncode == 0, done.stderr
    edges = tmp_path / "out" / "files" / "film.mkv" / "edges.mcap"
    with closing(open_source(edges)) as recording:
        assert recording.topics["/edges"].messages == 3


def test_ctrl_c_goes_on_later(once, tmp_path):
    out = tmp_path / "out"
    driver = subprocess.Popen(
        command("batch", once / "in", "--out", out),
        stderr=subprocess.PIPE,
        text=True,
        env=environment(),
        start_new_session=True,
    )
    end_s = time.monotonic() + 60
    while not (out / "plan.jsonl").exists() and time.monotonic() < end_s:
        time.sleep(0.01)
    os.killpg(driver.pid, signal.SIGINT)
    _, said = driver.communicate(timeout=60)
    assert driver.returncode == 130, said
    status = json.loads(batch("status", out, "--json").stdout)
    assert status["failures"] == []
    assert status["done"] + status["left"] == 10


@pytest.mark.parametrize(
    "option",
    [
        ("--record", "a.xyz"),
        ("--record", "folder/a.mcap"),
        ("--record", "/a.mcap"),
        ("--record", "a.mcap", "--record", "a.mcap@/edges", "already in use"),
        ("--record", "pictures", "--export", "pictures"),
        ("--params", "missing.yaml"),
        ("--preset", "missing"),
        ("--set", "filters.thresold=1", "; did you mean threshold?"),
        ("--set", "filters.threshold=999", "must be from 0 to 255"),
        ("--set", "filter.threshold=1", "; did you mean filters?"),
        ("--set", "player.x=1", "no parameter 'x'"),
        ("--set", "threshold=1", "; did you mean filters.threshold?"),
        ("--set", "streamer.siz=8x8", "; did you mean size?"),
        ("--set", "landmark_navigator.mode=frozen", "--pipeline images: no node"),
        ("--node", "motion_detector@filter", "; did you mean filters?"),
    ],
    ids=" ".join,
)
def test_a_wrong_option_is_one_line_before_anything_starts(tmp_path, option):
    films(tmp_path, 1, images=1)
    hint = option[-1]
    done = batch(tmp_path, "--out", tmp_path / "out", *option[: len(option) // 2 * 2])
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert hint in done.stderr
    assert not (tmp_path / "out").exists()


def test_inputs_are_found(tmp_path):
    films(tmp_path / "a" / "b", 2)
    drive(tmp_path / "a" / "drive.mcap")
    drive(tmp_path / "a" / "folder")  # a ROS 2 bag
    (tmp_path / "a" / "kitti" / "drive_sync" / "oxts" / "data").mkdir(parents=True)
    (tmp_path / "a" / "kitti" / "drive_sync" / "oxts" / "data" / "0.bin").touch()
    (tmp_path / "a" / "notes.txt").write_text("x")
    (tmp_path / "a" / "b" / "film_00.srt").write_text("1\n")
    names = ["b/film_00.mkv", "b/film_01.mkv", "drive.mcap", "folder", "kitti/drive_sync"]
    assert [one.name for one in find_inputs([str(tmp_path / "a")])] == names
    assert [one.name for one in find_inputs([str(tmp_path / "a" / "**")])] == names
    (tmp_path / "list").write_text(f"# flights\n{tmp_path}/a/b\n\n{tmp_path}/a/drive.mcap\n")
    assert [one.name for one in find_inputs([f"@{tmp_path}/list"])] == names[:3]
    found = find_inputs([str(tmp_path / "a" / "folder")])[0]
    assert found.size > 0
    (tmp_path / "a" / "b" / "cover.png").touch()  # no recording, as films are beside it
    (tmp_path / "a" / "shots").mkdir()
    (tmp_path / "a" / "shots" / "1.jpg").touch()
    assert [one.name for one in find_inputs([str(tmp_path / "a")])] == [*names, "shots"]
    assert [one.name for one in find_inputs([str(tmp_path / "a" / "shots")])] == ["shots"]
    assert content_of(found.path) != content_of(str(tmp_path / "a" / "drive.mcap"))
    (tmp_path / "a" / "shots" / "back").symlink_to(tmp_path / "a")
    (tmp_path / "a" / "kitti" / "drive_link.mcap").symlink_to(tmp_path / "a" / "drive.mcap")
    assert [one.name for one in find_inputs([str(tmp_path / "a")])] == [*names, "shots"]
    matched = find_inputs([str(tmp_path / "a" / "**" / "*.mkv")])
    assert [one.name for one in matched] == ["film_00.mkv", "film_01.mkv"]
    with pytest.raises(OpenError, match="no such file"):
        find_inputs([str(tmp_path / "missing.bag")])
    with pytest.raises(UsageError, match="no recordings"):
        find_inputs([str(tmp_path / "a" / "*.bag")])


def test_the_time_to_find_recordings_grows_with_their_number(tmp_path):
    for number in range(3000):
        (tmp_path / f"{number}.mcap").touch()
    start_s = time.process_time()
    assert len(find_inputs([str(tmp_path)])) == 3000
    assert time.process_time() - start_s < 6  # it took 18 s when each was compared with all


def test_ten_thousand_tasks_are_planned_without_opening_them(tmp_path):
    results = Results(tmp_path)
    results.create()
    inputs = [FoundInput(f"{n}.bag", f"/nowhere/{n}.bag", 1) for n in range(10_000)]
    planned = plan(inputs, [str(n) for n in range(10_000)], Work())
    assert len({one.key for one in planned}) == 10_000
    results.write_plan({}, planned)
    assert results.read_plan() == ({}, planned)


@pytest.mark.parametrize("device", ["cpu", "cuda"])
@pytest.mark.parametrize("has_gpu", [False, True])
def test_networks_run_on_a_gpu_where_there_is_one(tmp_path, monkeypatch, device, has_gpu):
    monkeypatch.setattr(
        "ros_visualise.batch.work.is_available",
        lambda provider: provider is Provider.CPU or has_gpu,
    )
    film = write_video(tmp_path / "film.mkv", numbered(2))
    work = Work(node=("landmark_detector@streamer",), pipeline="none", device=device)
    chosen = work.graph(str(film)).node("landmark_detector").params.provider
    assert chosen is (Provider.CUDA if has_gpu and device == "cuda" else Provider.CPU)
