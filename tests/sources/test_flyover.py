"""The flyover of the landscape: a function of time, smooth, and a loop."""

from itertools import pairwise

import numpy as np

from ros_visualise.data import Deferred
from ros_visualise.sources.flyover import Flyover

S = 10**9


def difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a.astype(float) - b.astype(float)).mean())


def test_it_has_thirty_images_a_second_for_its_length() -> None:
    times = [time_ns for time_ns, _ in Flyover((64, 48)).read(0)]
    assert len(times) == 1800
    assert Flyover.duration_ns == 60 * S
    assert np.abs(np.diff([*times, Flyover.duration_ns]) - S / 30).max() <= 1


def test_every_time_that_it_gives_can_be_sought() -> None:
    flyover = Flyover((64, 48))
    times = [time_ns for time_ns, _ in flyover.read(0)]
    assert [next(flyover.read(t))[0] for t in times] == times
    assert [next(flyover.read(t - 1))[0] for t in times[1:]] == times[:-1]
    assert next(flyover.read(10**15))[0] == times[-1]


def test_an_image_depends_on_time_alone() -> None:
    _, image = next(Flyover().read(20 * S))
    assert isinstance(image.data, Deferred)
    assert image.pixels.shape == (480, 640, 3)
    assert np.array_equal(image.pixels, Flyover().render(20.0))


def test_it_moves_smoothly_and_ends_as_it_begins() -> None:
    flyover = Flyover((160, 120))
    views = [flyover.render(n / 30) for n in range(4)]
    steps = [difference(a, b) for a, b in pairwise(views)]
    assert min(steps) > 0.5
    assert difference(flyover.render(60.0), views[0]) < 0.5
    assert difference(flyover.render(60 - 1 / 30), views[0]) < 2 * max(steps)
    assert difference(flyover.render(30.0), views[0]) > 4 * max(steps)


def test_a_larger_image_shows_the_same_view() -> None:
    small, large = Flyover((160, 120)).render(7.0), Flyover((640, 480)).render(7.0)
    means = large.reshape(120, 4, 160, 4, 3).mean(axis=(1, 3))
    assert difference(means, small) < 12
