"""The table and the picture of a soak: python benchmarks/soak/report.py FOLDER"""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from samples import Sample, read
from slopes import Slope, slope_of

from ros_visualise.plotting.colors import PALETTE
from ros_visualise.plotting.figure import Figure

SETTLE_S = 600.0
"""What comes before is not counted: caches and histories fill."""
LIMITS = {"rss_mb": (1.0, "MB"), "fds": (1.0, "open files"), "threads": (1.0, "threads")}
"""Measured quantity -> what it may grow by in an hour, and its unit."""
_WIDTH, _HEIGHT, _LEFT, _TOP, _RIGHT, _ROW = 860, 120, 64, 34, 210, 150
_GRAY = (190, 190, 190)
_LEAST_MB = 5.0  # from the middle of a picture to its edge

Series = Mapping[tuple[str, str], Sequence[Sample]]


def table(series: Series, settle_s: float = SETTLE_S) -> str:
    """A row for each process."""
    lines = [
        "| scenario | process | h | RSS MB, from and to | MB/h | open files | threads"
        " | GB sent | answer ms | latency ms | ms/h |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [_row(*key, samples, settle_s) for key, samples in series.items()]
    return "\n".join(lines)


def growing(series: Series, settle_s: float = SETTLE_S) -> list[str]:
    """What grows by more than its limit, with 97.5 %, in words."""
    found = []
    for (scenario, process), samples in series.items():
        for name, (limit, unit) in LIMITS.items():
            slope = _slope(_settled(samples, settle_s), name)
            if slope is not None and slope.least > limit:
                found.append(f"{scenario}: {process} grows by {slope} {unit} per hour")
    return found


def _row(scenario: str, process: str, samples: Sequence[Sample], settle_s: float) -> str:
    kept = _settled(samples, settle_s)
    cells = [
        scenario,
        process,
        f"{samples[-1].time_s / 3600:.2f}",
        f"{kept[0].rss_mb:.1f}, {kept[-1].rss_mb:.1f}",
        str(_slope(kept, "rss_mb") or "too short"),
        _change([one.fds for one in kept]),
        _change([one.threads for one in kept]),
    ]
    if process == "page" and kept[-1].sent_mb is not None:
        cells += [
            f"{kept[-1].sent_mb / 1e3:.2f}",
            _middle([one.answer_ms for one in kept]),
            _middle([one.latency_ms for one in kept]),
            str(_slope(kept, "latency_ms") or ""),
        ]
    else:
        cells += [""] * 4
    return "| " + " | ".join(cells) + " |"


def _settled(samples: Sequence[Sample], settle_s: float) -> Sequence[Sample]:
    return [one for one in samples if one.time_s >= settle_s] or samples[-1:]


def _slope(samples: Sequence[Sample], name: str) -> Slope | None:
    known = [one for one in samples if getattr(one, name) is not None]
    return slope_of([one.time_s for one in known], [getattr(one, name) for one in known])


def _change(counts: Sequence[int]) -> str:
    return f"{counts[0]} to {counts[-1]}, at most {max(counts)}"


def _middle(values: Sequence[float | None]) -> str:
    known = [value for value in values if value is not None]
    return f"{np.median(known):.1f}" if known else ""


def picture(series: Series) -> Figure:
    """The memory of each scenario's processes over time."""
    scenarios = list(dict.fromkeys(scenario for scenario, _ in series))
    hours = max(samples[-1].time_s for samples in series.values()) / 3600 or 1.0
    figure = Figure(_WIDTH, _TOP + _ROW * len(scenarios) + 10)
    figure.text(_LEFT, 20, "resident memory over hours, MB about its mean after 10 minutes", 13)
    for number, scenario in enumerate(scenarios):
        lines = {process: one for (name, process), one in series.items() if name == scenario}
        _panel(figure, _TOP + _ROW * number, scenario, lines, hours)
    return figure


def _panel(
    figure: Figure,
    top: float,
    title: str,
    lines: Mapping[str, Sequence[Sample]],
    hours: float,
) -> None:
    drawn = {process: _about_mean(samples) for process, samples in lines.items()}
    late = [np.abs(y[x >= SETTLE_S / 3600]).max(initial=0) for x, y in drawn.values()]
    most = max(_LEAST_MB, *map(float, late))
    width, height = _WIDTH - _LEFT - _RIGHT, _HEIGHT / 2

    def place(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.column_stack([_LEFT + x / hours * width, top + height * (1 - y / most)])

    for level in (-most, 0.0, most):
        ends = place(np.array([0.0, hours]), np.full(2, level))
        figure.line(ends, _GRAY, 0.6)
        figure.text(_LEFT - 6, ends[0, 1] + 4, f"{level:+.0f}" if level else "0", 10, "end")
    for hour in np.arange(0, hours + 1e-9, 0.5):
        x, y = place(np.array([hour]), np.array([-most]))[0]
        figure.text(x, y + 13, f"{hour:g}", 10, "middle")
    for number, (process, (x, y)) in enumerate(drawn.items()):
        color = PALETTE[number % len(PALETTE)]
        inside = np.abs(y) <= most
        figure.line(place(x[inside], y[inside]), color, 1.4)
        name = f"{title}: {process}" if len(drawn) > 1 else title
        figure.text(_WIDTH - _RIGHT + 8, top + 14 + 16 * number, name, 12, color=color)


def _about_mean(samples: Sequence[Sample]) -> tuple[np.ndarray, np.ndarray]:
    hours = np.array([one.time_s for one in samples]) / 3600
    rss_mb = np.array([one.rss_mb for one in samples])
    settled = rss_mb[hours >= SETTLE_S / 3600]
    return hours, rss_mb - (settled if len(settled) else rss_mb).mean()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="what run.py was given as --out")
    parser.add_argument("--plot", type=Path, help="write the picture to this SVG file")
    args = parser.parse_args()
    series: dict[tuple[str, str], list[Sample]] = {}
    for path in sorted(args.folder.glob("*.csv")):
        series |= read(path)
    print(table(series))
    if args.plot is not None:
        args.plot.write_bytes(picture(series).svg())


if __name__ == "__main__":
    main()
