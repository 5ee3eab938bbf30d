"""``explain``: a lesson, on the page or written down."""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from ros_visualise.commands import Command
from ros_visualise.core.errors import OpenError, UsageError
from ros_visualise.core.printing import print_json, print_result, print_status
from ros_visualise.core.signals import STOPPED
from ros_visualise.running.arguments import argument, option
from ros_visualise.running.options import PlayingOptions
from ros_visualise.simulation.robots import OURS, ROBOTS

if TYPE_CHECKING:
    from ros_visualise.graph import Graph
    from ros_visualise.lessons.lesson import Lesson, Origin
    from ros_visualise.running.graphs import Selection

_ALL = "all"


@dataclass(frozen=True, kw_only=True)
class ExplainOptions(PlayingOptions):
    """Options of ``explain``."""

    topic: str | None = argument(
        "lesson to show; if omitted, all lessons are listed (with --export: exported)",
        default=None,
        nargs="?",
        metavar="TOPIC",
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
    pdf: bool = option(
        False, "also write the exported pages as PDF; needs Chromium, Chrome or Edge"
    )


def run(options: ExplainOptions) -> int:
    """List the lessons, play one, or write them; the exit status is 1 if data was lost."""
    from ros_visualise.lessons import LESSONS
    from ros_visualise.running.play import play

    if options.topic is None:
        _list(options.json)
        return 0
    if options.export is not None:
        return _export(options, options.export)
    if options.topic == _ALL or options.pdf:
        given = f"explain {_ALL}" if options.topic == _ALL else "--pdf"
        raise UsageError(f"{given}: add --export DIR")
    lesson = LESSONS.find(options.topic)
    folder = options.record_dir / f"explain_{lesson.name}"
    is_paused = options.rate is None and not lesson.plays
    selection = _selection(lesson, options, folder)
    return play(selection, replace(options, paused=is_paused))


def _export(options: ExplainOptions, folder: Path) -> int:
    """Write one lesson, or all with a list of them."""
    from ros_visualise.lessons import LESSONS
    from ros_visualise.lessons.handout import PAGE, write_contents
    from ros_visualise.lessons.printing import find_browser, print_page

    browser = find_browser() if options.pdf else ""
    if options.topic != _ALL:
        lessons = {PAGE: LESSONS.find(str(options.topic))}
    else:
        lessons = {f"{one.name}/{PAGE}": one for one in LESSONS.all()}
    pages = [folder / name for name in lessons]
    made = _prepare(folder / PAGE, options.overwrite)
    worst = 0
    try:
        for page, lesson in zip(pages, lessons.values(), strict=True):
            worst = max(worst, _write(lesson, options, page.parent))
            if worst == STOPPED:
                break
        if options.topic == _ALL:
            write_contents(
                folder, [one for one in lessons.values() if (folder / one.name).exists()]
            )
            pages.append(folder / PAGE)
    finally:
        _remove_empty(made)
    for page in filter(Path.exists, pages):
        if browser:
            print_status(f"{print_page(browser, page)}: written")
        print_status(f"{page}: written")
    return worst


def _write(lesson: Lesson, options: ExplainOptions, folder: Path) -> int:
    """Write one lesson; of all, those that do not take the given file explain their sample."""
    from ros_visualise.running.play import play

    try:
        selection = _selection(lesson, options, folder, True)
        return play(selection, _written_down(options, lesson))
    except OpenError as error:
        if options.topic != _ALL or options.input is not None:
            raise
        print_status(f"ros-visualise: {lesson.name}: {error}")
        return 1
    except UsageError as error:
        if options.topic != _ALL or options.input is None:
            raise
        print_status(f"ros-visualise: {lesson.name}: {error}; using its sample instead")
        return _write(lesson, replace(options, input=None), folder)


def _selection(
    lesson: Lesson, options: ExplainOptions, folder: Path, at_end: bool = False
) -> Selection:
    """A lesson on the file of the options, or on another that is opened from the page."""
    from ros_visualise.lessons.pipeline import lesson_pipeline
    from ros_visualise.running.graphs import Selection

    def graph(undo: ExitStack) -> Graph:
        origin = _origin(lesson, options)
        return lesson_pipeline(lesson, options.input, folder, at_end, undo, origin)

    def another(other: str) -> Selection:
        return _selection(lesson, replace(options, input=other), folder, at_end)

    return Selection(lesson.name, graph, options.input or "", another=another)


def _origin(lesson: Lesson, options: ExplainOptions) -> Origin:
    from ros_visualise.lessons.lesson import Origin
    from ros_visualise.lessons.pipeline import sample_of

    words = [options.input] if options.input else []
    pairs = [("--node", one) for one in options.node]
    if options.start:
        pairs.append(("--start", f"{options.start:g}"))
    if options.params:
        pairs.append(("--params", str(options.params)))
    if options.preset:
        pairs.append(("--preset", options.preset))
    words += [word for pair in pairs for word in pair]
    source = options.input or sample_of(lesson)
    return Origin(source, tuple(words), tuple(options.node), tuple(options.set))


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
