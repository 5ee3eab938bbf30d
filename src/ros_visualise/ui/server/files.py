"""Files that come and go through the page: opened, uploaded, recorded and downloaded."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from threading import Lock

from ros_visualise.core.regular_files import open_file
from ros_visualise.ui.file_chooser import FileChooser
from ros_visualise.ui.server.answers import Answer, BrowserQuery, Refusal
from ros_visualise.ui.server.pool import Pool
from ros_visualise.ui.server.uploads import Pieces, Uploads
from ros_visualise.ui.server.zipped import ZippedFolder

_PIECE_BYTES = 8 << 20


class PageFiles:
    """The files of a page, from one graph to the next.

    Args:
        folder: the only one for recordings and uploads.
        chooser: the files that may be opened; None: none, and no uploads.
    """

    def __init__(self, folder: Path, chooser: FileChooser | None = None) -> None:
        self.folder, self.chooser = folder, chooser
        self.uploads = None if chooser is None else Uploads(folder, chooser.ask)
        self._recorded: dict[str, Path] = {}
        self._zipped: dict[Path, ZippedFolder] = {}
        self._zipping = Lock()
        self._downloads = Pool("page downloads", 2)

    @property
    def title(self) -> str:
        """The title of the page while it shows a file or a stream."""
        name = "" if self.chooser is None else self.chooser.title
        return f"{name} - ros_visualise" if name else ""

    def recorded(self, path: Path) -> None:
        """Offer a recording for download: a file, or a folder as a ZIP file."""
        if path.exists():
            self._recorded[f"{path.name}.zip" if path.is_dir() else path.name] = path

    @property
    def names(self) -> list[str]:
        """The recordings that can be downloaded."""
        return list(self._recorded)

    async def answer(self, query: BrowserQuery) -> Answer:
        """A piece of a recording; raises Refusal for an unknown name."""
        return await self._downloads.do(partial(self._read, query))

    def close(self) -> None:
        self._downloads.close()
        if self.uploads is not None:
            self.uploads.close()

    def _read(self, query: BrowserQuery) -> Answer:
        path = self._recorded.get(query.text("name"))
        try:
            if path is None:
                raise FileNotFoundError
            start = max(query.whole("from") or 0, 0)
            body, size = self._read_folder(path, start) if path.is_dir() else _read(path, start)
        except OSError:
            raise Refusal("no such recording", 404) from None
        return Answer(body, "application/octet-stream", headers={"X-Size": str(size)})

    def _read_folder(self, path: Path, start: int) -> tuple[bytes, int]:
        with self._zipping:
            if start == 0 or path not in self._zipped:  # reads all its files once
                self._zipped[path] = ZippedFolder(path)
            zipped = self._zipped[path]
        return zipped.read(start, _PIECE_BYTES), zipped.size

    async def receive(self, query: BrowserQuery, receive: Pieces) -> None:
        if self.uploads is not None:
            await self.uploads.take(query, receive)


def _read(path: Path, start: int) -> tuple[bytes, int]:
    """A piece of a file, and the file's size."""
    with open_file(path) as file:
        size = file.seek(0, 2)
        file.seek(min(start, size))
        return file.read(_PIECE_BYTES), size
