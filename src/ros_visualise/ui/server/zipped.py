"""A folder as one ZIP file, made piece by piece on demand."""

from __future__ import annotations

from bisect import bisect_right
from pathlib import Path
from typing import IO, cast
from zipfile import ZipFile, ZipInfo

from ros_visualise.core.regular_files import open_file

_BLOCK_BYTES = 1 << 20


class ZippedFolder:
    """A virtual ZIP file of ``size`` bytes: its own are kept, those of the files are read again.

    All files are read once to begin with, as a ZIP file holds a checksum of each. Nothing is
    compressed, so that pieces can be found. The files must not change. Raises OSError.
    """

    def __init__(self, folder: Path) -> None:
        self.size = 0
        self._starts: list[int] = []  # of the parts, in order
        self._parts: list[bytes | Path] = []
        self._reads = False  # what is written now is the last part's, which is a file
        with ZipFile(cast("IO[bytes]", self), "w") as made:  # who writes to `write` alone
            for path in sorted(one for one in folder.rglob("*") if one.is_file()):
                self._add(made, path, str(path.relative_to(folder.parent)))

    def read(self, start: int, count: int) -> bytes:
        """Up to ``count`` bytes from ``start`` on; raises OSError if a file has changed."""
        found = b""
        while len(found) < count and start + len(found) < self.size:
            found += self._piece(start + len(found), count - len(found))
        return found

    def write(self, data: bytes) -> int:
        """Go on; for `zipfile` alone."""
        if not self._reads:
            self._begin(bytes(data))
        self.size += len(data)
        return len(data)

    def flush(self) -> None:
        """Nothing waits; for `zipfile` alone."""

    def _add(self, made: ZipFile, path: Path, name: str) -> None:
        with open_file(path) as file, made.open(ZipInfo.from_file(path, name), "w") as target:
            self._begin(path)
            self._reads = True
            while block := file.read(_BLOCK_BYTES):
                target.write(block)
            self._reads = False

    def _begin(self, part: bytes | Path) -> None:
        self._starts.append(self.size)
        self._parts.append(part)

    def _piece(self, start: int, count: int) -> bytes:
        """Bytes of one part; at least one."""
        number = bisect_right(self._starts, start) - 1
        part, within = self._parts[number], start - self._starts[number]
        end = self._starts[number + 1] if number + 1 < len(self._starts) else self.size
        count = min(count, end - start)
        if isinstance(part, bytes):
            return part[within : within + count]
        with open_file(part) as file:
            file.seek(within)
            found = file.read(count)
        if len(found) < count:
            raise OSError(f"{part}: became shorter while it was being sent")
        return found
