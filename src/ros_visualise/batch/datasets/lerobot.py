"""LeRobot v3: Parquet and MP4, an episode for each recording of a robot that was driven.

The state is the pose and velocity at an image, the action the velocity, or the numbers of the topic
of commands. Images are taken at an even rate: that of the slowest camera, a whole number.

Source: https://huggingface.co/docs/lerobot/lerobot-dataset-v3
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ros_visualise.batch.datasets import DatasetSource, SplitRecording, provenance, split_recordings
from ros_visualise.batch.pictures import images_at
from ros_visualise.batch.results import Results
from ros_visualise.batch.tables import RECORDED, quoted
from ros_visualise.core.errors import RosVisualiseError, UsageError
from ros_visualise.data import Header, Image
from ros_visualise.messages.recorded import TopicType
from ros_visualise.sinks import open_recorder

_STATE = ("x", "y", "z", "qx", "qy", "qz", "qw", "vx", "vy", "vz")
_CAMERA = "observation.images.camera"
_DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"
_CHUNK = 1000
_TASK = "drive"
_INDEX = "__index_level_0__"
_TASKS = {
    "index_columns": [_INDEX],
    "column_indexes": [],
    "columns": [
        {"name": "task_index", "pandas_type": "int64", "numpy_type": "int64", "metadata": None},
        {"name": None, "field_name": _INDEX, "pandas_type": "unicode", "numpy_type": "object"},
    ],
}
"""Metadata by which pandas takes the texts of tasks for the index, as LeRobot expects."""

_PERCENTILES = (1, 10, 50, 90, 99)
_SAMPLED = 10  # images of an episode, for the statistics of pixels
_SPARSE = 4  # of these, every n-th row and column

_Values = dict[str, Any]
Numbers = npt.NDArray[np.float64]


class _Film(NamedTuple):
    """Height and width of a film, and some of its pixels, RGB, (N, 3) uint8."""

    shape: tuple[int, int]
    pixels: npt.NDArray[np.uint8]


class _Episode:
    """A recording of a drive; after `sample`: stamps of images, and state and action at each."""

    def __init__(self, sql: Any, recording: SplitRecording, action: str) -> None:
        self.recording, self.topic = recording, _main_topic(sql, "image_stats", recording.name)
        self._images_ns = sql.execute(
            "SELECT DISTINCT t_ns FROM image_stats WHERE recording = ? AND topic = ? ORDER BY t_ns",
            [recording.name, self.topic],
        ).fetchnumpy()["t_ns"]
        self._poses = sql.execute(
            f"SELECT t_ns, {', '.join(_STATE)} FROM poses WHERE recording = ? AND topic = ?"
            " ORDER BY t_ns",
            [recording.name, _main_topic(sql, "poses", recording.name)],
        ).fetchnumpy()
        self._fields = sql.execute(
            "SELECT t_ns, field, value FROM fields WHERE recording = ? AND topic = ? ORDER BY t_ns",
            [recording.name, action],
        ).fetchnumpy()
        self.names = sorted(set(self._fields["field"].tolist())) if action else [*_STATE[7:]]

    @property
    def rate_hz(self) -> float:
        """Mean rate of the images; 0 if no images cover the poses of the robot."""
        images_ns, poses_ns = self._images_ns, self._poses["t_ns"]
        if len(images_ns) < 2 or max(images_ns[0], poses_ns[0]) >= min(images_ns[-1], poses_ns[-1]):
            return 0.0
        return float((len(images_ns) - 1) * 1e9 / (images_ns[-1] - images_ns[0]))

    def sample(self, fps: int, action: str) -> None:
        """Take images, poses and actions at an even rate: the last ones at each time."""
        images_ns, poses_ns = self._images_ns, self._poses["t_ns"]
        begin, end = max(images_ns[0], poses_ns[0]), min(images_ns[-1], poses_ns[-1])
        even = begin + np.arange(0, end - begin, 1e9 / fps).astype(np.int64)
        self.stamps_ns = images_ns[np.searchsorted(images_ns, even, side="right") - 1]
        at = np.searchsorted(poses_ns, even, side="right") - 1
        columns = [np.ma.filled(self._poses[one].astype(np.float64), 0.0) for one in _STATE]
        self.state = np.stack(columns, axis=1)[at]
        self.action = self.state[:, 7:]
        if action:
            self.action = np.stack([_at(self._fields, one, even) for one in self.names], axis=1)


def _main_topic(sql: Any, table: str, recording: str) -> str:
    """The topic of the source with most rows in a table."""
    found = sql.execute(
        f"SELECT topic FROM {table} WHERE recording = ? AND {RECORDED}"
        " GROUP BY topic ORDER BY count(*) DESC, topic LIMIT 1",
        [recording],
    ).fetchone()
    return str(found[0]) if found else ""


def _at(fields: Any, name: str, stamps_ns: npt.NDArray[np.int64]) -> Numbers:
    """The last value of a field at each time; 0 before the first."""
    own = fields["field"] == name
    times, values = fields["t_ns"][own], np.ma.filled(fields["value"][own].astype(np.float64), 0.0)
    at = np.searchsorted(times, stamps_ns, side="right") - 1
    return np.where(at >= 0, values[at], 0.0)


def write(source: DatasetSource, folder: Path) -> int:
    """Write a data set; the number of its images."""
    recordings = split_recordings(source, "poses")
    with closing(Results(source.results).open_tables()) as sql:
        found = [_Episode(sql, one, source.action) for one in recordings]
        episodes = [one for one in found if one.rate_hz]
        if not episodes:
            raise UsageError(
                f"{source.results}: no recording has images and poses at the same time"
            )
        names = episodes[0].names
        if not names or any(one.names != names for one in episodes):
            raise UsageError(
                f"{source.action}: fields missing from some recordings; add --fields"
                f" '{source.action}.*' to the batch"
            )
        fps = max(1, round(min(one.rate_hz for one in episodes)))
        for one in episodes:
            one.sample(fps, source.action)
        films = [_write_video(one, folder, number, fps) for number, one in enumerate(episodes)]
        if len({one.shape for one in films}) > 1:
            raise UsageError(
                f"{source.results}: images differ in size; choose recordings of equal image size"
            )
        pixels = np.concatenate([one.pixels for one in films])
        _write_data(sql, episodes, folder, fps)
        _write_meta(sql, episodes, folder, fps, _Film(films[0].shape, pixels), provenance(source))
    return sum(len(one.stamps_ns) for one in episodes)


def _place(number: int) -> dict[str, int]:
    return {"chunk_index": number // _CHUNK, "file_index": number % _CHUNK}


def _write_video(one: _Episode, folder: Path, number: int, fps: int) -> _Film:
    """Write the images of an episode."""
    path = folder / _VIDEO.format(video_key=_CAMERA, **_place(number))
    path.parent.mkdir(parents=True, exist_ok=True)
    topic, pixels = one.topic, []
    every = max(1, len(one.stamps_ns) // _SAMPLED)
    pictures = images_at(one.recording.path, set(one.stamps_ns.tolist()), [topic])
    with open_recorder(path, {topic: TopicType(Image.type_name)}) as recorder:
        found = next(pictures, None)
        for at, stamp_ns in enumerate(one.stamps_ns.tolist()):
            while found and found[0] < stamp_ns:
                found = next(pictures, None)
            if found is None or found[0] != stamp_ns:
                raise RosVisualiseError(
                    f"{one.recording.path}: changed since the batch; run the batch again"
                )
            time_ns = round(at * 1e9 / fps)
            recorder.write(topic, Image(found[1], "bgr8", Header(time_ns)), time_ns)
            shape = found[1].shape[:2]
            if at % every == 0:
                pixels.append(found[1][::_SPARSE, ::_SPARSE, ::-1].reshape(-1, 3))
    height, width = (length + length % 2 for length in shape)  # films have even ones
    return _Film((height, width), np.concatenate(pixels))


def _write_data(sql: Any, episodes: Sequence[_Episode], folder: Path, fps: int) -> None:
    first = 0
    for number, one in enumerate(episodes):
        count = len(one.stamps_ns)
        columns: dict[str, Any] = {
            "timestamp": np.arange(count) / fps,
            "frame_index": np.arange(count),
            "episode_index": np.full(count, number),
            "index": first + np.arange(count),
            "task_index": np.zeros(count, np.int64),
        }
        chosen = ["timestamp::FLOAT AS timestamp", *list(columns)[1:]]
        for name, values in (("observation.state", one.state), ("action", one.action)):
            parts = [f"{name}_{at}".replace(".", "_") for at in range(values.shape[1])]
            columns |= {part: values[:, at].copy() for at, part in enumerate(parts)}
            chosen.append(f'list_value({", ".join(parts)})::FLOAT[] AS "{name}"')
        sql.register("written", columns)
        _copy(
            sql, f"SELECT {', '.join(chosen)} FROM written", folder / _DATA.format(**_place(number))
        )
        first += count


def _copy(sql: Any, query: str, path: Path, pandas: str = "") -> None:
    """Write a table, with metadata for pandas."""
    path.parent.mkdir(parents=True, exist_ok=True)
    known = f", KV_METADATA {{pandas: {quoted(pandas)}}}" if pandas else ""
    sql.execute(f"COPY ({query}) TO {quoted(path)} (FORMAT parquet{known})")


def _write_meta(
    sql: Any, episodes: Sequence[_Episode], folder: Path, fps: int, film: _Film, made: _Values
) -> None:
    meta = folder / "meta"
    tasks = f"SELECT 0::BIGINT AS task_index, {quoted(_TASK)} AS {_INDEX}"
    _copy(sql, tasks, meta / "tasks.parquet", json.dumps(_TASKS))
    lines = " UNION ALL ".join(_lines(episodes, fps))
    _copy(sql, lines, meta / "episodes/chunk-000/file-000.parquet")
    info = _info(episodes, fps, film.shape) | {"provenance": made}
    (meta / "info.json").write_text(json.dumps(info, indent=1))
    stats = {
        "observation.state": _stats(np.concatenate([one.state for one in episodes])),
        "action": _stats(np.concatenate([one.action for one in episodes])),
        _CAMERA: _by_channel(_stats(film.pixels / np.float32(255))),
    }
    (meta / "stats.json").write_text(json.dumps(stats, indent=1))


def _lines(episodes: Sequence[_Episode], fps: int) -> Iterator[str]:
    """A query for the line of each episode."""
    video, end = f"videos/{_CAMERA}", 0
    for number, one in enumerate(episodes):
        count, place = len(one.stamps_ns), _place(number)
        end += count
        values = {
            "episode_index": number,
            "length": count,
            "dataset_from_index": end - count,
            "dataset_to_index": end,
            **{f"{part}/{name}": at for part in ("data", video) for name, at in place.items()},
            f"{video}/from_timestamp": 0.0,
            f"{video}/to_timestamp": count / fps,
            "meta/episodes/chunk_index": 0,
            "meta/episodes/file_index": 0,
        }
        # a plain 0.1 would be a decimal, which LeRobot cannot add to its times
        kinds = {int: "BIGINT", float: "DOUBLE"}
        texts = [f'{value}::{kinds[type(value)]} AS "{name}"' for name, value in values.items()]
        texts += [f"[{quoted(_TASK)}] AS tasks", f"{quoted(one.recording.name)} AS recording"]
        texts += [f"{quoted(one.recording.content)} AS content"]
        yield f"SELECT {', '.join(texts)}"


def _info(episodes: Sequence[_Episode], fps: int, shape: tuple[int, int]) -> _Values:
    training = sum(one.recording.split == "train" for one in episodes)
    whole: _Values = {"dtype": "int64", "shape": [1], "names": None}
    features = {
        _CAMERA: {
            "dtype": "video",
            "shape": [*shape, 3],
            "names": ["height", "width", "channels"],
            "info": {"video.fps": fps, "video.codec": "h264", "video.pix_fmt": "yuv420p"},
        },
        "observation.state": _vector(_STATE),
        "action": _vector(episodes[0].names),
        "timestamp": {**whole, "dtype": "float32"},
        **dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), whole),
    }
    return {
        "codebase_version": "v3.0",
        "robot_type": "unknown",
        "total_episodes": len(episodes),
        "total_frames": sum(len(one.stamps_ns) for one in episodes),
        "total_tasks": 1,
        "chunks_size": _CHUNK,
        "data_files_size_in_mb": 100,
        "video_files_size_in_mb": 200,
        "fps": fps,
        "splits": {"train": f"0:{training}", "val": f"{training}:{len(episodes)}"},
        "data_path": _DATA,
        "video_path": _VIDEO,
        "features": features,
    }


def _vector(names: Sequence[str]) -> dict[str, Any]:
    return {"dtype": "float32", "shape": [len(names)], "names": list(names)}


def _stats(values: npt.NDArray[Any]) -> _Values:
    found = {name: getattr(values, name)(axis=0).tolist() for name in ("min", "max", "mean", "std")}
    found |= {f"q{q:02}": np.percentile(values, q, axis=0).tolist() for q in _PERCENTILES}
    return {**found, "count": [len(values)]}


def _by_channel(stats: _Values) -> _Values:
    """Statistics of pixels in the shape (3, 1, 1) that LeRobot has for images."""
    return {
        name: values if name == "count" else [[[one]] for one in values]
        for name, values in stats.items()
    }
