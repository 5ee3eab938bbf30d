"""The last node of a lesson: writes it as one HTML page with its figures."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import is_dataclass
from html import escape
from itertools import chain, count
from pathlib import Path
from typing import Any

import cv2

from ros_visualise.core.errors import OpenError
from ros_visualise.core.params import Spec, plain_of, specs
from ros_visualise.core.paths import may_replace
from ros_visualise.data import Image, Message, Text
from ros_visualise.lessons.lesson import FigureImage, Lesson, Origin
from ros_visualise.lessons.picture import NAME as PICTURE
from ros_visualise.lessons.prose import to_html, without_controls
from ros_visualise.nodes import NoParams, action, node
from ros_visualise.plotting.figure import Figure
from ros_visualise.sinks.files import write_file

NAME = "handout"
PAGE = "index.html"

_STYLE = """body { font: 16px/1.5 sans-serif; max-width: 50em; margin: 2em auto; padding: 0 1em; }
img { width: 100%; } figcaption, .settings { font-size: .8em; }
pre { background: #f2f2f2; padding: .6em 1em; overflow-x: auto; font-size: min(.9rem, 2.9vw); }
dt { font-weight: bold; } dd { margin: 0 0 .5em 1em; }
@media print {
  @page { margin: 18mm; } body { font-size: 10pt; max-width: none; margin: 0; padding: 0; }
  figcaption { display: none; } img { max-height: 105mm; object-fit: contain; }
  h2 { break-after: avoid; } figure, pre, dl { break-inside: avoid; }
  pre { white-space: pre-wrap; font-size: 8.5pt; }
}"""


def handout_of(
    lesson: Lesson, steps: Mapping[str, str], folder: Path, at_end: bool, origin: Origin
) -> Any:
    """The node that writes a lesson.

    Args:
        lesson: to write.
        steps: name of a node -> its description; `image_of` and `text_of` name the inputs.
        folder: for the page; further exports go beside it.
        at_end: write it when the stream ends.
        origin: how the lesson was called.
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
            page = write_page(lesson, steps, self._news, _unused(folder), origin)
            return Text(f"Written: {page}")

        def finish(self) -> Text | None:
            """Write it, if requested."""
            if not at_end:
                return None
            return Text(f"Written: {write_page(lesson, steps, self._news, folder, origin)}")

    return Handout


def image_of(step: str) -> str:
    """Name of the input for a step's image."""
    return f"{step}_image"


def text_of(step: str) -> str:
    """Name of the input for a step's text."""
    return f"{step}_text"


def write_page(
    lesson: Lesson, steps: Mapping[str, str], news: dict[str, Any], folder: Path, origin: Origin
) -> Path:
    """Write a lesson: each figure as PNG and SVG, and a page with them; returns the page.

    Sentences on what can be clicked are omitted. At the end is how the page is made again.

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
                parts.append(_figure(folder, step, heading, news[image_of(step)]))
            if text_of(step) in news:
                parts.append(to_html(without_controls(news[text_of(step)].text)))
        parts.append(_made(lesson.name, origin, steps, news))
        page = folder / PAGE
        write_file(page, _page(f"{lesson.name}: {lesson.about}", parts).encode(), may_replace())
    except OSError as error:
        raise OpenError(f"{folder}: {error.strerror}; choose another folder") from None
    return page


def write_contents(folder: Path, lessons: Sequence[Lesson]) -> None:
    """Write a page with links to lessons in folders of their names; raises as `write_page`."""
    rows = "".join(
        f'<dt><a href="{escape(one.name)}/{PAGE}">{escape(one.name)}</a></dt>'
        f"<dd>{escape(one.about)}</dd>"
        for one in lessons
    )
    page = _page("Lessons", [f"<h1>Lessons</h1><dl>{rows}</dl>"])
    try:
        write_file(folder / PAGE, page.encode(), may_replace())
    except OSError as error:
        raise OpenError(f"{folder}: {error.strerror}; choose another folder") from None


def _made(lesson: str, origin: Origin, steps: Mapping[str, str], news: Mapping[str, Any]) -> str:
    """The source, the inserted nodes, all parameters, and the command that makes the page again."""
    params = {step: getattr(news.get(image_of(step)), "settings", None) for step in steps}
    command = ["ros-visualise", "explain", lesson, *origin.arguments]
    others = [one for one in origin.settings if one.partition(".")[0] not in steps]
    command += [word for one in others for word in ("--set", one)]
    rows = []
    for step, used in params.items():
        values = {spec.name: (_value(getattr(used, spec.name)), spec) for spec in _specs(used)}
        for name, (value, spec) in values.items():
            if value != _value(spec.default):
                command += ["--set", f"{step}.{name}={value}"]
        if values:
            named = ", ".join(f"{name} = {value}" for name, (value, _) in values.items())
            rows.append(f"{escape(step)}: {escape(named)}")
    picture = news.get(image_of(PICTURE))
    stamp_ns = picture.header.stamp_ns if picture is not None else 0
    at = f", at {stamp_ns / 1e9:.3f} s" if stamp_ns else ""
    items = {
        "Source": escape(origin.source + at),
        "Inserted nodes": "<br/>".join(map(escape, origin.nodes)),
        "Parameters": "<br/>".join(rows),
        "Command": f"<code>{escape(shlex.join(command))}</code>",
    }
    rows = [f"<dt>{name}</dt><dd>{text}</dd>" for name, text in items.items() if text]
    return f"<h2>How it was made</h2>\n<dl>{''.join(rows)}</dl>"


def _specs(params: Any) -> Sequence[Spec]:
    return () if params is None or not is_dataclass(params) else specs(params)


def _value(value: Any) -> str:
    """A value of a parameter as it is written in ``--set``."""
    text = str(plain_of(value))
    return text.lower() if isinstance(value, bool) else text


def _figure(folder: Path, name: str, heading: str, image: Image) -> str:
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
        f'<figure><img src="{name}.{shown}" alt="{escape(heading)}"/>'
        f"<figcaption>{links}</figcaption></figure>"
    )


def _page(title: str, parts: Sequence[str]) -> str:
    head = f'<meta charset="utf-8"/><title>{escape(title)}</title><style>{_STYLE}</style>'
    body = "\n".join(parts)
    return f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head><body>\n{body}\n</body></html>\n'


def _unused(folder: Path) -> Path:
    """The folder, or the first free one with a number 2, 3, ... appended."""
    others = (folder.with_name(f"{folder.name}_{n}") for n in count(2))
    return next(one for one in chain([folder], others) if not os.path.lexists(one))
