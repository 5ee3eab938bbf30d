"""``dataset`` writes what the readers of COCO, YOLO and LeRobot understand."""

import json
import subprocess

import av
import cv2
import duckdb
import forked
import numpy as np
import pytest
from made_flights import FINDER, batch, camera_drive, command
from made_videos import numbered, write_video
from pycocotools.coco import COCO
from ruamel.yaml import YAML


def dataset(*arguments: object) -> subprocess.CompletedProcess[str]:
    return forked.run(command("dataset", *arguments), timeout=60)


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    """Detections in four recordings of different lengths."""
    folder = tmp_path_factory.mktemp("detected")
    (folder / "finder.py").write_text(FINDER)
    (folder / "in").mkdir()
    for count in (3, 4, 5, 6):
        write_video(folder / "in" / f"film {count}.mkv", numbered(count))
    node = ("--node", f"{folder}/finder.py:finder", "--pipeline", "none")
    done = batch(folder / "in", "--out", folder / "out", *node, "--workers", 1)
    assert done.returncode == 0, done.stderr
    return folder / "out"


def test_coco(results, tmp_path):
    done = dataset(results, tmp_path / "coco")
    assert done.returncode == 0, done.stderr
    assert "18 images" in done.stdout
    files = {
        split: tmp_path / "coco/annotations" / f"instances_{split}.json"
        for split in ("train", "val")
    }
    read = {split: COCO(str(path)) for split, path in files.items()}
    recordings = {
        split: {image["recording"] for image in coco.imgs.values()} for split, coco in read.items()
    }
    assert not recordings["train"] & recordings["val"]
    assert sorted(map(len, recordings.values())) == [1, 3]
    assert sum(len(coco.anns) for coco in read.values()) == 36
    coco = read["train"]
    assert [one["name"] for one in coco.loadCats(coco.getCatIds())] == ["corner", "ground"]
    image = next(iter(coco.imgs.values()))
    pixels = cv2.imread(str(tmp_path / "coco" / image["file_name"]))
    assert pixels.shape == (24, 32, 3)
    boxes = [one["bbox"] for one in coco.loadAnns(coco.getAnnIds([image["id"]]))]
    assert boxes == [[0, 0, 16, 12], [16, 12, 16, 12]]
    corner = pixels[2:10, 2:14].mean(axis=(0, 1))
    number = round(image["t_ns"] / 40_000_000)
    assert corner == pytest.approx([250, 20, 5 * number], abs=12)
    assert json.loads(read["val"].dataset["info"]["work"])["pipeline"] == "none"
    again = dataset(results, tmp_path / "coco")
    assert (again.returncode, len(again.stderr.splitlines())) == (2, 1)


def test_yolo(results, tmp_path):
    folder = tmp_path / "yolo"
    assert dataset(results, folder, "--format", "yolo", "--every", 2).returncode == 0
    data = YAML(typ="safe").load(folder / "data.yaml")
    assert data["names"] == {0: "corner", 1: "ground"}
    pictures = sorted((folder / data["train"]).iterdir()) + sorted((folder / data["val"]).iterdir())
    assert len(pictures) == 2 + 2 + 3 + 3
    for picture in pictures:
        labels = folder / "labels" / picture.parent.name / picture.with_suffix(".txt").name
        rows = np.loadtxt(labels)
        assert rows.tolist() == [[0, 0.25, 0.25, 0.5, 0.5], [1, 0.75, 0.75, 0.5, 0.5]]


def test_yolo_has_both_splits_also_when_one_is_empty(results, tmp_path):
    folder = tmp_path / "yolo"
    done = dataset(results, folder, "--format", "yolo", "--every", 2, "--validation", 0)
    assert done.returncode == 0
    assert "all images are in one split, train" in done.stderr
    data = YAML(typ="safe").load(folder / "data.yaml")
    assert data["train"] == data["val"] == "images/train", "else Ultralytics refuses it"


def test_lerobot(tmp_path):
    for number in range(3):
        drive = tmp_path / "in" / f"drive_{number}.mcap"
        camera_drive(drive, 20 + number, 10 * number, size=(63, 47))
    out, made = tmp_path / "out", tmp_path / "lerobot"
    options = ("--pipeline", "none", "--fields", "/cmd_vel.*", "--workers", 1)
    assert batch(tmp_path / "in", "--out", out, *options).returncode == 0
    done = dataset(out, made, "--format", "lerobot", "--action", "/cmd_vel")
    assert done.returncode == 0, done.stderr
    info = json.loads((made / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["total_episodes"]) == ("v3.0", 10, 3)
    assert info["splits"] == {"train": "0:2", "val": "2:3"}
    assert info["features"]["action"]["shape"] == [6]
    episodes = duckdb.sql(f"FROM '{made}/meta/episodes/*/*.parquet' ORDER BY episode_index")
    tasks = made / "meta/tasks.parquet"
    known = duckdb.sql(f"SELECT value FROM parquet_kv_metadata('{tasks}') WHERE key = 'pandas'")
    [index] = json.loads(known.fetchall()[0][0])["index_columns"]
    assert duckdb.sql(f"SELECT {index} FROM '{tasks}'").fetchall() == [("drive",)]
    assert {str(kind) for kind in episodes.types} == {"BIGINT", "DOUBLE", "VARCHAR", "VARCHAR[]"}
    rows = [dict(zip(episodes.columns, row, strict=True)) for row in episodes.fetchall()]
    assert [one["dataset_to_index"] for one in rows] == np.cumsum(
        [one["length"] for one in rows]
    ).tolist()
    for one in rows:
        place = {name: one[f"data/{name}"] for name in ("chunk_index", "file_index")}
        frames = duckdb.sql(f"FROM '{made / info['data_path'].format(**place)}'").fetchnumpy()
        assert len(frames["timestamp"]) == one["length"]
        assert frames["timestamp"] == pytest.approx(frames["frame_index"] / 10)
        state, action = np.stack(frames["observation.state"]), np.stack(frames["action"])
        assert state[:, 0] == pytest.approx(frames["frame_index"] / 10)
        speed = info["features"]["action"]["names"].index("linear.x")
        assert action[:, speed] == pytest.approx(frames["frame_index"] // 2)
        key = "observation.images.camera"
        video = made / info["video_path"].format(video_key=key, **place)
        with av.open(str(video)) as film:
            decoded = list(film.decode(video=0))
        assert [frame.time for frame in decoded] == pytest.approx(frames["timestamp"].tolist())
        assert [*decoded[0].to_ndarray(format="bgr24").shape] == info["features"][key]["shape"]
    stats = json.loads((made / "meta/stats.json").read_text())
    assert stats["action"]["min"][speed] == 0
    assert np.shape(stats[key]["mean"]) == (3, 1, 1), "else LeRobot cannot train"
    mean = np.mean([frame.to_ndarray(format="rgb24") for frame in decoded], axis=(0, 1, 2)) / 255
    assert np.ravel(stats[key]["mean"]) == pytest.approx(mean, abs=0.1)


@pytest.mark.parametrize("format", ["coco", "yolo", "lerobot"])
def test_results_without_its_rows_are_one_line(once, tmp_path, format):
    done = dataset(once / "out", tmp_path / "made", "--format", format)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert not list(tmp_path.glob("made*"))
