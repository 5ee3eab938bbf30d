"""The content of a ROS 1 bag without a usable index, found by reading through it."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import BinaryIO, NamedTuple

from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.rosbag1 import records
from ros_visualise.sources.recordings.rosbag1.chunks import Chunk, ChunkReader, Content, stamps_ns
from ros_visualise.sources.recordings.rosbag1.records import BagRecord, Fields, Op
from ros_visualise.sources.recordings.unpacking import DamagedData

_COUNT = struct.Struct("<II")
_NOTES = 20  # more are not read
_BARE_SIZE = 16 << 20  # of records outside of chunks, so many bytes are taken as one
_CHUNK_MARK = b"op=\x05"
_LONGEST_CHUNK_HEADER = 64
_SEARCHED = 1 << 20
_PROBES = 16  # chunks that are looked at before an index is believed


class BagConnection(NamedTuple):
    """One publisher's topic; ``type_name`` as ``sensor_msgs/msg/Image``, ``digest`` its MD5."""

    topic: str
    type_name: str
    digest: str
    definition: str
    latched: bool
    callerid: str


@dataclass
class Layout:
    """Content of a bag: connections by their number, chunks in the file's order.

    ``index_position``: beginning of its index, and end of its last chunk's index.
    """

    connections: dict[int, BagConnection] = field(default_factory=dict)
    chunks: list[Chunk] = field(default_factory=list)
    indexed: bool = True
    index_position: int = 0
    encryptor: str = ""
    loss: Loss = field(default_factory=Loss)


def parse_connection(fields: Fields, data: bytes) -> tuple[int, BagConnection]:
    """The number and the content of a connection's record."""
    content = records.parse_fields(data)
    package, _, name = records.text(content, b"type").partition("/")
    parts = records.text(fields, b"topic").split("/")
    found = BagConnection(
        topic="/" + "/".join(part for part in parts if part),
        type_name=f"{package}/msg/{name.rpartition('/')[2]}",
        digest=records.text(content, b"md5sum"),
        definition=records.text(content, b"message_definition"),
        latched=records.text(content, b"latching") == "1",
        callerid=records.text(content, b"callerid"),
    )
    return records.number(fields, b"conn"), found


def parse_chunk_info(fields: Fields, data: bytes) -> Chunk:
    """A chunk as the index at the bag's end has it."""
    if len(data) % _COUNT.size:
        raise DamagedData("a chunk's counts are cut off")
    counts = {connection: messages for connection, messages in _COUNT.iter_unpack(data) if messages}
    return Chunk(
        position=records.number(fields, b"chunk_pos"),
        start_ns=records.time_ns(fields, b"start_time"),
        end_ns=records.time_ns(fields, b"end_time"),
        counts=counts,
    )


class BagScan:
    """Search for chunks in a bag that was not closed, or was cut."""

    def __init__(
        self, file: BinaryIO, size: int, index_position: int, header: Fields | None = None
    ) -> None:
        self._file, self._size, self._index_position = file, size, index_position
        self._reader = ChunkReader(file, size)
        self._layout = Layout(indexed=False)
        self._bare: int | None = None
        self._needed = index_position  # the file was at least as long
        self._has_end = index_position > 0  # its recorder came to write the index
        self._header = header or {}
        self._seen = 0  # chunks, also empty ones
        self._infos: list[Chunk] = []  # chunks as the index at the end has them
        self._damages: list[tuple[int, int, str]] = []  # from where to where, and what it is

    def run(self, position: int) -> Layout:
        """The content from that position on."""
        while position < self._size:
            try:
                record = records.read_record(self._file, position, self._size)
                if record.end > self._size and record.op != Op.CHUNK:
                    raise DamagedData("cut off")
                following = self._take(record, position)
            except DamagedData:
                self._end_bare(position)
                following = self._skip_damage(position)
            position = following
        self._end_bare(position)
        self._look_again()
        self._check_end()
        self._compare()
        return self._layout

    def _take(self, record: BagRecord, position: int) -> int:
        """Add a record; returns the beginning of the next one."""
        if record.op in (Op.MESSAGE, Op.CONNECTION):
            if self._bare is not None and position - self._bare > _BARE_SIZE:
                self._end_bare(position)
            if self._bare is None:
                self._bare = position
            return record.end
        self._end_bare(position)
        if record.op == Op.CHUNK_INFO:  # these come last of all: nothing is missing
            self._needed, self._has_end = 0, True
            with suppress(DamagedData):
                data = records.read_data(self._file, record)
                self._infos.append(parse_chunk_info(record.fields, data))
        if record.op != Op.CHUNK:
            return record.end
        return self._take_chunk(record, position)

    def _take_chunk(self, record: BagRecord, position: int) -> int:
        self._seen += 1
        is_unfinished = not record.data_size
        if is_unfinished and records.text(record.fields, b"compression") == "none":
            return record.data_position  # its messages follow as records of the file
        chunk, end = self._indexed_chunk(record, position)
        if is_unfinished:
            end = self._size
            self._damages.append((position, end, "a chunk that was never finished"))
        if not chunk.counts or not chunk.counts.keys() <= self._layout.connections.keys():
            chunk, end = self._look_into(chunk, end)
        if chunk.counts:
            self._layout.chunks.append(chunk)
        self._needed = max(self._needed, record.end)
        return min(end, self._size)

    def _indexed_chunk(self, record: BagRecord, position: int) -> tuple[Chunk, int]:
        """A chunk by its index records, and their end; without counts if they are damaged."""
        end = record.end
        times: list[int] = []
        counts: dict[int, int] = {}
        for connection, indexed, following in self._reader.index(record.end):
            end = following
            stamps = stamps_ns(indexed)
            if len(stamps):
                counts[connection] = counts.get(connection, 0) + len(stamps)
                times += [int(stamps.min()), int(stamps.max())]
        if not counts or not self._goes_on(end):
            return Chunk(position, 0, 0, {}), end
        return Chunk(position, min(times), max(times), counts), end

    def _goes_on(self, position: int) -> bool:
        """True if a whole record other than one more of an index follows."""
        try:
            record = records.read_record(self._file, position, self._size)
        except DamagedData:
            return False
        return record.op == Op.CHUNK or (record.op != Op.INDEX and record.end <= self._size)

    def _look_into(self, chunk: Chunk, end: int) -> tuple[Chunk, int]:
        """Read through a chunk for its connections and, without an index, for its messages."""
        try:
            content = self._reader.content(chunk)
            walk = self._reader.walk(content)
        except DamagedData as error:
            if not chunk.counts:
                self._lose(chunk.position, min(end, self._size), str(error))
            return chunk, end
        self._learn(walk.connections)
        if chunk.counts:
            return chunk, end
        if walk.stop < content.end:
            if content.origin >= 0:  # its own length may be what is wrong: look on from here
                end = content.origin + walk.stop - content.start
            else:
                self._layout.loss.bytes += content.end - walk.stop
                self._damages.append((chunk.position, end, "the rest of a chunk is damaged"))
        return walk.chunk(chunk.position), end

    def _end_bare(self, end: int) -> None:
        """Close the piece of messages outside of chunks."""
        if self._bare is not None:
            walk = self._reader.walk(Content(self._file, self._bare, end, None, self._bare))
            self._learn(walk.connections)
            if len(walk.entries):
                self._layout.chunks.append(walk.chunk(self._bare, bare_end=end))
            self._bare = None

    def _learn(self, connections: Iterable[tuple[Fields, bytes]]) -> None:
        for fields, data in connections:
            try:
                number, found = parse_connection(fields, data)
            except DamagedData:
                continue
            self._layout.connections.setdefault(number, found)

    def _skip_damage(self, position: int) -> int:
        """Beginning of the next chunk after something that is no record; else the end."""
        following = self._find_chunk(position)
        if position >= self._index_position > 0:
            return following  # only of the index
        what = "cut off" if following == self._size else "damaged"
        self._lose(position, following, what)
        return following

    def _find_chunk(self, position: int) -> int:
        after = position + 1
        while after < self._size:
            self._file.seek(after)
            block = self._file.read(_SEARCHED)
            mark = block.find(_CHUNK_MARK)
            while mark >= 0:
                found = self._chunk_around(after + mark, position)
                if found:
                    return found
                mark = block.find(_CHUNK_MARK, mark + 1)
            after += _SEARCHED - len(_CHUNK_MARK)
        return self._size

    def _chunk_around(self, mark: int, position: int) -> int:
        """Beginning of the chunk whose header has its mark at a place; 0 without one."""
        for start in range(mark - 8, max(position, mark - _LONGEST_CHUNK_HEADER), -1):
            try:
                record = self._reader.header(start)
            except DamagedData:
                continue
            if b"compression" in record.fields:
                return start
        return 0

    def _look_again(self) -> None:
        """Read the chunks whose own index contradicts the one at the end."""
        infos = Counter(map(_sign, self._infos))
        for place, chunk in enumerate(self._layout.chunks):
            infos[_sign(chunk)] -= 1
            if self._infos and not chunk.bare_end and infos[_sign(chunk)] < 0:
                with suppress(DamagedData):
                    walk = self._reader.walk(self._reader.content(chunk))
                    self._learn(walk.connections)
                    if len(walk.entries) > chunk.messages:
                        self._layout.chunks[place] = walk.chunk(chunk.position)

    def _compare(self) -> None:
        """Compare what was found with the header and the index at the end."""
        declared, found = count_messages(self._infos), count_messages(self._layout.chunks)
        missing = (declared - found).total()
        notes = self._layout.loss.notes
        self._layout.loss.messages += missing
        if missing:
            there = found.total()
            notes.append(f"its index lists {there + missing} messages; found {there}")
        for name, what, there in (
            (b"chunk_count", "chunks", self._seen),
            (b"conn_count", "connections", len(self._layout.connections)),
        ):
            counted = _number(self._header, name)
            if counted > there and not notes:
                notes.append(f"its header lists {counted} {what}; found {there}")
        if not notes:
            notes.append("its index is damaged; all messages recovered without it")

    def _lose(self, start: int, end: int, why: str) -> None:
        self._layout.loss.bytes += end - start
        self._damages.append((start, end, why))

    def _check_end(self) -> None:
        """Note all damage; of what the end of the file cuts, only the first."""
        notes = self._layout.loss.notes
        within = [damage for damage in self._damages if damage[1] < self._size]
        at_end = [damage for damage in self._damages if damage[1] >= self._size]
        missing = max(0, self._needed - self._size)
        self._layout.loss.bytes += missing
        notes += [f"at {start / 1e6:.1f} MB: {why}" for start, _, why in within[:_NOTES]]
        if missing:
            here, whole = self._size / 1e6, self._needed / 1e6
            digits = 1 if whole >= 1 else 4
            notes.append(f"cut off after {here:.{digits}f} of at least {whole:.{digits}f} MB")
        elif not self._has_end:
            found = sum(chunk.messages for chunk in self._layout.chunks)
            notes.append(f"never finished by its recorder; messages found: {found}")
        else:
            notes += [f"at {start / 1e6:.1f} MB: {why}" for start, _, why in at_end[:1]]


def _sign(chunk: Chunk) -> tuple[int, int, frozenset[tuple[int, int]]]:
    """Content of a chunk, to compare two accounts of it wherever it was moved."""
    return chunk.start_ns, chunk.end_ns, frozenset(chunk.counts.items())


def count_messages(chunks: Iterable[Chunk]) -> Counter[int]:
    """Messages by connection."""
    counts: Counter[int] = Counter()
    for chunk in chunks:
        counts.update(chunk.counts)
    return counts


def _number(header: Fields, name: bytes) -> int:
    """A number of the bag's header; 0 if it is damaged."""
    with suppress(DamagedData):
        return records.number(header, name)
    return 0


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
        raise DamagedData("the index does not end at the end of the bag")
    layout.chunks.sort()
    first = layout.chunks[0].position if layout.chunks else layout.index_position
    if first != header.end:
        raise DamagedData("the index does not cover the whole bag")
    _check(layout, ChunkReader(file, size))
    return layout


def _expect(op: Op, file: BinaryIO, position: int, size: int) -> BagRecord:
    record = records.read_record(file, position, size)
    if record.op != op:
        raise DamagedData(f"no {op.name} record where expected")
    return record


def _check(layout: Layout, reader: ChunkReader) -> None:
    """Check that an index belongs to its bag; looking at every chunk would take too long."""
    chunks = layout.chunks
    known = layout.connections.keys()
    if any(chunk.start_ns > chunk.end_ns or not chunk.counts.keys() <= known for chunk in chunks):
        raise DamagedData("the index is inconsistent")
    if len({chunk.position for chunk in chunks}) < len(chunks):
        raise DamagedData("the index lists a chunk twice")
    if any(len(reader.walk(reader.content(one)).entries) for one in chunks if not one.counts):
        raise DamagedData("the index lacks messages")
    step = max(1, len(chunks) // _PROBES)
    found = [_is_there(reader, chunk) for chunk in [*chunks[::step], *chunks[-1:]]]
    if sum(found) * 2 < len(found):  # less is damage to the chunks
        raise DamagedData("the index belongs to another bag")


def _is_there(reader: ChunkReader, chunk: Chunk) -> bool:
    try:
        reader.header(chunk.position)
    except DamagedData:
        return False
    return True
