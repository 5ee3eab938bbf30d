"""Registries: the things of one kind, those of this package and those that other packages bring.

A thing of this package is a module of one folder, named after the thing. Another package brings
things by entry points; in its ``pyproject.toml``:

    [project.entry-points."ros_visualise.nodes"]
    vignette = "my_package.vignette"

where the module, or an attribute of it (``my_package.vignette:NODE``), holds what a module of ours
would. Names are found without importing anything; a plug-in that fails to load is reported once,
and affects no others.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import pkgutil
import sys
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ros_visualise.core.errors import UsageError, did_you_mean
from ros_visualise.core.regular_files import read_file

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

log = logging.getLogger(__name__)

T = TypeVar("T")

GROUP = "ros_visualise."
"""Prefix of the groups of entry points."""


class PluginError(UsageError):
    """A plug-in cannot be loaded."""


@dataclass(frozen=True)
class Plugin:
    """Something that another package brings: its kind, its name, where it is, and whose it is."""

    kind: str
    name: str
    value: str
    package: str
    version: str


@dataclass
class Registry(Generic[T]):
    """The things of one kind.

    Args:
        kind: plural noun, as in the group of entry points, ``ros_visualise.<kind>``.
        folder: package whose modules are the things of this package; empty where all things come
            from others.
        read: gives the thing of a name, from what a module or an entry point holds.
        first: names that come before all others, in this order.
        more: a registry whose things are read for this one too.
    """

    kind: str
    folder: str
    read: Callable[[Any, str], T]
    first: Sequence[str] = ()
    more: Registry[Any] | None = None
    _found: dict[str, T] = field(default_factory=dict)
    _reported: set[str] = field(default_factory=set)

    def names(self) -> list[str]:
        """Names of all things, without importing any of them."""
        return [*self.builtin, *self._entry_points]

    def find(self, name: str) -> T:
        """The thing of this name.

        Raises:
            UsageError: unknown name; the message lists what there is.
            PluginError: the package that brings it cannot be imported, or holds something else.
        """
        if name not in self._found:
            self._found[name] = self._load(name)
        return self._found[name]

    def all(self) -> Iterator[T]:
        """All things that can be loaded; those that cannot are reported once."""
        for name in self.names():
            try:
                yield self.find(name)
            except PluginError as error:
                if name not in self._reported:
                    self._reported.add(name)
                    log.warning("%s; see: ros-visualise plugins", error)

    def plugins(self) -> Iterator[Plugin]:
        """The plug-ins of other packages, without importing any."""
        for entry in _entry_points(self.kind):
            package, version = (entry.dist.name, entry.dist.version) if entry.dist else ("?", "")
            yield Plugin(self.kind, entry.name, entry.value, package, version)

    def failure(self, plugin: Plugin) -> str:
        """Reason why a plug-in cannot be used; empty if it can."""
        if plugin.name in self.builtin:
            return f"the name {plugin.name} is built in; choose another"
        if self._entry_points[plugin.name].value != plugin.value:
            return f"another package also uses the name {plugin.name}"
        try:
            self.find(plugin.name)
        except PluginError as error:
            return _reason(error.__cause__ or error)
        return ""

    @cached_property
    def builtin(self) -> list[str]:
        """Names of the things of this package."""
        own = module_names(self.folder) if self.folder else []
        there = sorted([*own, *(self.more.builtin if self.more else [])])
        return [*self.first, *(name for name in there if name not in self.first)]

    @cached_property
    def _entry_points(self) -> dict[str, EntryPoint]:
        found = {entry.name: entry for entry in _entry_points(self.kind)}
        found |= self.more._entry_points if self.more else {}
        return {name: found[name] for name in sorted(found) if name not in self.builtin}

    def _load(self, name: str) -> T:
        if self.more and name in self.more.names():
            return self.read(self.more.find(name), name)
        if name in self.builtin:
            return self.read(importlib.import_module(f"{self.folder}.{name}"), name)
        if name not in self._entry_points:
            raise UsageError(
                f"no {self.kind.removesuffix('s')} {name!r}{did_you_mean(name, self.names())}"
            )
        entry = self._entry_points[name]
        try:
            return self.read(entry.load(), name)
        except (Exception, SystemExit) as error:
            whose = f"of {entry.dist.name}" if entry.dist else f"at {entry.value}"
            kind, why = self.kind.removesuffix("s"), _reason(error)
            raise PluginError(f"{kind} {name!r} {whose} cannot be loaded: {why}") from error


def holding(kind: type[T], attribute: str) -> Callable[[Any, str], T]:
    """A reader of things that are objects of one type, in modules under one name.

    Args:
        kind: type of the things.
        attribute: what a module calls its thing.
    """

    def read(held: Any, name: str) -> T:
        found = getattr(held, attribute, held)
        if not isinstance(found, kind):
            raise UsageError(f"not a {kind.__name__}; give one, or a module with {attribute}")
        return found

    return read


def module_names(package: str) -> list[str]:
    """Names of the public modules of a package, without importing them or the package."""
    spec = importlib.util.find_spec(package)
    folders = (spec and spec.submodule_search_locations) or []
    return sorted(m.name for m in pkgutil.iter_modules(folders) if not m.name.startswith("_"))


def unknown_groups(kinds: Collection[str]) -> list[tuple[str, str]]:
    """(Group, package) of entry points of ours that are of none of these kinds."""
    from importlib.metadata import distributions

    return sorted(
        {
            (entry.group, package.name)
            for package in distributions()
            for entry in package.entry_points
            if entry.group.startswith(GROUP) and entry.group.removeprefix(GROUP) not in kinds
        }
    )


def _reason(error: BaseException) -> str:
    return str(error) if isinstance(error, UsageError) else f"{type(error).__name__}: {error}"


def _entry_points(kind: str) -> list[EntryPoint]:
    if not _are_any():
        return []
    from importlib.metadata import entry_points

    return list(entry_points(group=f"{GROUP}{kind}"))


@cache
def _are_any() -> bool:
    """True if a package has entry points of ours; importlib.metadata takes ten times as long."""
    for folder in map(Path, dict.fromkeys(sys.path)):
        if folder.is_file():  # a zip file, say
            return True
        for path in folder.glob("*-info/entry_points.txt"):
            with suppress(OSError):
                if f"[{GROUP}".encode() in read_file(path):
                    return True
    return False
