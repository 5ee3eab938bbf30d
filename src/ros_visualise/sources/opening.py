"""Opening a recording or a video: its format is found by its content, whatever its name."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack, closing
from datetime import datetime
from itertools import islice
from pathlib import Path
from shlex import quote
from typing import Any

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file
from ros_visualise.sources.formats import FORMATS, Format, format_of, kinds, named
from ros_visualise.sources.pictures import is_pictures, recorded_pictures, videos_in
from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.joined import JoinedRecording
from ros_visualise.sources.recordings.series import opened_before
from ros_visualise.sources.recordings.summary import read_through, summarize
from ros_visualise.sources.trajectory_files import is_trajectory_file

_ARCHIVES = (b"PK\x03\x04", b"\x1f\x8b", b"BZh", b"\xfd7zXZ", b"\x28\xb5\x2f\xfd", b"7z\xbc\xaf")
"""Beginnings of zip, gzip, bzip2, xz, zstd and 7z files."""
_HEAD_SIZE = 4096
_SEARCHED = 100  # of the folders in a folder
_LISTED = 3  # of the recordings in a folder, or of losses, so many are named


class NoRecording(OpenError):
    """A folder contains no recording."""


def open_source(path: Path) -> Recording:
    """Open a recording, or a video or pictures as one; raises OpenError if it cannot be opened."""
    if not _may_be_video(path):
        try:
            return open_recording(path)
        except NoRecording:
            if not is_pictures(path):
                raise
            return recorded_pictures(path)
    from ros_visualise.sources.demux import NoVideo  # PyAV takes a while to import
    from ros_visualise.sources.telemetry import open_film

    try:
        return open_film(path)
    except NoVideo:
        raise _neither(path) from None


def open_joined(paths: Sequence[Path]) -> JoinedRecording:
    """Open several recordings and films as one; raises OpenError if one cannot be opened."""
    with ExitStack() as undo:
        parts = [undo.enter_context(closing(open_source(path))) for path in paths]
        joined = JoinedRecording(parts, [_origin_ns(path) for path in paths])
        undo.pop_all()
        return joined


def open_again(recording: Recording) -> Recording:
    """Open an open recording once more, without logging its notes again; or raise OpenError."""
    before = opened_before.set(True)
    try:
        if isinstance(recording, JoinedRecording):
            return open_joined(recording.paths)
        return open_recording(recording.path)
    finally:
        opened_before.reset(before)


def info(path: Path, check: bool) -> dict[str, Any]:
    """Summary of a recording or a video; see `ros_visualise.sources.info`."""
    if not _may_be_video(path):
        with closing(open_source(path)) as recording:
            if check:
                read_through(recording)
            return summarize(recording)
    from ros_visualise.sources.demux import NoVideo
    from ros_visualise.sources.telemetry import recorded_telemetry
    from ros_visualise.sources.video import describe

    try:
        found = describe(path)
    except NoVideo:
        raise _neither(path) from None
    with closing(recorded_telemetry(path)) as telemetry:
        measured = summarize(telemetry)
        found["topics"] = dict(sorted({**found["topics"], **measured["topics"]}.items()))
        found["messages"] += measured["messages"]
        found["lost"]["notes"] = [*found["lost"]["notes"], *measured["lost"]["notes"]]
    if check:
        with closing(open_source(path)) as recording:
            read_through(recording)
            found["lost"]["notes"] = list(recording.loss.notes)
    return found


def open_recording(path: str | Path) -> Recording:
    """Open a recording; raises OpenError if it cannot be read."""
    path = Path(path)
    try:
        recording = _open_folder(path) if path.is_dir() else _open_file(path)
    except OSError as error:
        raise OpenError.unreadable(path, error) from None
    if recording.loss and not any(topic.messages for topic in recording.topics.values()):
        recording.close()
        why = "; ".join(recording.loss.notes[:_LISTED])
        raise OpenError(f"{path}: no readable messages; copy or record it again ({why})")
    return recording


def is_recording(path: str | Path) -> bool:
    """True for a folder, and a file of a recording, be it damaged; false for a video.

    False for a folder of pictures, unless there is a recording too.
    """
    path = Path(path)
    try:
        if path.is_dir():
            return not is_pictures(path) or is_recorded_folder(path) or bool(_recordings_in(path))
        return path.is_file() and format_of(_head(path)) is not None
    except OSError:
        return False


def is_recorded_folder(path: Path) -> bool:
    """True if a folder is one recording, as of ROS 2; those somewhere below it do not count."""
    return path.is_dir() and _format_of_folder(path) is not None


def _may_be_video(path: Path) -> bool:
    return os.path.isfile(path) and not is_recording(path)


def _origin_ns(path: Path) -> int | None:
    """The date of a film's first image, None if the film does not say it; 0 for recordings."""
    if not _may_be_video(path):
        return 0
    from ros_visualise.sources.demux import open_container

    with open_container(path) as container:
        written = container.metadata.get("creation_time", "")
    try:
        made = datetime.fromisoformat(written.replace("Z", "+00:00"))
    except ValueError:
        return None
    return max(round(made.timestamp() * 1e9), 0)


def _neither(path: Path) -> OpenError:
    what = f"neither a recording ({kinds()}) nor a video that FFmpeg can read"
    return _unknown_file(path, what, "check the path, or copy the file again")


def _unknown_file(path: Path, what: str, hint: str) -> OpenError:
    """The error for an unreadable file: what it is, unless its name tells more, and a hint."""
    if _head(path).startswith(_ARCHIVES):
        return OpenError(f"{path}: a compressed archive; unpack it first")
    if is_trajectory_file(path):
        command = f"ros-visualise trajectory {quote(str(path))}"
        return OpenError(f"{path}: a trajectory; to show it: {command}")
    if meant := named(path):
        what = f"not a valid {meant}, despite its extension"
    return OpenError(f"{path}: {what}; {hint}")


def _open_file(path: Path) -> Recording:
    if not path.exists():
        raise OpenError.missing(path)
    if not path.is_file():
        raise OpenError(
            f"{path}: not a regular file; for a camera run: ros-visualise camera {quote(str(path))}"
        )
    head = _head(path)
    if not head:
        raise OpenError(f"{path}: the file is empty; copy or record it again")
    known = format_of(head)
    if known is not None:
        return known.open(path)
    hint = f"if it is a video: ros-visualise video {quote(str(path))}"
    raise _unknown_file(path, f"not a recording ({kinds()})", hint)


def _open_folder(path: Path) -> Recording:
    within = (one for one in FORMATS.all() if one.is_within(path))
    known = _format_of_folder(path) or next(within, None)
    if known is not None:
        return known.open(path)
    found = _recordings_in(path)
    series = next((one for one in FORMATS.all() if found and one.is_series(found)), None)
    if series is not None:
        return series.open(path)
    for one in FORMATS.all() if not found else ():
        if whole_path := one.whole_of(path):
            raise OpenError(f"{path}: only a part of a {one.name}; give the whole: {whole_path}")
    if not found:
        raise NoRecording(_nothing_in(path))
    if len(found) == 1:
        return _open_folder(found[0]) if found[0].is_dir() else _open_file(found[0])
    raise OpenError(_several_in(path, found))


def _recordings_in(folder: Path) -> list[Path]:
    return [
        item
        for item in sorted(folder.iterdir())
        if is_recorded_folder(item)
        or (item.is_file() and not is_pictures(item) and is_recording(item))
    ]


def _nothing_in(folder: Path) -> str:
    if videos := videos_in(folder):
        return _several_in(folder, videos)
    if is_pictures(folder):
        command = f"ros-visualise video {quote(str(folder))}"
        return f"{folder}: a folder of pictures; to play it: {command}"
    inside = (
        one for one in sorted(folder.iterdir()) if one.is_dir() and not one.name.startswith(".")
    )
    if found := [one for one in islice(inside, _SEARCHED) if is_pictures(one) or videos_in(one)]:
        return _several_in(folder, found)
    return f"{folder}: no recording, video or picture in this folder; check the path"


def _several_in(folder: Path, found: Sequence[Path]) -> str:
    names = ", ".join(item.name for item in found[:_LISTED])
    more = f" and {len(found) - _LISTED} more" if len(found) > _LISTED else ""
    return f"{folder}: a folder that contains {names}{more}; choose one, for instance {found[0]}"


def _format_of_folder(path: Path) -> Format | None:
    return next((one for one in FORMATS.all() if one.is_folder(path)), None)


def _head(path: Path) -> bytes:
    with open_file(path) as file:
        return file.read(_HEAD_SIZE)
