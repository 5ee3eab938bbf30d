"""Curves that are computed from others: expressions, which are parsed and never evaluated as code.

    derivative("/odom:pose.pose.position.x") - "/odom:twist.twist.linear.x"

A curve is named in quotes, a topic and a path; a quaternion by the path of the whole. Curves of
several topics are aligned by their times: those of the first one stay, and others are interpolated
linearly; NaN outside of them.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.ui.live.units import per_second, times_second

_LONGEST, _DEEPEST = 500, 20
_QUATERNION = ("x", "y", "z", "w")


class BadExpression(ValueError):
    """An expression that cannot be computed; the text is for its author."""


class Sampled(NamedTuple):
    """Times in seconds, ascending, and values: (N,) each."""

    times_s: Floats
    values: Floats


Read = Callable[[str], Sampled]
"""Gives a curve by its name."""
_Value = Sampled | float

_OPERATORS: Mapping[type[ast.AST], Callable[[Floats, Floats], Floats]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.Mod: np.mod,
}


def derivative(curve: Sampled) -> Sampled:
    """Difference quotient: of each sample and the one before; NaN for the first."""
    steps_s = np.diff(curve.times_s)
    return curve._replace(values=np.r_[np.nan, np.diff(curve.values) / steps_s][: len(curve[0])])


def integral(curve: Sampled) -> Sampled:
    """Integral by the trapezoidal rule from the first sample on; gaps add nothing."""
    middle = (curve.values[1:] + curve.values[:-1]) / 2
    steps = np.nan_to_num(middle * np.diff(curve.times_s))
    return curve._replace(values=np.r_[0.0, np.cumsum(steps)][: len(curve.values)])


def mean(curve: Sampled, window_s: float) -> Sampled:
    """Mean of the samples in a window around each; NaN counts as missing."""
    if not window_s > 0:
        raise BadExpression("mean: give the window in seconds, above 0")
    half_s = window_s / 2
    first = np.searchsorted(curve.times_s, curve.times_s - half_s)
    last = np.searchsorted(curve.times_s, curve.times_s + half_s, "right")
    is_known = np.isfinite(curve.values)
    offset = curve.values[is_known].mean() if is_known.any() else 0.0  # for precision
    sums = np.r_[0.0, np.cumsum(np.where(is_known, curve.values - offset, 0.0))]
    counts = np.r_[0, np.cumsum(is_known)]
    count = counts[last] - counts[first]
    found = (sums[last] - sums[first]) / np.where(count, count, np.nan) + offset
    return curve._replace(values=found)


def unwrap(curve: Sampled) -> Sampled:
    """An angle in radians without jumps of a whole turn."""
    is_known = np.isfinite(curve.values)
    values = curve.values.copy()
    values[is_known] = np.unwrap(values[is_known])
    return curve._replace(values=values)


def roll(x: Floats, y: Floats, z: Floats, w: Floats) -> Floats:
    """Roll of a quaternion, radians."""
    return np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))


def pitch(x: Floats, y: Floats, z: Floats, w: Floats) -> Floats:
    """Pitch of a quaternion, radians."""
    return np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))


def yaw(x: Floats, y: Floats, z: Floats, w: Floats) -> Floats:
    """Yaw of a quaternion, radians."""
    return np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


_OF_CURVES = {"derivative": derivative, "integral": integral, "unwrap": unwrap}
_OF_ANGLES = {"roll": roll, "pitch": pitch, "yaw": yaw}
_OF_VALUES: Mapping[str, Callable[[Floats], Floats]] = {
    name: getattr(np, name)
    for name in ("abs", "sqrt", "sin", "cos", "tan", "exp", "log", "degrees", "radians", "sign")
}
_PAIRS = {"atan2": np.arctan2, "hypot": np.hypot, "min": np.fmin, "max": np.fmax}
FUNCTIONS = (*_OF_CURVES, "mean", *_OF_ANGLES, *_OF_VALUES, *_PAIRS)


class Expression:
    """A parsed expression.

    Attributes:
        names: the curves that it needs, in their order.

    Raises:
        BadExpression: it is not one.
    """

    def __init__(self, text: str) -> None:
        if len(text) > _LONGEST:
            raise BadExpression(f"the expression is longer than {_LONGEST} characters")
        try:
            self._root = ast.parse(text.strip(), mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise BadExpression(
                'malformed expression; put curves in quotes: "/odom:x" * 2'
            ) from None
        self.names: list[str] = []
        self._check(self._root, 0)
        if not self.names:
            raise BadExpression('name a curve in quotes, such as "/odom:pose.pose.position.x"')

    def compute(self, read: Read) -> Sampled:
        """Compute it.

        Args:
            read: gives the curves of ``names``.

        Raises:
            BadExpression: a function has the wrong arguments.
        """
        with np.errstate(all="ignore"):
            found = self._compute(self._root, read)
        assert isinstance(found, Sampled)
        return found

    def unit(self, unit_of: Callable[[str], str]) -> str:
        """Its unit by those of the curves; empty if unknown."""
        return _unit(self._root, unit_of)

    def _check(self, node: ast.AST, depth: int) -> None:
        """Allow numbers, names of curves, operators and known functions; note the curves."""
        if depth > _DEEPEST:
            raise BadExpression("the expression is nested too deeply")
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            self.names.append(node.value)
        elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
            if not abs(node.value) < 1e300:
                raise BadExpression("a number is too large")
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            self._check(node.operand, depth + 1)
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            self._check(node.left, depth + 1)
            self._check(node.right, depth + 1)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and not node.keywords:
            self._check_call(node.func.id, node.args, depth)
        else:
            raise BadExpression(f"unsupported in an expression: {ast.unparse(node)[:50]}")

    def _check_call(self, name: str, given: list[ast.expr], depth: int) -> None:
        if name not in FUNCTIONS:
            raise BadExpression(f"unknown function {name}; use {', '.join(FUNCTIONS)}")
        if len(given) != (2 if name == "mean" or name in _PAIRS else 1):
            raise BadExpression(f"{name}: wrong number of arguments")
        if name not in _OF_ANGLES:
            for one in given:
                self._check(one, depth + 1)
            return
        quaternion = given[0]
        if not isinstance(quaternion, ast.Constant) or not isinstance(quaternion.value, str):
            raise BadExpression(f'{name}: give a quaternion in quotes, such as "/imu:orientation"')
        self.names += [f"{quaternion.value}.{part}" for part in _QUATERNION]

    def _compute(self, node: ast.AST, read: Read) -> _Value:
        if isinstance(node, ast.Constant):
            return read(node.value) if isinstance(node.value, str) else float(node.value)  # type: ignore[arg-type]
        if isinstance(node, ast.UnaryOp):
            return _combined(_sign(node.op), self._compute(node.operand, read), operator.mul)
        if isinstance(node, ast.BinOp):
            sides = self._compute(node.left, read), self._compute(node.right, read)
            return _combined(*sides, _OPERATORS[type(node.op)])
        assert isinstance(node, ast.Call)
        assert isinstance(node.func, ast.Name)
        return self._call(node.func.id, node.args, read)

    def _call(self, name: str, given: list[ast.expr], read: Read) -> _Value:
        if name in _OF_ANGLES:
            text = ast.literal_eval(given[0])
            parts = [read(f"{text}.{part}") for part in _QUATERNION]
            parts = [aligned(part, parts[0].times_s) for part in parts]
            return parts[0]._replace(values=_OF_ANGLES[name](*(part.values for part in parts)))
        values = [self._compute(one, read) for one in given]
        if name in _PAIRS:
            return _combined(values[0], values[1], _PAIRS[name])
        first = values[0]
        if name in _OF_VALUES:
            if isinstance(first, Sampled):
                return first._replace(values=_OF_VALUES[name](first.values))
            return float(_OF_VALUES[name](np.float64(first)))
        if not isinstance(first, Sampled):
            raise BadExpression(f"{name}: needs a curve")
        if name == "mean":
            if isinstance(values[1], Sampled):
                raise BadExpression("mean: the window is a number, in seconds")
            return mean(first, values[1])
        return _OF_CURVES[name](first)


def _unit(node: ast.AST, unit_of: Callable[[str], str]) -> str:
    if isinstance(node, ast.Constant):
        return unit_of(node.value) if isinstance(node.value, str) else ""
    if isinstance(node, ast.UnaryOp):
        return _unit(node.operand, unit_of)
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        left, right = (_unit(side, unit_of) for side in (node.left, node.right))
        return left if left == right else ""
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Name):
        return ""
    name = node.func.id
    if name in _OF_ANGLES:
        return "rad"
    own = _unit(node.args[0], unit_of)
    changed = {"derivative": per_second(own), "integral": times_second(own), "degrees": "°"}
    changed |= dict.fromkeys(("mean", "unwrap", "abs", "min", "max"), own)
    return changed.get(name, "")


def _sign(node: ast.AST) -> float:
    return -1.0 if isinstance(node, ast.USub) else 1.0


def _combined(one: _Value, other: _Value, combine: Callable[[Floats, Floats], Floats]) -> _Value:
    if isinstance(one, Sampled) and isinstance(other, Sampled):
        other = aligned(other, one.times_s)
        return one._replace(values=combine(one.values, other.values))
    if isinstance(one, Sampled):
        return one._replace(values=combine(one.values, other))  # type: ignore[arg-type]
    if isinstance(other, Sampled):
        return other._replace(values=combine(one, other.values))  # type: ignore[arg-type]
    return float(combine(np.float64(one), np.float64(other)))


def aligned(curve: Sampled, times_s: Floats) -> Sampled:
    """A curve at other times."""
    if np.array_equal(curve.times_s, times_s):
        return curve
    if not len(curve.times_s):
        return Sampled(times_s, np.full(len(times_s), np.nan))
    values = np.interp(times_s, *curve, left=np.nan, right=np.nan)
    return Sampled(times_s, values)
