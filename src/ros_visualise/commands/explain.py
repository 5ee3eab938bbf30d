"""``explain``: a lesson, on the page or written down."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import OpenError
from ros_visualise.core.printing import print_json, print_result, print_status
from ros_visualise.running.arguments import argument, option
from ros_visualise.running.options import PlayingOptions
from ros_visualise.simulation.robots import OURS, ROBOTS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph
    from ros_visualise.lessons.lesson import Lesson
    from ros_visualise.running.graphs import Selection


@dataclass(frozen=True, kw_only=True)
class ExplainOptions(PlayingOptions):
    """Options of ``explain``."""

    topic: str | None = argument(
        "the lesson; without it, all lessons are listed", default=None, nargs="?", metavar="TOPIC"
    )
    input: str | None = argument(
        f"a picture, a video, a recording, {OURS} (default: a sample that fits the lesson)",
        default=None,
        nargs="?",
        metavar="FILE",
    )
    export: Path | None = option(
        None,
        "write the lesson to this folder: one HTML page, and its figures as PNG and SVG",
        metavar="DIR",
    )


def run(options: ExplainOptions) -> int:
    """List the lessons, or play one; the exit status is 1 if data was lost."""
    from ros_visualise.lessons import LESSONS
    from ros_visualise.lessons.handout import PAGE
    from ros_visualise.running.play import play

    if options.topic is None:
        _list(options.json)
        return 0
    lesson = LESSONS.find(options.topic)
    folder = options.export or options.record_dir / f"explain_{lesson.name}"
    selection = _selection(lesson, options.input, folder, options.export is not None)
    if options.export is None:
        is_paused = options.rate is None and not lesson.plays
        return play(selection, replace(options, paused=is_paused))
    page = options.export / PAGE
    made = _prepare(page, options.overwrite)
    try:
        status = play(selection, _written_down(options, lesson))
    finally:
        _remove_empty(made)
    if page.exists():
        print_status(f"{page}: written")
    return status


def _selection(lesson: Lesson, path: str | None, folder: Path, at_end: bool) -> Selection:
    """A lesson on a file, or on another that is opened from the page."""
    from ros_visualise.lessons.pipeline import lesson_pipeline
    from ros_visualise.running.graphs import Selection

    def graph(undo: ExitStack) -> Graph:
        return lesson_pipeline(lesson, path, folder, at_end, undo)

    def another(other: str) -> Selection:
        return _selection(lesson, other, folder, at_end)

    return Selection(lesson.name, graph, path or "", another=another)


def _written_down(options: ExplainOptions, lesson: Lesson) -> ExplainOptions:
    """Options that play as much as a lesson's page needs, without a view."""
    duration, frames = options.duration, options.frames
    if frames is None and duration is None:
        is_recorded = lesson.streams and options.input not in (None, *ROBOTS.names())
        duration = None if is_recorded else lesson.export_s or None
        frames = None if lesson.export_s else 1
    rate = 1.0 if lesson.in_time else 0.0
    return replace(options, view="none", rate=rate, duration=duration, frames=frames)


def _prepare(page: Path, overwrite: bool) -> list[Path]:
    """Make the folder of a page; gives the new folders, the innermost first.

    Raises:
        OpenError: it cannot be made, or is not empty.
    """
    try:
        if page.parent.is_dir() and any(page.parent.iterdir()) and not overwrite:
            raise OpenError(f"{page.parent}: not empty; give another folder or --overwrite")
        missing = [one for one in page.parents if not one.exists()]
        page.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OpenError(f"{page.parent}: {error.strerror}; choose another folder") from None
    return missing


def _remove_empty(folders: list[Path]) -> None:
    """Remove folders, the innermost first, up to one that is not empty."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _list(as_json: bool) -> None:
    from ros_visualise.lessons import LESSONS

    lessons = list(LESSONS.all())
    if as_json:
        print_json({lesson.name: lesson.about for lesson in lessons})
        return
    width = max(len(lesson.name) for lesson in lessons)
    print_result([f"{lesson.name.ljust(width)}  {lesson.about}" for lesson in lessons])


COMMAND = Command(
    "lessons: how it works, step by step, on your own picture or recording", ExplainOptions, run
)
