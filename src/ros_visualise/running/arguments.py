"""A command's arguments, declared once: the fields of a frozen dataclass.

    @dataclass(frozen=True, kw_only=True)
    class ShowOptions(MemoryOptions):
        input: str = argument("the recording", metavar="FILE")
        topics: Sequence[str] = option([], "play only this topic; repeatable", metavar="TOPIC")
        loop: bool = option(False, "start again at the end")

The type of a field decides how it is read: a bool is a switch (``--no-NAME`` if it is True by
default; ``--NAME`` and ``--no-NAME`` if it may be None), a sequence is repeatable, a number or a
path is parsed. Inherited fields follow those of the class; ``GROUP`` is the heading of a class's
fields in ``--help``. Light to import.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, ArgumentTypeError, BooleanOptionalAction
from collections.abc import Callable
from dataclasses import MISSING, Field, field, fields
from pathlib import Path
from typing import Any, get_type_hints

from ros_visualise.core.errors import UsageError
from ros_visualise.core.limits import MAX_TAG_M, parse_memory
from ros_visualise.core.rate import MAX_RATE

_MAX_S = 1e9  # thirty years; with more, stamps are beyond what ROS holds


def option(
    default: Any,
    help: str,
    *,
    flag: str = "",
    completer: Callable[..., Any] | None = None,
    **settings: Any,
) -> Any:
    """An option of a command.

    Args:
        default: its value if it is not given; a list's is copied.
        help: its line in ``--help``.
        flag: its name on the command line, if that is not the field's.
        completer: completes its value in a shell, as argcomplete calls it.
        settings: as of `ArgumentParser.add_argument`, before those that its type gives.
    """
    metadata = {"help": help, "flag": flag, "completer": completer, "settings": settings}
    if isinstance(default, list):
        return field(default_factory=lambda: [*default], metadata=metadata)
    return field(default=default, metadata=metadata)


def argument(help: str, *, default: Any = MISSING, **settings: Any) -> Any:
    """A positional argument of a command; see `option`."""
    metadata = {"help": help, "flag": None, "completer": None, "settings": settings}
    return field(default=default, metadata=metadata)


def add_arguments(parser: ArgumentParser, options: type) -> None:
    """Add all fields of a command's options to its parser."""
    types = get_type_hints(options)
    declared = {one.name: one for one in fields(options) if "help" in one.metadata}
    groups: dict[str, Any] = {"": parser}
    for cls in options.__mro__:
        heading = vars(cls).get("GROUP", "")
        for name in vars(cls).get("__annotations__", {}):
            if one := declared.pop(name, None):
                if heading not in groups:
                    groups[heading] = parser.add_argument_group(heading)
                _add(groups[heading], one, types[name])


def _add(group: Any, one: Field[Any], kind: Any) -> None:
    flag, settings = one.metadata["flag"], dict(one.metadata["settings"])
    default = one.default if one.default_factory is MISSING else one.default_factory()
    settings = {"help": one.metadata["help"], **_reading(kind, default), **settings}
    if flag is None:
        names = [one.name]
    else:
        is_off = settings.get("action") == "store_false"
        name = one.name.replace("_", "-")
        names = [flag or (f"--no-{name}" if is_off else f"--{name}")]
        settings["dest"] = one.name
    if default is not MISSING:
        settings["default"] = default
    group.add_argument(*names, **settings).completer = one.metadata["completer"]


def _reading(kind: Any, default: Any) -> dict[str, Any]:
    """Settings by which the values of a type are read."""
    kinds = {*getattr(kind, "__args__", [kind])}
    if bool in kinds:
        if type(None) in kinds:
            return {"action": BooleanOptionalAction}
        return {"action": "store_false" if default else "store_true"}
    if isinstance(default, list):
        return {"action": "append"}
    return next(({"type": one} for one in (Path, float, int) if one in kinds), {})


def parse_setting(text: str, hint: Callable[[str], str] = lambda key: "") -> tuple[str, str, str]:
    """Node, parameter and value of ``--set``.

    Raises:
        UsageError: another form; ``hint`` of what is before the ``=`` ends the message.
    """
    key, equals, value = text.partition("=")
    node, dot, param = key.partition(".")
    if not (equals and dot):
        raise UsageError(f"--set {text}: give NODE.PARAM=VALUE{hint(key)}")
    return node, param, value


def _checked(
    kind: type[int] | type[float], accept: Callable[[float], bool], words: str
) -> Callable[[str], float]:
    def parse(text: str) -> float:
        try:
            number = kind(text)
        except ValueError:
            number = math.nan
        if not accept(number):
            raise ArgumentTypeError(f"{text!r} is not {words}")
        return number

    return parse


not_negative = _checked(float, lambda n: 0 <= n <= _MAX_S, f"a number from 0 to {_MAX_S:g}")
positive = _checked(float, lambda n: 0 < n <= _MAX_S, f"a number above 0, up to {_MAX_S:g}")
tag_size = _checked(float, lambda n: 0 < n <= MAX_TAG_M, f"a number above 0, up to {MAX_TAG_M:g}")
seed = _checked(int, lambda n: 0 <= n < 2**31, "a whole number from 0 to 2147483647")
plot_width = _checked(float, lambda n: 60 <= n <= 1000, "a number from 60 to 1000")
rate = _checked(float, lambda n: 0 <= n <= MAX_RATE, f"a number from 0 to {MAX_RATE}")
count = _checked(int, lambda n: n >= 1, "a whole number of at least 1")
port = _checked(int, lambda n: 1 <= n <= 65535, "a port from 1 to 65535")


def memory(text: str) -> int:
    """A size, as 4G."""
    try:
        return parse_memory(text)
    except UsageError as error:
        raise ArgumentTypeError(str(error)) from None


def period(text: str) -> float:
    """A time in seconds, as 90, 90s, 10m or 1h."""
    units = {"s": 1, "m": 60, "h": 3600}
    unit = units.get(text[-1:], 0)
    return not_negative(text[:-1]) * unit if unit else not_negative(text)


def folder(text: str) -> Path:
    """The name of a folder."""
    if not text:
        raise ArgumentTypeError("give the name of a folder, such as '.' for the current one")
    return Path(text)
