"""Start-up time of the command line: `python benchmarks/startup.py`."""

import statistics
import subprocess
import sys
import time

COMMANDS = {
    "python -c pass": ["-c", "pass"],
    "import ros_visualise": ["-c", "import ros_visualise"],
    "ros-visualise --help": ["-m", "ros_visualise", "--help"],
    "ros-visualise video --help": ["-m", "ros_visualise", "video", "--help"],
    "ros-visualise nodes": ["-m", "ros_visualise", "nodes"],
}


def seconds(arguments: list[str]) -> float:
    """The median of nine runs."""
    times = []
    for _ in range(9):
        start = time.perf_counter()
        subprocess.run([sys.executable, *arguments], stdout=subprocess.DEVNULL, check=True)
        times.append(time.perf_counter() - start)
    return statistics.median(times)


print("| command | s |\n|---|---|")
for title, arguments in COMMANDS.items():
    print(f"| `{title}` | {seconds(arguments):.3f} |")
