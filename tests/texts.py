"""All texts that people read, in one listing: ``python tests/texts.py``.

Help of parameters, options, commands and actions, first lines of nodes' docstrings, messages with
their placeholders in braces, labels of the page, and arguments of the launch files.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import ros_visualise

ROOT = Path(ros_visualise.__file__).parent
DECLARES = {"node", "source", "simulated"}
PROSE = re.compile(r"[A-Za-z]{2}.* .*[A-Za-z]{2}")
LABEL = re.compile(r"[A-Z][a-z]{2,}")
"""A label of one word, on the page."""

CODE = re.compile(
    r"\\[dwsbA(\[]|\(\?|</|/>|^[\w ]+ = |==|&&|\|\||=>|;$|px\b|var\(--|^[a-z -]+: [a-z0-9]"
    r"|^(SELECT|WITH|PRAGMA|COPY|CREATE|EXPLAIN) |\$event|^[a-z]\w*\(|/[A-Z]\w+ [/\[{]"
)
"""What is no prose: a regular expression, markup, a statement, a style, SQL, PDF."""

ARGUMENT = re.compile(r"""<arg [^>]*(?:doc|description)="([^"]*)\"""")
QUOTED = re.compile(r"""(["'`])((?:(?!\1)[^\\]|\\.)*?)\1""")


class Text(NamedTuple):
    """A text: its file and line, and what it says."""

    where: str
    text: str


def texts() -> Iterator[Text]:
    """All texts, by file."""
    for path in sorted(ROOT.rglob("*.py")):
        yield from _python(path)
    for path in sorted([*ROOT.rglob("*.js"), *ROOT.rglob("*.html")]):
        yield from _page(path)
    for path in sorted((ROOT.parents[1] / "launch").glob("*.launch*")):
        for number, line in enumerate(path.read_text().splitlines(), 1):
            for text in ARGUMENT.findall(line):
                yield Text(f"launch/{path.name}:{number}", text)


def _python(path: Path) -> Iterator[Text]:
    file, skipped = path.relative_to(ROOT), set()
    for node in ast.walk(ast.parse(path.read_text())):  # parents first
        if isinstance(node, ast.Expr):
            skipped.add(node.value)
        elif isinstance(node, ast.Assert) and node.msg is not None:
            skipped.add(node.msg)
        elif isinstance(node, ast.JoinedStr):
            skipped.update(one for one in ast.walk(node) if one is not node)
        if isinstance(node, ast.Constant | ast.JoinedStr) and node not in skipped:
            said = " ".join(_template(node).split())
            if _is_prose(path, said):
                yield Text(f"{file}:{node.lineno}", said)
        elif isinstance(node, ast.ClassDef | ast.FunctionDef) and node.decorator_list:
            decorators = {ast.unparse(one).partition("(")[0] for one in node.decorator_list}
            if DECLARES & decorators and (doc := ast.get_docstring(node)):
                yield Text(f"{file}:{node.lineno}", doc.partition("\n")[0])


def _is_prose(path: Path, said: str) -> bool:
    is_label = "ui" in path.parts and LABEL.fullmatch(said)
    return bool(is_label or (PROSE.search(said) and not CODE.search(said)))


def _template(node: ast.AST) -> str:
    """A string, or an f-string with what it inserts in braces."""
    if isinstance(node, ast.JoinedStr):
        return "".join(map(_template, node.values))
    if isinstance(node, ast.FormattedValue):
        return f"{{{ast.unparse(node.value)}}}"
    value = getattr(node, "value", "")
    return value if isinstance(value, str) else ""


def _page(path: Path) -> Iterator[Text]:
    for number, line in enumerate(path.read_text().splitlines(), 1):
        for _, said in QUOTED.findall(line.partition("// ")[0]):
            if _is_prose(path, said):
                yield Text(f"{path.relative_to(ROOT)}:{number}", said)


if __name__ == "__main__":
    for one in texts():
        print(f"{one.where}\t{one.text}")
