"""What every section of the benchmark is given."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from graph import Graph
from measure import Figures, Window
from seed import Seed


@dataclass(frozen=True)
class Bench:
    """The graph, the videos by size, how long and how often, and the seed where it is there."""

    graph: Graph
    videos: Mapping[str, Path]
    window: Window
    rounds: int
    quick: bool
    seed: Seed | None = None
    seed_as_it_is: Seed | None = None

    def rounds_of(self, candidates: Mapping[str, Callable[[], Figures]]) -> dict[str, Figures]:
        """Measure the candidates in turn, several rounds over; gives the medians."""
        rounds: Sequence[dict[str, Figures]] = [
            {name: measured() for name, measured in candidates.items()} for _ in range(self.rounds)
        ]
        return {name: Figures.median([one[name] for one in rounds]) for name in candidates}
