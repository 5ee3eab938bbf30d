"""The memory that messages are received into."""

import subprocess
import sys

import pytest

from ros_visualise.runtime.memory import BufferPool

CONNECTIONS = """
import threading
from pathlib import Path
from ros_visualise.runtime.memory import BufferPool
from ros_visualise.runtime.memory import keep_freed_images

def resident_mb():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096 / 1e6

def receive():
    pool = BufferPool()
    held = [pool.take(2_000_000) for _ in range(4)]
    for image in held:
        image[:] = 1
    there.wait()

keep_freed_images()
before = resident_mb()
there = threading.Barrier(9)
threads = [threading.Thread(target=receive) for _ in range(8)]
for thread in threads:
    thread.start()
there.wait()
for thread in threads:
    thread.join()
print(resident_mb() - before)
"""


def test_connections_that_have_ended_keep_no_memory():
    done = subprocess.run([sys.executable, "-c", CONNECTIONS], capture_output=True, text=True)
    assert float(done.stdout) < 10, done.stderr


@pytest.mark.parametrize("size", [1000, 1_000_000])
def test_a_buffer_is_used_anew_when_nobody_holds_it_and_only_then(size):
    pool = BufferPool()
    first, second = pool.take(size), pool.take(size)
    first[:], second[:] = 1, 2
    assert (first == 1).all()
    assert (second == 2).all()
    part, address = second[10:20], second.ctypes.data
    del second
    assert pool.take(size).ctypes.data != address
    assert (part == 2).all()
    del part
    assert address in {one.ctypes.data for one in [pool.take(size) for _ in range(3)]}
