"""Texts of lessons: paragraphs, and formulas on lines indented by four spaces."""

from __future__ import annotations

import re
from html import escape
from textwrap import dedent

_FORMULA = "    "


def to_html(text: str) -> str:
    """A text as HTML, with any markup escaped.

    Args:
        text: paragraphs between empty lines; a paragraph with all lines indented by four spaces is
            a formula, whose lines are kept.
    """
    return "\n".join(_block(block) for block in re.split(r"\n\s*\n", text.strip("\n")) if block)


_ON_THE_PAGE = (
    "Click another pixel",
    "Move the sliders of a step, and all later steps change too",
    "Move the sliders of this step",
    "Turn it in the 3D view",
    "Play, pause, change the rate, and watch them",
    "Drops are counted in the table of topics",
    "The main panel shows [^.]*",
    "The 3D view shows [^.]*",
)
"""Sentences about what a person can do on the live page."""

_CONTROLS = re.compile(rf"\s*\b({'|'.join(_ON_THE_PAGE)})\.".replace(" ", r"\s+"))


def without_controls(text: str) -> str:
    """A text without the sentences that make no sense on paper."""
    return _CONTROLS.sub("", text)


def _block(block: str) -> str:
    if all(line.startswith(_FORMULA) for line in block.splitlines()):
        return f'<pre tabindex="0">{escape(dedent(block))}</pre>'  # so that keys scroll it
    return f"<p>{escape(' '.join(block.split()))}</p>"
