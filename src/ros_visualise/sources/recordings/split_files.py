"""Recordings that consist of several files."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing, suppress
from pathlib import Path
from typing import Any, TypeVar

from ros_visualise.core.errors import OpenError
from ros_visualise.sources.recordings import Loss
from ros_visualise.sources.recordings.schemas import Schemas
from ros_visualise.sources.recordings.storage import Storage, add_note

S = TypeVar("S", bound=Storage)


def natural(file: Path) -> list[Any]:
    """Orders ``bag_10`` after ``bag_9``."""
    return [
        (int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", file.name)
    ]


def missing_parts(files: Sequence[Path]) -> list[str]:
    """The names between those of a bag that was split: ``bag_1.db3`` of ``bag_0`` and ``bag_2``."""
    parts = [re.fullmatch(r"(.*_)(\d+)(\..*)", file.name) for file in files]
    numbers = {(part[1], part[3], int(part[2])) for part in parts if part}
    if len(numbers) < len(files) or len({number[:2] for number in numbers}) != 1:
        return []
    [(stem, suffix, _), *_] = numbers
    last = max(number for *_, number in numbers)
    if last >= 2 * len(files):  # these count something else, such as days
        return []
    return [f"{stem}{n}{suffix}" for n in range(last) if (stem, suffix, n) not in numbers]


def open_storages(
    path: Path,
    files: Sequence[Path],
    open_file: Callable[[Path, Schemas, Loss, str], S],
    loss: Loss,
    stack: ExitStack,
) -> list[S]:
    """Open the files of a recording; those that cannot be opened are a loss.

    Args:
        path: of the recording.
        open_file: opens one, as `SqliteFile` does it.
        stack: closes them.

    Raises:
        OpenError: none can be opened.
    """
    schemas = Schemas()
    storages: list[S] = []
    failures: list[str] = []
    for file in files:
        try:
            label = "" if file == path else f"{file.name}: "
            storages.append(stack.enter_context(closing(open_file(file, schemas, loss, label))))
        except OpenError as error:
            failures.append(str(error))
            add_note(loss, str(error).replace(f"{file}: ", f"{file.name}: "))
            with suppress(OSError):  # a link to a file that is not there
                loss.bytes += file.stat().st_size
    if not storages:
        raise OpenError(failures[0])
    return storages
