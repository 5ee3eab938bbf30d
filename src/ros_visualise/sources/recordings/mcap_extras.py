"""What an MCAP file holds beside its messages: attachments, and records of metadata.

Source: the MCAP format specification, "Attachment" and "Metadata".
"""

from __future__ import annotations

import io
import struct
import zlib

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from ros_visualise.sources.recordings import Extra
from ros_visualise.sources.recordings.mcap_records import HEAD, HEAD_BYTES, Damaged

_CRC = struct.Struct("<I")


def parse_extra(record: bytes) -> Extra:
    """An attachment or a record of metadata, of all its bytes.

    Raises:
        Damaged: it is neither, or not what its checksum says.
    """
    if len(record) < HEAD_BYTES or HEAD.unpack_from(record)[1] != len(record) - HEAD_BYTES:
        raise Damaged("its length is damaged")
    body = record[HEAD_BYTES:]
    try:
        if record[0] == Opcode.METADATA:
            return _metadata(body)
        if record[0] == Opcode.ATTACHMENT:
            return _attachment(body)
    except (McapError, struct.error, UnicodeDecodeError):
        raise Damaged("it contradicts itself") from None
    raise Damaged("it is something else")


def _metadata(body: bytes) -> Metadata:
    found: Metadata = Metadata.read(ReadDataStream(io.BytesIO(body)))
    return found


def _attachment(body: bytes) -> Attachment:
    (crc,) = _CRC.unpack_from(body, len(body) - _CRC.size)
    if crc and zlib.crc32(body[: -_CRC.size]) != crc:
        raise Damaged("its data is not what its checksum says")
    found: Attachment = Attachment.read(ReadDataStream(io.BytesIO(body)))
    return found
