"""Live parameters of nodes as JSON: described when asked, published when they change."""

from __future__ import annotations

import json
import logging
import re
import threading
from collections.abc import Mapping
from functools import cache
from typing import Any, Literal

import msgspec
import zenoh

from ros_visualise.core import supervision
from ros_visualise.core.errors import DamagedMessage, ParameterError, Unreachable
from ros_visualise.core.params import Parameters, Plain, Spec, plain_of, specs
from ros_visualise.nodes import NodeType, SourceType
from ros_visualise.runtime.bridge.services import answer
from ros_visualise.runtime.middleware import ParametersListener
from ros_visualise.runtime.playing import offered
from ros_visualise.runtime.remote.declaration import ParameterDescription, declared
from ros_visualise.runtime.zenoh import keys
from ros_visualise.runtime.zenoh.errors import translated
from ros_visualise.runtime.zenoh.session import ZenohSession

log = logging.getLogger(__name__)

_ANSWER_S = 2.0
_LOOK_S = 0.5
_LONGEST = 1 << 20
_MOST = 1000
_NAME = re.compile(r"[a-z]\w{0,99}", re.IGNORECASE)
_TYPES: dict[str, type] = {"bool": bool, "int": int, "float": float, "str": str}

Values = dict[str, Plain]


class Parameter(msgspec.Struct, frozen=True):
    """One parameter, as it is described; a choice is the text of its value."""

    name: str
    type: Literal["bool", "int", "float", "str"]
    default: Plain
    help: str = ""
    min: float | None = None
    max: float | None = None
    group: str = ""
    choices: tuple[str, ...] = ()
    step: float | None = None
    label: str = ""


class Description(msgspec.Struct):
    """All parameters of a node, and their values."""

    parameters: tuple[Parameter, ...]
    values: Values


class ZenohServedParameters:
    """Offers a node's parameters until it is closed.

    Args:
        session: of this process.
        parameters: what is offered.
        place: full name under which they are.
    """

    def __init__(self, session: ZenohSession, parameters: Parameters[Any], place: str) -> None:
        self._zenoh, self._parameters = session.zenoh, parameters
        self._key = keys.parameters_key(place)
        self._changed = threading.Event()
        self._closed = False
        self._queryable = self._zenoh.declare_queryable(self._key, self._answer, complete=True)
        self._token, _ = session.declare(keys.PARAMETERS, place)
        self._forget = parameters.on_change(lambda *_: self._changed.set())
        supervision.start(f"{place} parameters", self._follow, again_s=_LOOK_S)

    def close(self) -> None:
        """Offer them no longer; more than once does no harm."""
        if not self._closed:
            self._closed = True
            self._forget()
            self._changed.set()
            self._token.undeclare()
            self._queryable.undeclare()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            payload = query.payload
            if payload is None:
                query.reply(self._key, _written(self._description()))
                return
            done, text = answer(lambda: self._set(payload))
            if done:
                query.reply(self._key, _written(self._values()))
            else:
                query.reply_err(text)

    def _set(self, payload: zenoh.ZBytes) -> None:
        self._parameters.update(_read(payload, Values))

    def _description(self) -> Description:
        declared = specs(self._parameters.current)
        return Description(tuple(map(_described, declared)), self._values())

    def _values(self) -> Values:
        current = self._parameters.current
        return {spec.name: plain_of(getattr(current, spec.name)) for spec in specs(current)}

    def _follow(self) -> None:
        """Publish the values after each change; the listener of a change must not wait."""
        while self._changed.wait() and not self._closed:
            self._changed.clear()
            with translated(self._key):
                self._zenoh.put(self._key, _written(self._values()))


class ZenohParametersClient:
    """Follows a node's parameters; see `ros_visualise.runtime.middleware.ParametersClient`.

    Args:
        session: of this process.
        place: full name under which the node has them.
        listener: receives them.
    """

    def __init__(self, session: ZenohSession, place: str, listener: ParametersListener) -> None:
        self._zenoh, self._graph = session.zenoh, session.graph
        self._place, self._key, self._listener = place, keys.parameters_key(place), listener
        self._met: str | None = None  # id of the session that has described them
        self._lock = threading.Lock()
        self._closed = False
        self._updates = self._zenoh.declare_subscriber(self._key, self._take)
        supervision.start(f"{place} parameters", self._follow, again_s=_LOOK_S)

    @property
    def connected(self) -> bool:
        """True while the node is on the graph."""
        return self._met is not None and self._graph.session_of(self._place) == self._met

    def set(self, values: Mapping[str, Any]) -> Mapping[str, Any]:
        """Have the node take over all values or none.

        Raises:
            ParameterError: the node refuses.
            Unreachable: it does not answer.
        """
        reply = self._ask(_written({name: plain_of(value) for name, value in values.items()}))
        if reply.ok is None:
            raise ParameterError(reply.err.payload.to_string()[:_LONGEST])
        found: Values = _read(reply.ok.payload, Values)
        return found

    def close(self) -> None:
        """Follow them no longer."""
        if not self._closed:
            self._closed = True
            self._updates.undeclare()

    def _ask(self, payload: bytes | None = None) -> Any:
        with translated(self._place):
            for reply in self._zenoh.get(self._key, payload=payload, timeout=_ANSWER_S):
                return reply
        raise Unreachable(f"{self._place} does not answer")

    def _follow(self) -> None:
        _our_own()  # takes a while, and is needed soon
        while not self._closed:
            there = self._graph.session_of(self._place)
            if there is not None and there != self._met:
                self._meet(there)
            self._met = self._met if there == self._met else None
            self._graph.wait(_LOOK_S)

    def _meet(self, there: str) -> None:
        """Ask a node that is new, or has come back, for its parameters."""
        try:
            reply = self._ask()
            if reply.ok is None:
                return
            description = _read(reply.ok.payload, Description)
            params, node = _declaration(description.parameters)
        except (Unreachable, DamagedMessage) as error:
            log.debug("%s: %s", self._place, error)
            return
        with self._lock:
            self._met = there
            self._listener.declared(params, node)
            self._listener.updated(description.values)

    def _take(self, sample: zenoh.Sample) -> None:
        supervision.attempt(self._place, lambda: self._update(sample.payload))

    def _update(self, payload: zenoh.ZBytes) -> None:
        try:
            values = _read(payload, Values)
        except DamagedMessage as error:
            log.debug("%s: %s", self._place, error)
            return
        with self._lock:
            if self._met is not None:
                self._listener.updated(values)


def _described(spec: Spec) -> Parameter:
    """A parameter as peers know it."""
    kind = "str" if spec.choices else spec.type.__name__
    fields = spec.help, spec.min, spec.max, spec.group, spec.choices, spec.step, spec.label
    return Parameter(spec.name, kind, plain_of(spec.default), *fields)  # type: ignore[arg-type]


def _declaration(listed: tuple[Parameter, ...]) -> tuple[type, NodeType | SourceType | None]:
    """The dataclass for a description, and our own node if it is one of ours.

    Raises:
        DamagedMessage: no dataclass can be made of it.
    """
    if listed in _our_own():
        return _our_own()[listed]
    names = {one.name for one in listed}
    if len(names) < len(listed) or len(listed) > _MOST or not all(map(_NAME.fullmatch, names)):
        raise DamagedMessage("parameters without a valid name")
    try:
        return declared(map(_as_description, listed)), None
    except (TypeError, ValueError) as error:
        raise DamagedMessage(f"inconsistent parameters: {error}") from error


def _as_description(one: Parameter) -> ParameterDescription:
    return ParameterDescription(
        one.name,
        _TYPES[one.type],
        one.default,
        one.help,
        one.min,
        one.max,
        one.group,
        {text: text for text in one.choices},
        one.step,
        one.label,
    )


@cache
def _our_own() -> dict[tuple[Parameter, ...], tuple[type, NodeType | SourceType]]:
    """Our own nodes by their description; the first call takes a second of imports."""
    return {tuple(map(_described, specs(kind))): (kind, node) for kind, node in offered()}


def _written(content: Values | Description) -> bytes:
    """JSON, in which numbers may be infinite."""
    return json.dumps(msgspec.to_builtins(content)).encode()


def _read(payload: zenoh.ZBytes, kind: Any) -> Any:
    """The content of JSON.

    Raises:
        DamagedMessage: it is not of this kind, or too large.
    """
    if len(payload) > _LONGEST:
        raise DamagedMessage(f"{len(payload)} bytes; limit: {_LONGEST >> 20} MiB")
    try:
        return msgspec.convert(json.loads(payload.to_bytes()), kind)
    except (ValueError, RecursionError, msgspec.ValidationError) as error:
        raise DamagedMessage(f"cannot decode parameters: {error}") from error
