"""MCAP files that are cut off, damaged or contradict themselves."""

import random
from pathlib import Path
from typing import Any

import pytest
from made_mcaps import Part, Written, in_order, numbered, parts, text, write_mcap, written
from mcap.opcode import Opcode
from mcap.writer import CompressionType, IndexType

from ros_visualise.sources.recordings import Recording
from ros_visualise.sources.recordings.mcap_file import open_mcap
from ros_visualise.sources.recordings.storage import LATEST_NS

STYLES: list[dict[str, Any]] = [
    {"compression": CompressionType.NONE},
    {"compression": CompressionType.LZ4},
    {"compression": CompressionType.ZSTD},
    {"compression": CompressionType.LZ4, "chunk_size": 0},
    {"use_chunking": False},
]


def made(path: Path, style: dict[str, Any]) -> tuple[list[Part], bytes]:
    write_mcap(path, numbered(range(1000, 1100)), **style)
    return parts(path), path.read_bytes()


def stamps(recording: Recording) -> list[int]:
    found = [entry.stamp_ns for entry in recording.read()]
    recording.close()
    return found


def whole_stamps(records: list[Part], end: int = LATEST_NS, skip: int = -1) -> list[int]:
    """The stamps in all records before ``end``, but for the one over the byte ``skip``."""
    return [
        stamp_ns
        for part in records
        if part.end <= end and not part.start <= skip < part.end
        for stamp_ns in part.stamps_ns
    ]


@pytest.mark.parametrize("style", STYLES, ids=str)
def test_of_a_file_that_is_cut_all_whole_records_are_read(
    tmp_path: Path, style: dict[str, Any]
) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, style)
    chance = random.Random(4)
    cuts = {8, 9, len(content) - 1, *chance.sample(range(8, len(content)), 25)}
    cuts |= {part.end for part in chance.sample(records, min(10, len(records)))}
    for cut in sorted(cuts - {len(content)}):
        path.write_bytes(content[:cut])
        recording = open_mcap(path)
        whole = whole_stamps(records, cut)
        cut_chunk = [s for p in records if p.start < cut < p.end for s in p.stamps_ns]
        found = sum(info.messages for info in recording.topics.values())
        expected = [*whole, *cut_chunk][: max(found, len(whole))]
        assert sum(info.messages for info in recording.topics.values()) == len(expected)
        assert (recording.start_ns, recording.end_ns) == (
            min(expected, default=0),
            max(expected, default=0),
        )
        assert stamps(recording) == expected
        assert "its end is missing" in " ".join(recording.loss.notes)


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_chunk_is_read_up_to_the_cut(tmp_path: Path, compression: CompressionType) -> None:
    """Its first blocks can be decompressed before the rest is there."""
    path = tmp_path / "a.mcap"
    messages = [
        Written("/a", n, text(random.Random(n).randbytes(2000).hex())) for n in range(1000, 1300)
    ]
    write_mcap(path, messages, chunk_size=1 << 22, compression=compression)
    (chunk,) = [part for part in parts(path) if part.kind == Opcode.CHUNK]
    content = path.read_bytes()
    read = []
    for tenths in (3, 6, 9):
        path.write_bytes(content[: chunk.start + (chunk.end - chunk.start) * tenths // 10])
        recording = open_mcap(path)
        for choice in (None, ["/a"]):
            found = written(recording.read(topics=choice))
            assert found == messages[: len(found)]
        assert len(recording.stamps_ns()["/a"]) == recording.topics["/a"].messages == len(found)
        assert recording.loss.bytes == chunk.end - path.stat().st_size
        assert len(recording.loss.notes) == 1
        recording.close()
        read.append(len(found))
    blocks = 1 if compression == CompressionType.NONE else 40  # messages in one that is cut
    for count, there in zip(read, (90, 180, 270), strict=True):
        assert there - blocks <= count <= there


@pytest.mark.parametrize("is_cut", [False, True], ids=["with its index", "without"])
@pytest.mark.parametrize("style", STYLES[:4], ids=str)
def test_of_a_damaged_chunk_nothing_is_read_and_of_all_others_everything(
    tmp_path: Path, style: dict[str, Any], is_cut: bool
) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, style)
    chunks = [part for part in records if part.kind == Opcode.CHUNK]
    for chunk in random.Random(5).sample(chunks[1:], min(8, len(chunks) - 1)):
        place = chunk.end - 5
        damaged = bytearray(content[:-1] if is_cut else content)
        damaged[place] ^= 0x10
        path.write_bytes(damaged)
        recording = open_mcap(path)
        assert stamps(recording) == whole_stamps(records, skip=place)
        assert recording.loss.messages == len(chunk.stamps_ns)
        assert recording.loss.bytes >= chunk.end - chunk.start
        assert "is lost" in " ".join(recording.loss.notes)


def test_what_is_damaged_counts_once_however_often_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, {})
    chunk = [part for part in records if part.kind == Opcode.CHUNK][2]
    path.write_bytes(content[: chunk.end - 1] + b"?" + content[chunk.end :])
    recording = open_mcap(path)
    for _ in range(3):
        list(recording.read())
    assert recording.loss.messages == len(chunk.stamps_ns)
    assert len(recording.loss.notes) == 1
    recording.close()


@pytest.mark.parametrize("style", STYLES, ids=str)
@pytest.mark.parametrize("garbage", [b"\x00" * 300, random.Random(6).randbytes(300)], ids=len)
def test_garbage_between_records_is_passed_over(
    tmp_path: Path, style: dict[str, Any], garbage: bytes
) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, style)
    middle = [part for part in records if part.stamps_ns][len(records) // 10]
    path.write_bytes(content[: middle.start] + garbage + content[middle.start :])
    recording = open_mcap(path)
    assert stamps(recording) == whole_stamps(records)
    assert recording.loss.bytes == len(garbage)
    assert recording.loss.messages == 0


@pytest.mark.parametrize("style", STYLES, ids=str)
def test_of_an_overwritten_stretch_only_its_records_are_lost(
    tmp_path: Path, style: dict[str, Any]
) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, style)
    first = next(i for i, part in enumerate(records) if i > len(records) // 3 and part.stamps_ns)
    hit = records[first : first + 4]
    path.write_bytes(
        content[: hit[0].start] + bytes(hit[-1].end - hit[0].start) + content[hit[-1].end :]
    )
    recording = open_mcap(path)
    lost = {stamp_ns for part in hit for stamp_ns in part.stamps_ns}
    assert stamps(recording) == [s for s in whole_stamps(records) if s not in lost]
    assert recording.loss.messages == len(lost)


def test_a_message_with_a_wrong_length_takes_no_other_with_it(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, {"use_chunking": False})
    hit = [part for part in records if part.kind == Opcode.MESSAGE][30]
    damaged = bytearray(content)
    damaged[hit.start + 1] += 50
    path.write_bytes(damaged)
    recording = open_mcap(path)
    assert stamps(recording) == whole_stamps(records, skip=hit.start)
    assert recording.loss.messages == 1


def test_bytes_after_the_end_do_no_harm(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    messages = write_mcap(path, numbered(range(50)))
    path.write_bytes(path.read_bytes() + bytes(1000))
    recording = open_mcap(path)
    assert written(recording.read()) == in_order(messages)
    assert "after its end" in " ".join(recording.loss.notes)
    recording.close()


def test_an_index_that_contradicts_the_file_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    records, content = made(path, {"enable_crcs": False})
    [statistics] = [part for part in records if part.kind == Opcode.STATISTICS]
    for wrong in (b"\x00", b"\xff"):
        place = statistics.start + 9
        path.write_bytes(content[:place] + wrong + content[place + 1 :])
        recording = open_mcap(path)
        assert sum(info.messages for info in recording.topics.values()) == 100
        assert stamps(recording) == whole_stamps(records)
        assert recording.loss.messages == (155 if wrong == b"\xff" else 0)


def test_any_bytes_may_be_wrong(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    chance = random.Random(7)
    for number in range(60):
        style = {**chance.choice(STYLES), "enable_crcs": chance.random() < 0.5}
        write_mcap(path, numbered(range(1000, 1030)), **style)
        content = bytearray(path.read_bytes())
        for _ in range(chance.randint(1, 4)):
            content[chance.randrange(8, len(content))] = chance.randrange(256)
        path.write_bytes(content)
        recording = open_mcap(path)
        entries = list(recording.read())
        there = sum(info.messages for info in recording.topics.values() if not info.unreadable)
        assert len(entries) <= there, number
        assert len(entries) >= there - recording.loss.messages, number
        assert recording.stamps_ns().keys() == recording.topics.keys()
        recording.close()


@pytest.mark.parametrize(("place", "byte"), [(0, 0x45), (9, 77), (22, 0xFF)])
def test_a_message_that_its_chunk_hides_is_said(tmp_path: Path, place: int, byte: int) -> None:
    """Its kind, its channel or its time is wrong, and there is no checksum to tell."""
    path = tmp_path / "a.mcap"
    write_mcap(path, numbered(range(1000, 1100)), enable_crcs=False)
    content = bytearray(path.read_bytes())
    message = content.index(b"number 50") - 8 - 31
    assert content[message] == Opcode.MESSAGE
    content[message + place] = byte
    path.write_bytes(content)
    recording = open_mcap(path)
    for _ in range(2):
        assert len(list(recording.read())) in (99, 100)
        lost = 100 - len(list(recording.read()))
        assert (recording.loss.messages, len(recording.loss.notes)) == (lost, 1)
    recording.close()


def test_an_index_that_points_beyond_the_file_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path, numbered(range(1000, 1100)), enable_crcs=False)
    content = bytearray(path.read_bytes())
    indexes = [part for part in parts(path) if part.kind == Opcode.CHUNK_INDEX]
    length_at = indexes[len(indexes) // 2].start + 9 + 8 + 8 + 8
    content[length_at + 5] = 0x40
    path.write_bytes(content)
    assert stamps(open_mcap(path)) == [*range(1000, 1100)]


@pytest.mark.parametrize("is_chunked", [True, False])
@pytest.mark.parametrize("index", [IndexType.ALL, IndexType.CHUNK, IndexType.NONE], ids=str)
def test_a_message_of_no_channel_is_said_where_no_checksum_tells(
    tmp_path: Path, is_chunked: bool, index: IndexType
) -> None:
    path = tmp_path / "a.mcap"
    without = {"enable_crcs": False, "enable_data_crcs": False}
    messages = write_mcap(
        path, numbered(range(1000, 1060)), use_chunking=is_chunked, index_types=index, **without
    )
    content = bytearray(path.read_bytes())
    content[content.index(messages[7].data) - 22] ^= 0x80  # the lower byte of its channel's number
    path.write_bytes(content)
    recording = open_mcap(path)
    assert len(stamps(recording)) == 59
    assert recording.loss.messages == 1
    assert recording.loss.notes


@pytest.mark.parametrize("letters", [20, 100_000])
@pytest.mark.parametrize(("is_summed", "notes"), [(True, ["checksum mismatch"]), (False, [])])
def test_a_changed_payload_outside_chunks_is_told_by_the_files_checksum(
    tmp_path: Path, letters: int, is_summed: bool, notes: list[str]
) -> None:
    path = tmp_path / "a.mcap"
    messages = [Written("/a", n, text(f"{n}" + "x" * letters)) for n in range(1000, 1060)]
    write_mcap(path, messages, use_chunking=False, enable_data_crcs=is_summed)
    whole = open_mcap(path)
    assert (stamps(whole), whole.loss.notes) == ([*range(1000, 1060)], [])
    content = bytearray(path.read_bytes())
    content[content.index(messages[7].data) + 12] ^= 1
    path.write_bytes(content)
    changed = open_mcap(path)
    assert (stamps(changed), changed.loss.notes) == ([*range(1000, 1060)], notes)
