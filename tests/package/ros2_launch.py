"""A reader of ROS 2 launch files in XML, of as much of the format as ours have.

It needs no ROS. What it says was compared with what ``ros2 launch`` starts.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree import ElementTree

import yaml
from launched import LAUNCH, NEEDED, PACKAGE, LaunchedGraph, effective

_NAMED = re.compile(r"\$\((var|find-pkg-share|find-pkg-prefix) ([\w-]+)\)")
_EVAL = re.compile(r"\$\(eval '((?:\\.|[^'\\])*)'\)")


class Refused(Exception):
    """An argument is none of the choices."""


class NotInstalled(Exception):
    """A package is missing."""


@dataclass(frozen=True)
class Node:
    """What is started; its name with its namespace."""

    name: str
    package: str
    type: str
    args: str
    params: dict[str, Any]
    remaps: list[tuple[str, str]]

    @property
    def namespace(self) -> str:
        return self.name.rpartition("/")[0]


@dataclass
class Scope:
    """What holds for the following elements, up to the end of the group."""

    values: dict[str, str]
    params: dict[str, Any] = field(default_factory=dict)
    remaps: list[tuple[str, str]] = field(default_factory=list)
    namespace: str = ""
    missing: frozenset[str] = frozenset()

    def copied(self) -> Scope:
        return replace(
            self, values=dict(self.values), params=dict(self.params), remaps=list(self.remaps)
        )

    def text(self, text: str) -> str:
        """A text with all that is substituted."""
        return _NAMED.sub(self._named, _EVAL.sub(self._computed, text))

    def holds(self, element: ElementTree.Element) -> bool:
        return (
            self.text(element.get("if", "true")).lower() == "true"
            and self.text(element.get("unless", "false")).lower() == "false"
        )

    def _computed(self, match: re.Match[str]) -> str:
        expression = _NAMED.sub(self._named, re.sub(r"\\(.)", r"\1", match[1]))
        return str(eval(expression, {}, vars(math)))

    def _named(self, match: re.Match[str]) -> str:
        what, name = match.groups()
        if what == "find-pkg-prefix":
            if name in self.missing:
                raise NotInstalled(name)
            return f"/opt/ros/jazzy/{name}"
        if what == "find-pkg-share":
            assert name == "ros_visualise"
            return str(PACKAGE)
        return self.values[name]


class Launched(LaunchedGraph):
    """What a launch file starts with these arguments."""

    def __init__(self, name: str, /, **args: Any) -> None:
        self.arguments: dict[str, tuple[str, bool]] = {}
        given = {key: str(value) for key, value in (NEEDED | args).items()}
        path = LAUNCH / f"{name}.launch.xml"
        for element in ElementTree.parse(path).getroot().iter("arg"):
            if "description" in element.attrib:
                name = element.attrib["name"]
                self.arguments[name] = element.attrib["description"], "default" in element.attrib
        self.all = list(_started(str(path), Scope(given)))
        self.nodes = {node.name.rpartition("/")[2]: node for node in self.all}
        self.ours = {n: node for n, node in self.nodes.items() if node.package == "ros_visualise"}

    def params(self, node: str) -> dict[str, Any]:
        """A node's parameters that say something, with names as ROS 1 has them."""
        given = {name.replace(".", "/"): v for name, v in self.nodes[node].params.items()}
        return effective({n: v for n, v in given.items() if n not in ("params", "use_sim_time")})

    def resolve(self, node: str, topic: str) -> str:
        namespace = self.nodes[node].namespace
        remapped = {full(namespace, a): full(namespace, b) for a, b in self.nodes[node].remaps}
        name = full(namespace, topic)
        return remapped.get(name, name)


def begun_without(name: str, package: str, **args: Any) -> list[Node] | None:
    """What a launch file starts before it fails for want of a package; None where it does not."""
    given = {key: str(value) for key, value in (NEEDED | args).items()}
    path = LAUNCH / f"{name}.launch.xml"
    begun: list[Node] = []
    try:
        begun.extend(_started(str(path), Scope(given, missing=frozenset([package]))))
    except NotInstalled:
        return begun
    return None


def full(namespace: str, topic: str) -> str:
    """A topic's name with its namespace."""
    return topic if topic.startswith("/") else f"{namespace}/{topic}"


def _started(path: str, scope: Scope) -> Iterator[Node]:
    yield from _children(ElementTree.parse(path).getroot(), scope)


def _children(parent: ElementTree.Element, scope: Scope) -> Iterator[Node]:
    for element in parent:
        if scope.holds(element):
            yield from _element(element, scope)


def _element(element: ElementTree.Element, scope: Scope) -> Iterator[Node]:
    given = {name: value for name, value in element.attrib.items() if name != "default"}
    given = {name: scope.text(value) for name, value in given.items()}
    match element.tag:
        case "arg":
            _declare(element, given["name"], scope)
        case "let":
            scope.values[given["name"]] = given["value"]
        case "set_parameter":
            scope.params[given["name"]] = yaml.safe_load(given["value"])
        case "set_remap":
            scope.remaps.append((given["from"], given["to"]))
        case "push-ros-namespace":
            scope.namespace += "/" + given["namespace"]
        case "group":
            yield from _children(element, scope.copied())
        case "include":
            for arg in element:
                scope.values[arg.attrib["name"]] = scope.text(arg.attrib["value"])
            yield from _started(given["file"], scope)
        case "node":
            yield _node(element, given, scope)
        case other:
            raise AssertionError(f"no <{other}> is known")


def _declare(element: ElementTree.Element, name: str, scope: Scope) -> None:
    value = scope.values.get(name)
    scope.values[name] = scope.text(element.attrib["default"]) if value is None else value
    choices = [choice.attrib["value"] for choice in element]
    if choices and scope.values[name] not in choices:
        raise Refused(f"{name}:={scope.values[name]}; choose {', '.join(choices)}")


def _node(element: ElementTree.Element, given: dict[str, str], scope: Scope) -> Node:
    params, remaps = dict(scope.params), list(scope.remaps)
    for child in element:
        told = {name: scope.text(value) for name, value in child.attrib.items()}
        if child.tag == "remap":
            remaps.append((told["from"], told["to"]))
        elif "from" not in told:
            is_text = told.get("type") == "str"
            params[told["name"]] = told["value"] if is_text else yaml.safe_load(told["value"])
    name = f"{scope.namespace}/{given['name']}"
    return Node(name, given["pkg"], given["exec"], given.get("args", ""), params, remaps)
