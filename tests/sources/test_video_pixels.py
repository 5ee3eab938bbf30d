"""The size of an image as text."""

import pytest

from ros_visualise.core.errors import UsageError
from ros_visualise.sources.video_pixels import parse_size


def test_a_size_is_width_and_height() -> None:
    assert parse_size("640x480") == (640, 480)
    assert parse_size(" 1X7 ") == (1, 7)
    assert parse_size("") is None


@pytest.mark.parametrize("text", ["640", "640x", "0x5", "-1x5", "640x480x3", "big", "1.5x2"])
def test_other_texts_are_refused_with_an_example(text: str) -> None:
    with pytest.raises(UsageError, match="such as 640x480"):
        parse_size(text)
