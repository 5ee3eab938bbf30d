"""Time and memory of curves with many samples: `python benchmarks/curves.py`.

A walk of 5 million samples at a kilohertz, with uneven times and a gap, is stored; then views of it
are taken, from the whole to half a second.
"""

import argparse
import time

import numpy as np

from ros_visualise.ui.live.curves import SampleStore

_PIECE = 50_000


def fill(count: int) -> tuple[SampleStore, float]:
    """A store with so many samples, and the seconds that this took."""
    rng = np.random.default_rng(0)
    times_s = (np.arange(count) + rng.uniform(0, 0.9, count)) / 1000
    values = rng.normal(size=count).cumsum()
    values[count // 3 : count // 3 + 100] = np.nan
    store = SampleStore(["x"], 0.0)
    start_s = time.perf_counter()
    for first in range(0, count, _PIECE):
        piece = slice(first, first + _PIECE)
        store.add(times_s[piece], values[piece, None])
    return store, time.perf_counter() - start_s


def view_ms(store: SampleStore, start_s: float, end_s: float, columns: int) -> tuple[float, float]:
    """Median and longest time of 20 views, milliseconds."""
    times_ms = []
    for _ in range(20):
        start = time.perf_counter()
        store.between("x", start_s, end_s, columns)
        times_ms.append(1000 * (time.perf_counter() - start))
    return float(np.median(times_ms)), max(times_ms)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=5_000_000)
    count = parser.parse_args().samples
    store, spent_s = fill(count)
    size = store.nbytes / 2**20
    print(f"{count} samples: stored in {spent_s:.2f} s, {size:.0f} MiB\n")
    print("| view, s | columns | median ms | longest ms |\n|---|---|---|---|")
    end_s = count / 1000
    middle_s = end_s / 2
    for length_s in (end_s, 0.9 * end_s, end_s / 10, 10.0, 0.5):
        for columns in (750, 2000):
            span = middle_s - length_s / 2, middle_s + length_s / 2
            median_ms, longest_ms = view_ms(store, *span, columns)
            print(f"| {length_s:g} | {columns} | {median_ms:.1f} | {longest_ms:.1f} |")


if __name__ == "__main__":
    main()
