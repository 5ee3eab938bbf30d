"""The documentation: README.md and docs, and the commands in them."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[1]
DOCUMENTS = (PACKAGE / "README.md", *sorted((PACKAGE / "docs").glob("[!_g]*/*.md")))
_BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.MULTILINE | re.DOTALL)
_ENDS = {";", "&&", "||", "|", "&", "(", ")"}


def block(command: str, language: str = "sh") -> str:
    """The one block of code with this text in it."""
    blocks = [text for path in DOCUMENTS for kind, text in _blocks(path) if kind == language]
    [found] = [text for text in blocks if command in text]
    return found


def quoted(beginning: str) -> str:
    """The one command within the text that begins so."""
    text = "\n".join(path.read_text() for path in DOCUMENTS)
    [found] = set(re.findall(f"`({re.escape(beginning)}[^`]*)`", text))
    return str(found)


def steps(path: Path) -> Iterator[tuple[str, str, str]]:
    """(Language, text, name of the file that the sentence before names) of each block of code."""
    text = path.read_text()
    for found in _BLOCK.finditer(text):
        named = re.findall("`([^`]+)`", text[: found.start()].rstrip().rpartition("\n\n")[2])
        yield found[1], found[2].replace("\\\n", " "), named[-1] if named else ""


def prose(path: Path) -> str:
    """A document without its blocks of code."""
    return _BLOCK.sub("", path.read_text())


def commands(path: Path, program: str) -> Iterator[list[str]]:
    """The words of each call of a program, in blocks of shell commands and within the text."""
    lines = [text for kind, text in _blocks(path) if kind == "sh"]
    lines += re.findall(r"`([^`]+)`", prose(path).replace("\n", " "))
    for text in lines:
        for line in text.replace("\\\n", " ").replace('"$(', ";").replace(')"', ";").splitlines():
            words = shlex.shlex(line, posix=True, punctuation_chars=True)
            words.whitespace_split = True
            yield from _calls(list(words) if program in line else [], program)


def _calls(words: list[str], program: str) -> Iterator[list[str]]:
    for at, word in enumerate(words):
        if word == program and (at == 0 or words[at - 1] in _ENDS | {"do"}):
            rest = words[at + 1 :]
            end = next((n for n, one in enumerate(rest) if one in _ENDS), len(rest))
            yield rest[:end]


def _blocks(path: Path) -> list[tuple[str, str]]:
    return _BLOCK.findall(path.read_text())
