"""Our ROS nodes beside what a user would take instead, on one machine in one run.

    python benchmarks/ros1/run.py [--quick] [--sizes 4K] [--sections edges chain] ...

Run it with an interpreter that has rospy and this package.
"""

import argparse
import os
import tempfile
from pathlib import Path

import chain
import edges
import peers
import rates
import rectify
import transport
import videos
from bench import Bench
from graph import Graph
from measure import Window
from seed import Seed

SECTIONS = {
    "edges": edges.run,
    "rectify": rectify.run,
    "rates": rates.run,
    "transport": transport.run,
    "players": transport.run_players,
    "chain": chain.run,
    "live": chain.run_live,
}


def main() -> None:
    args = _arguments()
    if absent := peers.missing():
        raise SystemExit(f"not installed: {', '.join(absent)}")
    window = Window(2.0, 1.0) if args.quick else Window(args.seconds, args.warmup)
    with tempfile.TemporaryDirectory(prefix="ros_visualise_") as folder:
        scratch = Path(folder)
        made = {size: videos.make(args.picture, size, scratch) for size in args.sizes}
        seeds = [_seed(args, scratch / name, name == "windows") for name in ("none", "windows")]
        graph = Graph(scratch, args.port)
        bench = Bench(graph, made, window, args.rounds, args.quick, *seeds)
        print(f"Picture: {args.picture or 'a test scene'}; {window}; rounds: {args.rounds}")
        for name in args.sections:
            SECTIONS[name](bench)


def _seed(args: argparse.Namespace, scratch: Path, windows: bool) -> Seed | None:
    if args.seed is None or (windows and not args.windows):
        return None
    scratch.mkdir()
    return Seed.check_out(args.seed, scratch, args.seed_python, windows)


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    add = parser.add_argument
    add("--sizes", nargs="+", choices=videos.SIZES, default=list(videos.SIZES))
    add("--sections", nargs="+", choices=SECTIONS, default=list(SECTIONS))
    add("--rounds", type=int, default=1, help="medians of so many (%(default)s)")
    add("--seconds", type=float, default=5.0, help="that one figure is measured (%(default)s)")
    add("--warmup", type=float, default=1.5, help="seconds before that (%(default)s)")
    add("--quick", action="store_true", help="short windows: whether it runs, not how fast")
    add(
        "--picture",
        type=Path,
        default=videos.picture(),
        help="a video, scaled to each size (vtest.avi in $ROS_VISUALISE_DATA, else a test scene)",
    )
    given = os.environ.get("ROS_VISUALISE_SEED")
    add(
        "--seed",
        type=Path,
        default=Path(given) if given else None,
        help="a clone of the seed's repository ($ROS_VISUALISE_SEED); without it it is left out",
    )
    add("--seed-python", default="/usr/bin/python3", help="with rospy, cv_bridge and imutils")
    add("--windows", action="store_true", help="measure the seed with its windows, too (a display)")
    add("--port", type=int, default=0, help="of the ROS master; 0 takes a free one")
    return parser.parse_args()


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        raise SystemExit(130) from None
