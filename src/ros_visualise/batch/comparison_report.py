"""A comparison of batches against limits: a table, JUnit XML, and a page of the worst moments."""

from __future__ import annotations

import base64
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from fnmatch import fnmatchcase
from html import escape
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple
from xml.etree import ElementTree

import cv2
import numpy as np

from ros_visualise.batch.comparison import METRICS, RATIOS, ResultChange, ResultComparison
from ros_visualise.batch.pictures import images_at, with_boxes
from ros_visualise.core.errors import OpenError, UsageError, did_you_mean
from ros_visualise.core.printing import in_columns
from ros_visualise.core.yaml_files import open_yaml
from ros_visualise.data import Pixels
from ros_visualise.plotting.colors import GREEN, ORANGE

_FORM = "give METRIC: NUMBER or TOPIC: {METRIC: NUMBER}"
_MOST_MOMENTS = 24
_WIDTH = 640  # of a picture on the page
_STYLE = """body { font: 15px/1.5 sans-serif; max-width: 84em; margin: 2em auto; padding: 0 1em; }
table { border-collapse: collapse; } td, th { padding: .2em .8em; text-align: left; }
tr:nth-child(even) { background: #f4f4f4; } .beyond { color: #b00; } img { width: 49%; }"""


class ChangeLimits(NamedTuple):
    """The largest changes that are allowed: pattern of a topic or node -> metric -> number."""

    of: Mapping[str, Mapping[str, float]]

    def find(self, change: ResultChange) -> float | None:
        """The limit of a change, by the last pattern that fits; None: no limit."""
        found: float | None = None if change.metric in RATIOS else 0.0
        for pattern, limits in self.of.items():
            if change.metric in limits and fnmatchcase(change.of, pattern):
                found = limits[change.metric]
        return found

    def allow(self, change: ResultChange) -> bool:
        """True if a change is not beyond its limit."""
        limit = self.find(change)
        return limit is None or change.change <= limit


def read_limits(path: Path) -> ChangeLimits:
    """The limits in a YAML file, as ``lost: 2`` and ``/objects: {lost: 5}``.

    Raises:
        OpenError: it cannot be read.
        UsageError: an unknown metric, or no number.
    """
    given = open_yaml(path, _FORM) or {}
    if not isinstance(given, dict):
        raise UsageError(f"{path}: {_FORM}")
    nested = {str(name): one for name, one in given.items() if isinstance(one, dict)}
    flat = {name: one for name, one in given.items() if not isinstance(one, dict)}
    found = {"*": flat, **nested}
    for limits in found.values():
        for metric, number in limits.items():
            if metric not in METRICS:
                raise UsageError(f"{path}: no metric {metric!r}{did_you_mean(metric, METRICS)}")
            if not isinstance(number, (int, float)) or isinstance(number, bool):
                raise UsageError(f"{path}: {metric}: {_FORM}")
    return ChangeLimits(found)


def summary(changes: Sequence[ResultChange], limits: ChangeLimits) -> list[dict[str, Any]]:
    """Each metric with changes: their number, those beyond the limits, and the worst."""
    found = []
    for metric in METRICS:
        of = [one for one in changes if one.metric == metric]
        if not of:
            continue
        worst = max(of, key=lambda one: one.change)
        found.append(
            {
                "metric": metric,
                "changes": len(of),
                "beyond": sum(not limits.allow(one) for one in of),
                "median": median(one.change for one in of),
                "worst": worst.change,
                "recording": worst.recording,
                "of": worst.of,
            }
        )
    return found


def to_text(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The summary in columns."""
    heads = ("metric", "changes", "beyond", "median", "worst", "where")
    cells = [heads, *(_cells(one) for one in rows)]
    return in_columns(cells)


def _cells(row: Mapping[str, Any]) -> tuple[str, ...]:
    numbers = (f"{row[name]:.4g}" for name in ("median", "worst"))
    where = f"{row['recording']} {row['of']}".strip()
    return row["metric"], str(row["changes"]), str(row["beyond"]), *numbers, where


def to_junit(
    changes: Sequence[ResultChange], limits: ChangeLimits, recordings: Sequence[str]
) -> bytes:
    """JUnit XML with a test for each recording and change that has a limit."""
    suite = ElementTree.Element("testsuite", name="ros-visualise compare")
    failed = 0
    for recording in recordings:
        of = [one for one in changes if one.recording == recording and limits.find(one) is not None]
        if not of:
            ElementTree.SubElement(suite, "testcase", classname=recording, name="unchanged")
        for one in of:
            name = f"{one.of} {one.metric}".strip()
            case = ElementTree.SubElement(suite, "testcase", classname=recording, name=name)
            if not limits.allow(one):
                failed += 1
                text = f"{one.change:.6g} exceeds {limits.find(one):g}; {METRICS[one.metric]}"
                ElementTree.SubElement(case, "failure", message=text)
    suite.set("tests", str(len(suite)))
    suite.set("failures", str(failed))
    ElementTree.indent(suite)
    return bytes(ElementTree.tostring(suite, encoding="utf-8", xml_declaration=True))


def to_html(
    comparison: ResultComparison, changes: Sequence[ResultChange], limits: ChangeLimits, title: str
) -> bytes:
    """One page: the summary, all changes beyond the limits, and the worst moments side by side."""
    beyond = sorted((one for one in changes if not limits.allow(one)), key=lambda one: -one.change)
    parts = [
        f"<!DOCTYPE html><meta charset=utf-8><title>{escape(title)}</title>",
        f"<style>{_STYLE}</style><h1>{escape(title)}</h1>",
        _table(
            ["metric", "changes", "beyond the limits", "median", "worst", "where"],
            [_cells(one) for one in summary(changes, limits)],
        ),
        "<h2>Beyond the limits</h2>",
        _table(
            ["recording", "topic or node", "metric", "before", "after", "change", "limit"],
            [_line(one, limits) for one in beyond],
        ),
        "<h2>Worst moments: before, after</h2>",
        *_moments(comparison, beyond),
    ]
    return "\n".join(parts).encode()


def _line(one: ResultChange, limits: ChangeLimits) -> list[str]:
    numbers = (one.before, one.after, one.change, limits.find(one))
    texts = ["" if number is None else f"{number:.6g}" for number in numbers]
    return [one.recording, one.of, one.metric, *texts]


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = ["<tr>" + "".join(f"<th>{escape(one)}" for one in heads)]
    lines += ["<tr>" + "".join(f"<td>{escape(one)}" for one in row) for row in rows]
    return "<table>" + "\n".join(lines) + "</table>"


def _moments(comparison: ResultComparison, beyond: Sequence[ResultChange]) -> Iterator[str]:
    """Pictures of the worst moments of detections, as far as the recordings are still there."""
    shown: set[tuple[str, str, int]] = set()
    for one in beyond:
        at_ns = one.at_ns
        if one.metric not in ("lost", "gained") or at_ns is None or len(shown) == _MOST_MOMENTS:
            continue
        if (one.recording, one.of, at_ns) in shown:
            continue
        shown.add((one.recording, one.of, at_ns))
        image = _image(comparison, one)
        yield f"<h3>{escape(one.recording)} {escape(one.of)} at {at_ns / 1e9:.3f} s</h3>"
        sides = comparison.detected(one.recording, one.of, at_ns)
        for side, color in zip(sides, (GREEN, ORANGE), strict=True):
            drawn = with_boxes(image, side.labels, side.boxes, color)
            scale = min(1.0, _WIDTH / drawn.shape[1])
            small = cv2.resize(drawn, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
            data = base64.b64encode(cv2.imencode(".jpg", small)[1].tobytes()).decode()
            yield f'<img src="data:image/jpeg;base64,{data}">'


def _image(comparison: ResultComparison, change: ResultChange) -> Pixels:
    """The image in which a change was detected; a gray one if that is missing by now."""
    assert change.at_ns is not None
    path, topics = comparison.origin(change.recording, change.of)
    with suppress(OpenError):
        for _, pixels in images_at(path, [change.at_ns], topics):
            return pixels
    return np.full((480, 640, 3), 128, np.uint8)
