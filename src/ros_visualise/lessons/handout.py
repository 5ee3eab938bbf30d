"""The last node of a lesson: writes it as one HTML page with its figures."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from html import escape
from itertools import chain, count
from pathlib import Path
from typing import Any

import cv2

from ros_visualise.core.errors import OpenError
from ros_visualise.core.paths import may_replace
from ros_visualise.data import Image, Message, Text
from ros_visualise.lessons.lesson import FigureImage, Lesson
from ros_visualise.lessons.prose import to_html
from ros_visualise.nodes import NoParams, action, node
from ros_visualise.plotting.figure import Figure
from ros_visualise.sinks.files import write_file

NAME = "handout"
PAGE = "index.html"

_STYLE = """body { font: 16px/1.5 sans-serif; max-width: 50em; margin: 2em auto; padding: 0 1em; }
img { width: 100%; } figcaption { font-size: .8em; }
pre { background: #f2f2f2; padding: .6em 1em; overflow-x: auto; font-size: min(.9rem, 2.9vw); }"""


def handout_of(lesson: Lesson, steps: Mapping[str, str], folder: Path, at_end: bool) -> Any:
    """The node that writes a lesson.

    Args:
        lesson: to write.
        steps: name of a node -> its description; `image_of` and `text_of` name the inputs.
        folder: for the page; further exports go beside it.
        at_end: write it when the stream ends.
    """
    inputs: dict[str, type[Message]] = {image_of(step): Image for step in steps}
    inputs |= {text_of(step): Text for step in steps}

    @node(NAME, inputs=inputs, outputs={"text": Text})
    class Handout:
        """Writes the lesson as one HTML page with its figures."""

        def __init__(self, _: NoParams) -> None:
            self._news: dict[str, Any] = {}

        def step(self, params: NoParams, **news: Any) -> None:
            """Keep the newest messages."""
            self._news |= news

        @action("write this lesson as a web page with its figures")
        def export(self) -> Text:
            """Write it to a new folder."""
            return Text(f"Written: {write_page(lesson, steps, self._news, _unused(folder))}")

        def finish(self) -> Text | None:
            """Write it, if requested."""
            if not at_end:
                return None
            return Text(f"Written: {write_page(lesson, steps, self._news, folder)}")

    return Handout


def image_of(step: str) -> str:
    """Name of the input for a step's image."""
    return f"{step}_image"


def text_of(step: str) -> str:
    """Name of the input for a step's text."""
    return f"{step}_text"


def write_page(
    lesson: Lesson, steps: Mapping[str, str], news: dict[str, Any], folder: Path
) -> Path:
    """Write a lesson: each figure as PNG and SVG, and a page with them; returns the page.

    Raises:
        OpenError: it cannot be written, or exists and must not be replaced.
        RecordingError: it could not be written completely.
    """
    parts = [f"<h1>{escape(lesson.name)}: {escape(lesson.about)}</h1>"]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for step, heading in steps.items():
            parts.append(f"<h2>{escape(heading)}</h2>")
            if image_of(step) in news:
                parts.append(_figure(folder, step, news[image_of(step)]))
            if text_of(step) in news:
                parts.append(to_html(news[text_of(step)].text))
        page = folder / PAGE
        write_file(page, _page(lesson, parts).encode(), may_replace())
    except OSError as error:
        raise OpenError(f"{folder}: {error.strerror}; choose another folder") from None
    return page


def _figure(folder: Path, name: str, image: Image) -> str:
    """Write the image of a step in both formats; returns the HTML that shows it."""
    _, png = cv2.imencode(".png", image.pixels)
    write_file(folder / f"{name}.png", bytes(png), may_replace())
    if isinstance(image.data, FigureImage):
        figure, shown = image.data.figure, "svg"
    else:
        figure, shown = Figure(image.width, image.height), "png"
        figure.picture((0, 0, image.width, image.height), image.pixels)
    write_file(folder / f"{name}.svg", figure.svg(), may_replace())
    links = " ".join(f'<a href="{name}.{kind}">{kind.upper()}</a>' for kind in ("png", "svg"))
    return (
        f'<figure><img src="{name}.{shown}" alt="{escape(name)}"/>'
        f"<figcaption>{links}</figcaption></figure>"
    )


def _page(lesson: Lesson, parts: Sequence[str]) -> str:
    head = f'<meta charset="utf-8"/><title>{escape(lesson.name)}</title><style>{_STYLE}</style>'
    return (
        f"<!DOCTYPE html>\n<html><head>{head}</head><body>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _unused(folder: Path) -> Path:
    """The folder, or the first free one with a number 2, 3, ... appended."""
    others = (folder.with_name(f"{folder.name}_{n}") for n in count(2))
    return next(one for one in chain([folder], others) if not os.path.lexists(one))
