"""What nobody uses any more goes back to the system."""

import subprocess
import sys
import threading

import pytest

from ros_visualise.graph.pipelines import image_pipeline
from ros_visualise.runtime.local import LocalRuntime
from ros_visualise.runtime.memory import find_trim
from ros_visualise.sources.playback import Playback

SCATTERED = """
from pathlib import Path
from ros_visualise.runtime.memory import find_trim

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

blocks = [bytearray(2000) for _ in range(100_000)]
kept = blocks[::50]
blocks.clear()
before = resident_mb()
find_trim()(0)
print(before - resident_mb())
"""


needs_glibc = pytest.mark.skipif(find_trim() is None, reason="only glibc scatters so")


@needs_glibc
def test_what_is_free_between_what_is_used_is_given_back():
    done = subprocess.run([sys.executable, "-c", SCATTERED], capture_output=True, text=True)
    assert float(done.stdout) > 100, done.stderr


@needs_glibc
def test_whatever_runs_tends_its_memory():
    graph = image_pipeline("landscape")
    runtime = LocalRuntime(graph, Playback(rate=0, frames=1))
    runtime.start()
    runtime.wait(60)
    runtime.stop()
    assert "memory" in {thread.name for thread in threading.enumerate()}
