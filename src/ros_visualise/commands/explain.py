"""Giving a lesson: on the page, or written down."""

from __future__ import annotations

import json
from argparse import Namespace
from contextlib import suppress
from pathlib import Path

from ros_visualise.commands import play
from ros_visualise.errors import OpenError
from ros_visualise.lessons import LESSONS
from ros_visualise.lessons.handout import PAGE
from ros_visualise.printing import answer, say
from ros_visualise.simulation.robots import ROBOTS


def run(args: Namespace) -> int:
    """List the lessons, or give one; 1 if something was lost."""
    if args.topic is None:
        _list(args.json)
        return 0
    lesson = LESSONS.find(args.topic)
    if args.export is None:
        args.paused = args.rate is None and not lesson.plays
        return play.run(args)
    page = args.export / PAGE
    made = _prepare(page, args.overwrite)
    args.view = "none"
    args.rate = 1.0 if lesson.in_time else 0.0
    if args.frames is None and args.duration is None:
        is_recorded = lesson.streams and args.input not in (None, *ROBOTS.names())
        args.duration = None if is_recorded else lesson.export_s or None
        args.frames = None if lesson.export_s else 1
    try:
        status = play.run(args)
    finally:
        _remove_empty(made)
    if page.exists():
        say(f"{page}: written")
    return status


def _prepare(page: Path, overwrite: bool) -> list[Path]:
    """Make the folder of a page; those that were made for it, the innermost first.

    Raises:
        OpenError: that cannot be done, or there are files in it already.
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
    """Remove folders, the innermost first, up to one that something was written into."""
    with suppress(OSError):
        for folder in folders:
            folder.rmdir()


def _list(as_json: bool) -> None:
    lessons = list(LESSONS.all())
    if as_json:
        answer([json.dumps({lesson.name: lesson.about for lesson in lessons})])
        return
    width = max(len(lesson.name) for lesson in lessons)
    answer([f"{lesson.name.ljust(width)}  {lesson.about}" for lesson in lessons])
