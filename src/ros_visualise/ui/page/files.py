"""Files that come and go through the page: opened, uploaded, recorded and downloaded."""

from __future__ import annotations

from functools import partial
from html import escape
from pathlib import Path
from threading import Lock
from urllib.parse import quote

import viser

from ros_visualise.core.regular_files import open_file
from ros_visualise.ui.look.answers import Answer, Question, Refusal
from ros_visualise.ui.page.controls import set_value
from ros_visualise.ui.page.gate import Receive
from ros_visualise.ui.page.pool import Pool
from ros_visualise.ui.page.uploads import MAX_GIB, Uploads
from ros_visualise.ui.page.worker import Worker
from ros_visualise.ui.page.zipped import ZippedFolder
from ros_visualise.ui.shelf import SUFFIXES, Shelf

FOLDER = "open"
_PIECE_BYTES = 8 << 20
_NONE = "choose a file"


class Files:
    """What a page knows of files, whatever it shows.

    Args:
        folder: the only one in which it records, and to which uploads go.
        shelf: what may be opened; None: nothing, and nothing is uploaded.
    """

    def __init__(self, folder: Path, shelf: Shelf | None = None) -> None:
        self.folder, self.shelf = folder, shelf
        self.uploads = None if shelf is None else Uploads(folder, shelf.ask)
        self._recorded: dict[str, Path] = {}
        self._zipped: dict[Path, ZippedFolder] = {}
        self._zipping = Lock()
        self._downloads = Pool("page downloads", 2)

    @property
    def title(self) -> str:
        """What is shown, where that is one of the files."""
        current = None if self.shelf is None else self.shelf.current
        return "" if current is None else f"{current.name} - ros_visualise"

    def recorded(self, path: Path) -> None:
        """Offer what was recorded for download: a file, or a folder as a ZIP file."""
        if path.exists():
            self._recorded[f"{path.name}.zip" if path.is_dir() else path.name] = path

    @property
    def links(self) -> str:
        """Links to all that were recorded, as HTML."""
        return ", ".join(
            f'<a href="#" data-download="{escape(quote(name))}">{escape(name)}</a>'
            for name in self._recorded
        )

    async def answer(self, question: Question) -> Answer:
        """A piece of what was recorded.

        Raises:
            Refusal: there is no such recording.
        """
        return await self._downloads.do(partial(self._read, question))

    def close(self) -> None:
        """End the threads."""
        self._downloads.close()
        if self.uploads is not None:
            self.uploads.close()

    def _read(self, question: Question) -> Answer:
        path = self._recorded.get(question.text("name"))
        try:
            if path is None:
                raise FileNotFoundError
            start = max(question.whole("from") or 0, 0)
            body, size = self._read_folder(path, start) if path.is_dir() else _read(path, start)
        except OSError:
            raise Refusal("there is no such recording", 404) from None
        return Answer(body, "application/octet-stream", headers={"X-Size": str(size)})

    def _read_folder(self, path: Path, start: int) -> tuple[bytes, int]:
        with self._zipping:
            if start == 0 or path not in self._zipped:  # which reads all its files once
                self._zipped[path] = ZippedFolder(path)
            zipped = self._zipped[path]
        return zipped.read(start, _PIECE_BYTES), zipped.size

    async def receive(self, question: Question, receive: Receive) -> None:
        """Take in an upload."""
        if self.uploads is not None:
            await self.uploads.take(question, receive)


def _read(path: Path, start: int) -> tuple[bytes, int]:
    """A piece of a file, and the size of all of it."""
    with open_file(path) as file:
        size = file.seek(0, 2)
        file.seek(min(start, size))
        return file.read(_PIECE_BYTES), size


class Opener:
    """The choice of a file, and where one can be dropped, in a folder of its own."""

    def __init__(self, gui: viser.GuiApi, files: Files, worker: Worker) -> None:
        assert files.shelf is not None
        assert files.uploads is not None
        self._files, self._shelf, self._uploads = files, files.shelf, files.uploads
        with gui.add_folder(FOLDER, expand_by_default=False):
            self._choice = gui.add_dropdown("source", self._names(), initial_value=_NONE)
            self._choice.on_update(worker.listener("source", self._ask))
            self._note = gui.add_html(self._describe())

    def refresh(self) -> None:
        """Show what there is now."""
        if self._names() != self._choice.options:
            self._choice.options = self._names()
        if self._note.content != self._describe():
            self._note.content = self._describe()

    def _ask(self, name: str) -> None:
        if name != _NONE:
            set_value(self._choice, _NONE)
            self._shelf.ask(self._shelf.files().get(name, Path(name)))

    def _names(self) -> tuple[str, ...]:
        return _NONE, *self._shelf.files()

    def _describe(self) -> str:
        title = escape(self._files.title)
        text = self._uploads.state or f"to {self._uploads.folder.absolute()}, {MAX_GIB} GiB at most"
        return (
            '<div class="rv-note"><label class="rv-upload">upload a file<input type="file" hidden '
            f'multiple accept="{",".join(SUFFIXES)}" data-upload data-title="{title}">'
            f"</label> or drop it on the page: {escape(text)}</div>"
        )
