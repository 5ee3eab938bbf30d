"""The texts of lessons: paragraphs, and formulas on lines that begin with four spaces."""

from __future__ import annotations

import re
from html import escape
from textwrap import dedent

_FORMULA = "    "


def to_html(text: str) -> str:
    """A text as HTML; whatever it holds is shown as it is written, never as markup.

    Args:
        text: paragraphs between empty lines; one whose lines all begin with four spaces is a
            formula, whose lines stay as they are.
    """
    return "\n".join(_block(block) for block in re.split(r"\n\s*\n", text.strip("\n")) if block)


def _block(block: str) -> str:
    if all(line.startswith(_FORMULA) for line in block.splitlines()):
        return f"<pre>{escape(dedent(block))}</pre>"
    return f"<p>{escape(' '.join(block.split()))}</p>"
