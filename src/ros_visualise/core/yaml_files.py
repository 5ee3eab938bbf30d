"""YAML files, read so that none can take more than a moment and a little memory.

An alias (``*name``) counts as many values as what it names: a few lines can stand for billions of
values, which programs then look at one by one.
"""

from __future__ import annotations

from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.composer import Composer
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.events import AliasEvent, ScalarEvent

from ros_visualise.core.errors import OpenError
from ros_visualise.core.regular_files import open_file

MOST_VALUES = 1 << 15  # the metadata of a bag of 4,000 files has less; takes a second or two
MANY_VALUES = 1 << 17  # of what holds matrices of numbers: a map of 2,000 landmarks has less
_VALUE_BYTES = 32
_DEEPEST = 50
_LONGEST_PLAIN = 1 << 16  # of what may be a number, which takes long to make of many digits


class BadYaml(ValueError):
    """Invalid YAML, or too much of it; the message says why."""


def load_yaml(path: Path, most_values: int = MOST_VALUES) -> Any:
    """The values in a file.

    Args:
        path: of the file.
        most_values: that it may hold; on average they may be 32 bytes long.

    Raises:
        OSError: it cannot be read.
        BadYaml: it is no YAML, or too large.
    """
    with open_file(path) as file:
        data = file.read(most_values * _VALUE_BYTES + 1)
    return parse_yaml(data, most_values)


def open_yaml(path: str | Path, advice: str, most_values: int = MOST_VALUES) -> Any:
    """The values in a file that a user named.

    Args:
        path: of the file.
        advice: what to give instead.
        most_values: as in `load_yaml`.

    Raises:
        OpenError: the file is missing, unreadable or not YAML.
    """
    try:
        return load_yaml(Path(path), most_values)
    except FileNotFoundError:
        raise OpenError.missing(path, advice) from None
    except OSError as error:
        raise OpenError(f"{path}: {error.strerror}; {advice}") from None
    except BadYaml as error:
        raise OpenError(f"{path}: not YAML: {error}; {advice}") from None


def parse_yaml(data: bytes, most_values: int = MOST_VALUES) -> Any:
    """The values in a text.

    Raises:
        BadYaml: it is no YAML, or too large.
    """
    most_bytes = most_values * _VALUE_BYTES
    if len(data) > most_bytes:
        raise BadYaml(f"more than {most_bytes >> 20} MiB; remove what is not needed")
    yaml: Any = YAML(typ="safe", pure=True)  # in Python alone, so that Ctrl-C need not wait for it
    yaml.Composer = partial(_Composer, most_values=most_values)
    try:
        return yaml.load(data.decode())
    except MarkedYAMLError as error:
        line = f" in line {error.problem_mark.line + 1}" if error.problem_mark else ""
        raise BadYaml(f"{error.problem}{line}") from None
    except (YAMLError, ValueError, RecursionError):  # such as a number of a million digits
        raise BadYaml("give a text file of keys and values") from None


def to_yaml(values: Any) -> str:
    """Values as a text that readers of YAML 1.1, as ROS has, and of 1.2 read alike."""
    yaml = YAML(typ="safe", pure=True)
    yaml.version = (1, 1)
    yaml.default_flow_style = False
    text = StringIO()
    yaml.dump(values, text)
    return text.getvalue()


class _Composer(Composer):
    """Counts the values while they are put together, and stops where they are too many."""

    def __init__(self, loader: Any = None, most_values: int = MOST_VALUES) -> None:
        super().__init__(loader=loader)
        self._most = most_values
        self._values = self._depth = 0
        self._sizes: dict[str, int] = {}

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.parser.peek_event()
        before = self._values
        self._values += self._size(event)
        self._depth += 1
        if self._depth > _DEEPEST:
            raise _refused(f"nested more than {_DEEPEST} deep", event)
        if self._values > self._most:
            raise _refused(f"more than {self._most} values", event)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if event.anchor and not isinstance(event, AliasEvent):
            self._sizes[event.anchor] = self._values - before
        return node

    def _size(self, event: Any) -> int:
        """Number of values that an event stands for; too many if it is named within itself."""
        if isinstance(event, AliasEvent) and event.anchor in self.anchors:
            return self._sizes.get(event.anchor, self._most)
        is_plain = isinstance(event, ScalarEvent) and event.implicit[0]
        if is_plain and len(event.value) > _LONGEST_PLAIN:
            raise _refused(f"an unquoted value of more than {_LONGEST_PLAIN} characters", event)
        return 1


def _refused(why: str, event: Any) -> MarkedYAMLError:
    return MarkedYAMLError(problem=why, problem_mark=event.start_mark)
