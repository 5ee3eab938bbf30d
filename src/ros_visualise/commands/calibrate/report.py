"""Reports of ``calibrate``: a summary for people, an object for programs, and a plot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ros_visualise.core.printing import counted
from ros_visualise.landmarks.calibration.calibrating import APART, CameraCalibration
from ros_visualise.landmarks.calibration.collecting import ViewCollector
from ros_visualise.landmarks.calibration.lenses import Lens
from ros_visualise.landmarks.calibration.views import Coverage
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import Color
from ros_visualise.plotting.figure import Figure

_SHADES = " .:*#"
_BAR = 20
_FEW_VIEWS = 10
_LARGE_RMS_PX = 1.0
_UNSURE_PX = 1.0
_LISTED = 3


def summary(found: CameraCalibration, collector: ViewCollector, better: Lens | None) -> list[str]:
    """Summary of about thirty lines."""
    rows = [
        ("board", _about_board(found, collector)),
        ("camera", _numbers(found, 0, 4, ".2f")),
        (found.model.name, _numbers(found, 4, None, ".4f")),
        ("rms", _about_rms(found)),
        ("halves", _about_halves(found)),
        ("uncertainty", _about_uncertainty(found)),
        ("worst views", _about_views(found)),
    ]
    if rejected := _rejected(found, collector):
        rows.append(("rejected", rejected))
    coverage = collector.coverage
    rows += [
        (name, f"[{'#' * round(bar * _BAR):{_BAR}}] {bar:4.0%}")
        for name, bar in coverage.bars.items()
    ]
    lines = [f"{name + ':':<20}{text}" for name, text in rows]
    lines += [f"{'covered:' if not row else '':<20}|{text}|" for row, text in _map(coverage)]
    if coverage.advice:
        lines.append(f"{'next:':<20}{coverage.advice}")
    return lines + [f"warning: {text}" for text in warnings_of(found, better)]


def warnings_of(found: CameraCalibration, better: Lens | None) -> list[str]:
    """Reasons not to trust the result."""
    texts = []
    count = len(found.views)
    if count < _FEW_VIEWS:
        texts.append(f"only {counted(count, 'view')}: take at least 15 distinct ones")
    if found.halves is None:
        texts.append("too few views to compare halves of them: the error is unknown")
    elif found.halves.difference > APART:
        texts.append(
            "the focal lengths from two halves of the views differ by"
            f" {found.halves.difference:.2%}: do not trust the result; take more views, tilted,"
            " near and far"
        )
    if found.fit.rms > _LARGE_RMS_PX:
        texts.append("the rms is large: check that the board is flat and the images are sharp")
    if found.uncertainty.corners > _UNSURE_PX:
        texts.append("the image corners are uncertain: hold the board there too")
    if better is not None:
        texts.append(f"--model {better.value} predicts held-out views at least as well")
    return texts


def to_json(
    found: CameraCalibration, collector: ViewCollector, better: Lens | None
) -> dict[str, Any]:
    """All results; the keys are described in the documentation."""
    info, coverage, halves = found.info, collector.coverage, found.halves
    names = found.model.numbers
    return {
        "board": _board(collector),
        "images": collector.seen,
        "found": collector.found,
        "alike": collector.alike,
        "width": info.width,
        "height": info.height,
        "distortion_model": info.distortion_model,
        "K": info.K.ravel().tolist(),
        "D": info.D.tolist(),
        "P": info.projection.ravel().tolist(),
        "numbers": dict(zip(names, found.fit.numbers.tolist(), strict=True)),
        "deviations": dict(zip(names, found.deviations.tolist(), strict=True)),
        "rms": found.fit.rms,
        "views": [
            {"name": view.name, "points": len(view.points.uv), "rms": rms}
            for view, rms in zip(found.views, found.fit.view_rms, strict=True)
        ],
        "outliers": [{"name": view.name, "rms": rms} for view, rms in found.outliers],
        "stray_points": found.stray,
        "halves": halves
        and {
            "focal_lengths": halves.focal_lengths,
            "difference": halves.difference,
            "held_out_rms": halves.rms,
        },
        "uncertainty": {
            "centre": _finite(found.uncertainty.centre),
            "corners": _finite(found.uncertainty.corners),
        },
        "coverage": {**coverage.bars, "share": coverage.share},
        "next": coverage.advice,
        "better_model": better and better.value,
        "warnings": warnings_of(found, better),
    }


def _board(collector: ViewCollector) -> dict[str, Any]:
    board = collector.finder.board
    assert board is not None
    return {
        "pattern": board.kind.value,
        "columns": board.columns,
        "rows": board.rows,
        "dictionary": board.dictionary,
        "as_said": not _differences(collector),
        "words": board.words,
    }


def draw(found: CameraCalibration, coverage: Coverage) -> Figure:
    """All points in the image, with their residuals a hundred times as long."""
    width, height = found.size
    figure = Figure(800, 140 + round(700 * height / width))
    title = f"{found.model.name}: rms {found.fit.rms:.3f} px, {counted(len(found.views), 'view')}"
    figure.text(70, 28, f"{title}, {coverage.share:.0%} of the image covered", 15)
    box = (70.0, 60.0, 700.0, 700.0 * height / width)
    low, high = np.array([0.0, -height]), np.array([width, 0.0])
    image = PlotAxes(figure, box, low, high, equal=True)
    image.draw("u (px); lines: 100 times the residual", "-v (px)")
    for number, (view, residuals) in enumerate(zip(found.views, found.fit.residuals, strict=True)):
        start = view.points.uv * [1, -1]
        ends = start + residuals * [1, -1] * 100
        color = _color(number)
        for place, end in zip(image.places(start), image.places(ends), strict=True):
            figure.dot(place[0], place[1], 1.8, color)
            figure.line(np.array([place, end]), color, 0.8)
    return figure


def _color(number: int) -> Color:
    """Colour of a view, different for neighbouring numbers."""
    angle = number * 2.4
    red, green, blue = (round(110 + 90 * math.cos(angle + at)) for at in (0, 2.1, 4.2))
    return red, green, blue


def _about_board(found: CameraCalibration, collector: ViewCollector) -> str:
    board, differences = collector.finder.board, _differences(collector)
    assert board is not None
    width, height = found.size
    other = f" (instead of {', '.join(differences)})" if differences else ""
    where = f"in {collector.found} of {counted(collector.seen, 'image')} of {width}x{height}"
    return f"{board.words}{other}, {where}"


def _differences(collector: ViewCollector) -> list[str]:
    """In what the description of the board is wrong."""
    board, said = collector.finder.board, collector.finder.said
    assert board is not None
    pairs = ((said.counts, board.counts), (said.dictionary, board.dictionary))
    return [given for given, found in pairs if given != found]


def _numbers(found: CameraCalibration, start: int, stop: int | None, form: str) -> str:
    names, numbers = found.model.numbers[start:stop], found.fit.numbers[start:stop]
    deviations = found.deviations[start:stop]
    return "  ".join(
        f"{name} {number:{form}} ± {deviation:{form}}"
        for name, number, deviation in zip(names, numbers, deviations, strict=True)
    )


def _about_rms(found: CameraCalibration) -> str:
    held = f"; held-out views {found.halves.rms:.3f} px" if found.halves else ""
    return f"{found.fit.rms:.3f} px{held}"


def _about_halves(found: CameraCalibration) -> str:
    if found.halves is None:
        return "too few views"
    one, other = found.halves.focal_lengths
    return f"focal lengths {one:.2f} and {other:.2f}, {found.halves.difference:.2%} apart"


def _about_uncertainty(found: CameraCalibration) -> str:
    centre, corners = found.uncertainty.centre, found.uncertainty.corners
    at_corners = f"{corners:.2f} px" if math.isfinite(corners) else "unknown"
    return f"{centre:.2f} px in the centre of the image, {at_corners} in its corners (1 sigma)"


def _about_views(found: CameraCalibration) -> str:
    worst = sorted(zip(found.fit.view_rms, found.views, strict=True), key=lambda one: -one[0])
    return ", ".join(f"{view.name} {rms:.2f} px" for rms, view in worst[:_LISTED])


def _rejected(found: CameraCalibration, collector: ViewCollector) -> str:
    parts = [f"{view.name} (rms {rms:.2f} px)" for view, rms in found.outliers]
    if found.stray:
        parts.append(counted(found.stray, "stray point"))
    if collector.alike:
        parts.append(counted(collector.alike, "similar view"))
    if collector.other_sizes:
        parts.append(f"{counted(collector.other_sizes, 'image')} of another size")
    if collector.missed:
        names = ", ".join(collector.missed[:_LISTED])
        more = ", ..." if len(collector.missed) > _LISTED else ""
        parts.append(f"{counted(len(collector.missed), 'image')} without the board ({names}{more})")
    return "; ".join(parts)


def _map(coverage: Coverage) -> list[tuple[int, str]]:
    """Rows of the image, each part as a character: the darker, the more points."""
    top = max(float(coverage.cells.max()), 1.0)
    level = np.ceil(coverage.cells / top * (len(_SHADES) - 1)).astype(int)
    return [(row, "".join(_SHADES[one] * 2 for one in line)) for row, line in enumerate(level)]


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None
