"""Chunks that all overlap in time: read in order, without keeping all of them in memory."""

import gc
import tracemalloc
from pathlib import Path

import pytest
from made_mcaps import Written, in_order, text, write_mcap, written
from mcap.writer import CompressionType

from ros_visualise.sources.opening import open_recording
from ros_visualise.sources.recordings import merging
from ros_visualise.sources.recordings.pieces import PieceCache

CHUNKS, PER_CHUNK = 50, 8
COMPRESSIONS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def overlapping(path: Path, size: int, compression: CompressionType) -> list[Written]:
    """Every chunk from the first to the last time."""
    messages = [
        Written("/a", 1 + turn * CHUNKS + chunk, text(f"{chunk} {turn} ".ljust(size, "x")))
        for chunk in range(CHUNKS)
        for turn in range(PER_CHUNK)
    ]
    chunk_bytes = PER_CHUNK * size  # reached with the last message of each
    return write_mcap(path, messages, chunk_size=chunk_bytes, compression=compression)


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize("capacity", [1, 100_000, 1_000_000, 10_000_000])
def test_they_are_read_in_order_however_much_is_kept(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    compression: CompressionType,
    capacity: int,
) -> None:
    messages = overlapping(tmp_path / "a.mcap", 10_000, compression)
    monkeypatch.setattr(merging, "PieceCache", lambda: PieceCache(capacity))
    recording = open_recording(tmp_path / "a.mcap")
    assert written(recording.read()) == in_order(messages)
    middle = CHUNKS * PER_CHUNK // 2
    later = [message for message in in_order(messages) if message.stamp_ns >= middle]
    assert written(recording.read(middle)) == later
    recording.close()


def test_no_more_is_kept_than_there_is_room_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    overlapping(tmp_path / "a.mcap", 50_000, CompressionType.LZ4)
    whole, capacity, chunk = CHUNKS * PER_CHUNK * 50_000, 2_000_000, PER_CHUNK * 50_000
    monkeypatch.setattr(merging, "PieceCache", lambda: PieceCache(capacity))
    recording = open_recording(tmp_path / "a.mcap")
    gc.collect()
    tracemalloc.start()
    count = sum(1 for _ in recording.read())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    recording.close()
    assert count == CHUNKS * PER_CHUNK
    assert peak < capacity + 3 * chunk + count * 350 < whole // 4


def test_they_end_when_the_recording_is_closed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    overlapping(tmp_path / "a.mcap", 1000, CompressionType.NONE)
    monkeypatch.setattr(merging, "PieceCache", lambda: PieceCache(1000))
    recording = open_recording(tmp_path / "a.mcap")
    entries = recording.read()
    assert next(entries).stamp_ns == 1
    recording.close()
    assert list(entries) == []
    assert not recording.loss
