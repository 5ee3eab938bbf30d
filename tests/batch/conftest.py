"""Results that the tests of batches share."""

import pytest
from made_flights import batch, drive, films


@pytest.fixture(scope="session")
def once(tmp_path_factory):
    """Recordings, and the results of a batch that nothing disturbed."""
    folder = tmp_path_factory.mktemp("once")
    films(folder / "in", 6)
    for number in range(4):
        drive(folder / "in" / f"drive_{number}.mcap", 40 + number)
    done = batch(folder / "in", "--out", folder / "out", "--fields", "/odom.twist.*")
    assert done.returncode == 0, done.stderr
    return folder
