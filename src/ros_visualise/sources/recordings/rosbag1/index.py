"""The content of a ROS 1 bag, by the index at its end."""

from __future__ import annotations

from typing import BinaryIO

from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import Chunk, ChunkReader
from ros_visualise.sources.recordings.rosbag1.records import BagRecord, Op
from ros_visualise.sources.recordings.rosbag1.scan import (
    BagScan,
    Layout,
    parse_chunk_info,
    parse_connection,
)
from ros_visualise.sources.recordings.unpacking import DamagedData

_PROBES = 16  # chunks that are looked at before an index is believed


def read_layout(file: BinaryIO, size: int) -> Layout:
    """Read the index at the bag's end or, without one, through the bag."""
    try:
        header = _expect(Op.BAG_HEADER, file, len(records.MAGIC), size)
        index_position = records.number(header.fields, b"index_pos")
        if header.end > size:
            raise DamagedData("cut off")
    except DamagedData:
        layout = BagScan(file, size, 0).run(len(records.MAGIC))
        layout.loss.notes.append("its beginning is damaged")
        return layout
    if b"encryptor" in header.fields:
        return Layout(encryptor=records.text(header.fields, b"encryptor"))
    try:
        return _read_index(file, size, header)
    except DamagedData:
        return BagScan(file, size, index_position, header.fields).run(header.end)


def _read_index(file: BinaryIO, size: int, header: BagRecord) -> Layout:
    position = records.number(header.fields, b"index_pos")
    if not len(records.MAGIC) < position <= size:
        raise DamagedData("no index")
    layout = Layout(index_position=position)
    for _ in range(records.number(header.fields, b"conn_count")):
        record = _expect(Op.CONNECTION, file, position, size)
        number, found = parse_connection(record.fields, records.read_data(file, record))
        layout.connections.setdefault(number, found)
        position = record.end
    for _ in range(records.number(header.fields, b"chunk_count")):
        record = _expect(Op.CHUNK_INFO, file, position, size)
        layout.chunks.append(parse_chunk_info(record.fields, records.read_data(file, record)))
        position = record.end
    if position != size:
        raise DamagedData("an index that is not the end of its bag")
    layout.chunks.sort()
    first = layout.chunks[0].position if layout.chunks else layout.index_position
    if first != header.end:
        raise DamagedData("an index that does not name all of its bag")
    _check(layout, ChunkReader(file, size))
    return layout


def _expect(op: Op, file: BinaryIO, position: int, size: int) -> BagRecord:
    record = records.read_record(file, position, size)
    if record.op != op:
        raise DamagedData(f"no {op.name} where one should be")
    return record


def _check(layout: Layout, reader: ChunkReader) -> None:
    """Check that an index belongs to its bag; looking at every chunk would take too long."""
    chunks = layout.chunks
    known = layout.connections.keys()
    if any(chunk.start_ns > chunk.end_ns or not chunk.counts.keys() <= known for chunk in chunks):
        raise DamagedData("an index that contradicts itself")
    if len({chunk.position for chunk in chunks}) < len(chunks):
        raise DamagedData("an index that names a chunk twice")
    if any(len(reader.walk(reader.content(one)).entries) for one in chunks if not one.counts):
        raise DamagedData("an index without some of its messages")
    step = max(1, len(chunks) // _PROBES)
    found = [_is_there(reader, chunk) for chunk in [*chunks[::step], *chunks[-1:]]]
    if sum(found) * 2 < len(found):  # less is damage to the chunks
        raise DamagedData("an index of another bag")


def _is_there(reader: ChunkReader, chunk: Chunk) -> bool:
    try:
        reader.header(chunk.position)
    except DamagedData:
        return False
    return True
