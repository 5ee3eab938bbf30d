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


def _block(block: str) -> str:
    if all(line.startswith(_FORMULA) for line in block.splitlines()):
        return f"<pre>{escape(dedent(block))}</pre>"
    return f"<p>{escape(' '.join(block.split()))}</p>"
