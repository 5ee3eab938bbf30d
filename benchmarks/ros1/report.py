"""Tables."""

import math
from collections.abc import Sequence

from measure import Figures


def title(text: str, note: str = "") -> None:
    print(f"\n## {text}\n" + (f"\n{note}\n" if note else ""), flush=True)


def header(*columns: str) -> None:
    print("| " + " | ".join(columns) + " |")
    print("|---" * len(columns) + "|", flush=True)


def row(*cells: object) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |", flush=True)


def number(value: float, digits: int = 1) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def share(value: float) -> str:
    return "-" if math.isnan(value) else f"{value * 100:.1f}%"


def ratio(value: float, of: float) -> str:
    """How many times one figure is another."""
    there = value > 0 and of > 0  # neither holds for NaN
    return f"{value / of:.2f}" if there else "-"


FIGURES = ("fps", "CPU ms", "p50 ms", "p99 ms", "lost")


def cells(figures: Figures) -> Sequence[str]:
    """What stands below `FIGURES`."""
    if not figures.fps:
        return ("nothing came", "-", "-", "-", "-")
    return (
        number(figures.fps),
        number(figures.cpu_ms, 2),
        number(figures.p50_ms),
        number(figures.p99_ms),
        share(figures.lost),
    )
