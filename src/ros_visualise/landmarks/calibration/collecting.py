"""Collecting distinct views of a board from images."""

from __future__ import annotations

from collections import Counter

from ros_visualise.core.errors import UsageError
from ros_visualise.core.printing import counted
from ros_visualise.data import Image
from ros_visualise.landmarks.calibration.boards import Board
from ros_visualise.landmarks.calibration.finder import BoardFinder
from ros_visualise.landmarks.calibration.views import BoardView, Coverage, Gallery, cover
from ros_visualise.vision.color import gray_of
from ros_visualise.vision.reshape import Size

_MOST = 60  # views that are kept


class ViewCollector:
    """Finds a board in the images of one camera and keeps distinct views.

    Args:
        board: described by the user.
    """

    def __init__(self, board: Board) -> None:
        self.finder = BoardFinder(board)
        self._gallery = Gallery(_MOST)
        self._sizes: Counter[Size] = Counter()
        self.seen = 0
        """Number of images searched."""
        self.found = 0
        """Number of images with a board."""
        self.missed: list[str] = []
        """Names of images without one."""

    def add(self, image: Image, name: str, thorough: bool = True) -> BoardView | None:
        """The board in an image, even if the view is not kept.

        Args:
            image: gray or colour.
            name: of the image.
            thorough: see `find_board`.

        Raises:
            UnsupportedImage: its pixels are measurements.
        """
        self.seen += 1
        view = self.finder.look(gray_of(image), name, thorough)
        if view is None:
            self.missed.append(name)
            return None
        self.found += 1
        self._sizes[view.size] += 1
        self._gallery.offer(view)
        return view

    @property
    def size(self) -> Size | None:
        """Width and height of most images; None before one showed a board."""
        return self._sizes.most_common(1)[0][0] if self._sizes else None

    @property
    def views(self) -> list[BoardView]:
        """The kept views, of the most frequent reading of the board and image size."""
        chosen = (self.finder.board, self.size)
        return [view for view in self._gallery.views if (view.board, view.size) == chosen]

    @property
    def checked_views(self) -> list[BoardView]:
        """The kept views; raises UsageError if no image showed the board."""
        if not self.found:
            raise UsageError(
                f"no board found in {counted(self.seen, 'image')}: no {self.finder.tried}; check"
                " the pattern and size"
            )
        return self.views

    @property
    def alike(self) -> int:
        """Number of views dropped as similar to others."""
        return self._gallery.alike

    @property
    def other_sizes(self) -> int:
        """Number of images with a board whose size differs from that of most."""
        return self.found - (self._sizes[self.size] if self.size else 0)

    @property
    def coverage(self) -> Coverage:
        """Coverage of the views."""
        return cover(self.views, self.size or (1, 1))
