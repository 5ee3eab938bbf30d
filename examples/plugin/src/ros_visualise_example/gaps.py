"""A command: the longest pause in each topic of a recording."""

from contextlib import closing
from dataclasses import dataclass

from ros_visualise.commands import Command
from ros_visualise.running.arguments import argument, option


@dataclass(frozen=True, kw_only=True)
class GapsOptions:
    """A field for each argument."""

    input: str = argument("the recording", metavar="FILE")
    above: float = option(0.0, "only longer ones", metavar="S")


def run(options: GapsOptions) -> int:
    """Print the longest pause of each topic; 1 if one is longer than ``--above``, if given."""
    import numpy as np

    from ros_visualise.sources import open_source

    found = {}
    with closing(open_source(options.input)) as recording:
        for topic, stamps_ns in recording.stamps_ns().items():
            gaps = np.diff(np.sort(stamps_ns))
            found[topic] = gaps.max() / 1e9 if len(gaps) else 0.0
    for topic, gap_s in found.items():
        if gap_s >= options.above:
            print(f"{topic}: longest pause {gap_s:.3f} s")
    return int(options.above > 0 and max(found.values(), default=0) >= options.above)


COMMAND = Command("the longest pause in each topic", GapsOptions, run)
