"""What people read is plain English, in the field's words."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from texts import ROOT, texts

FIRST = re.compile(r"(Of|That|As|Whether|What|Where|Who|Whose|Which|How|So|To)\b(?!-)")
"""Words by which no docstring begins: its first line says what the thing is or does."""

TURNS = re.compile(
    r"""\b(
    told | telling | left\ out | leav(e|es|ing)\ (it\ |them\ |this\ |that\ )?out
    | there\ (is|are)\ none | is\ not\ there | has\ none | there\ is\ no\ such
    | that\ there\ (is|are)
    | (not|is)\ known\ here | said\ once | (is|are)\ only\ counted | how\ sure | sureness
    | somebody | whoever | whosoever | of\ which | nothing\ but | all\ the\ same | none\ of\ that
    | turned\ aside | turn\ rate | in\ haste | in\ use\ already | already\ there | gave\ up
    | manieth
    | as\ (it|they)\ (is|are)\ set | as\ it\ was | of\ its\ own\ accord | one's\ own | yours
    | find\ out\ where | knows\ where | doubts? | second\ look | by\ sight | is\ driven
    | before\ the\ camera | has\ no\ place | is\ for\ a\ map | or\ then | with\ nothing\ to\ hand
    | cannot\ be\ (theirs|its|their\ own) | mend(ed|s)? | here\ is\ no | (is|are)\ gone
    | wishes | would\ have\ it | at\ hand | to\ be\ had | is\ wanted\ of | is\ taken\ for
    | is\ no\ (number|field|pressure|image|rotation) | only\ looks | the\ present\ one | as\ asked
    | picture\ before | that\ is\ said | there\ twice | each\ n-th
    | opens\ no\ files | takes\ no\ messages | of\ air
    | as\ it\ (stands|comes) | as\ they\ (stand|come) | takes\ up | lets?\ go
    )\b""",
    re.VERBOSE | re.IGNORECASE,
)
"""Turns of phrase that readers had to read twice."""

FILES = sorted(path for kind in ("py", "js", "html") for path in ROOT.rglob(f"*.{kind}"))


def strings(path: Path) -> Iterator[tuple[int, str, bool]]:
    """(Line, text, is a docstring) of each string of a Python file; another file is one string."""
    if path.suffix != ".py":
        yield 1, path.read_text(), False
        return
    tree = ast.parse(path.read_text())
    docstrings = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.lineno, " ".join(node.value.split()), id(node) in docstrings


def test_sentences_are_read_once():
    for path in FILES:
        for line, text, is_docstring in strings(path):
            where = f"{path.relative_to(ROOT)}:{line}"
            assert not (is_docstring and FIRST.match(text)), f"{where}: {text[:80]}"
            if found := TURNS.search(text):
                raise AssertionError(
                    f"{where}: {text[max(0, found.start() - 40) : found.end() + 40]}"
                )


def test_arguments_of_launch_files_are_read_once():
    said = [one for one in texts() if one.where.startswith("launch/")]
    assert len(said) > 300
    assert [one for one in said if TURNS.search(one.text)] == []


def test_listing_has_texts_of_every_kind():
    said = {one.text for one in texts()}
    assert {
        "upper threshold of the hysteresis",  # a parameter
        "start again when the end is reached (loop)",  # an option
        "play a video file",  # a command
        "calibrate from the views so far",  # an action
        "Detects edges (mono8) and, on demand, draws them over the image.",  # a node
        "{path}: no topic {name}; choose from {', '.join(topics)}",  # an error
        "Find a parameter",  # the page
    } <= said
