"""A file on its way here, under a name of its own until it is whole."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path

from ros_visualise.core.errors import RecordingError


class Incoming:
    """A new file, ``NAME.....part`` beside its place until `finish`.

    Args:
        path: its place, where nothing may be.
        size: bytes.

    Attributes:
        missing: bytes that have not come.

    Raises:
        RecordingError: something is there, or it cannot be written.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path, self.size, self.missing = path, size, size
        self._part = path.with_name(f"{path.name}.{secrets.token_hex(4)}.part")
        try:
            if os.path.lexists(path):
                raise FileExistsError(0, _EXISTS)
            self._file = self._part.open("xb", buffering=0)
        except OSError as error:
            raise RecordingError(f"{path}: {error.strerror}") from None

    @property
    def percent(self) -> int:
        """How much of it is there."""
        return 100 * (self.size - self.missing) // self.size

    def write(self, data: str | bytes) -> None:
        """Add what came.

        Raises:
            OSError: it cannot be written, or is not what was announced.
        """
        if not data or isinstance(data, str) or len(data) > self.missing:
            raise OSError("it is not the file that was announced")
        rest = memoryview(data)
        while rest:
            rest = rest[self._file.write(rest) :]
        self.missing -= len(data)

    def finish(self) -> None:
        """Give it its name, now that it is whole.

        Raises:
            OSError: something has that name by now, or it cannot be written.
        """
        os.fsync(self._file.fileno())
        self._file.close()
        try:
            self.path.open("xb").close()  # nothing is replaced
        except FileExistsError:
            raise OSError(_EXISTS) from None
        try:
            os.replace(self._part, self.path)
        except OSError:
            self.path.unlink()
            raise

    def discard(self) -> None:
        """Leave nothing of it."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            self._part.unlink()


_EXISTS = "exists; choose another name"
