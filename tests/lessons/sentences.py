"""Sentences of lessons, and the numbers in them."""

import re
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import ros_visualise as rv
from ros_visualise.lessons import LESSONS
from ros_visualise.lessons.lesson import StepResult
from ros_visualise.lessons.picture import fit, picture_of

NUMBER = r"([-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)"


def texts_of(topic: str, picture: np.ndarray, **settings: dict[str, object]) -> dict[str, str]:
    """Step -> its text, one line, of a lesson on a picture (BGR), with parameters of steps."""
    lesson = LESSONS.find(topic)
    first = rv.node_function(picture_of(lesson))(picture)
    results = {"picture": first}
    before = "picture"
    for step in lesson.steps:
        name = step.declared.name
        image = results[step.after or before].of("image", StepResult)
        results[name] = rv.node_function(step.node, **settings.get(name, {}))(replace(image))
        before = name
    return {name: " ".join(one["text"].text.split()) for name, one in results.items()}


def holds(text: str, sentence: str, *expected: float) -> None:
    """Check that a sentence, with N for each number, is in a text with these numbers as rounded."""
    for word, true in zip(_words(text, sentence), expected, strict=True):
        digits = len(word.partition("e")[0].partition(".")[2])
        power = int(word.partition("e")[2] or 0)
        error = abs(float(word.replace("−", "-")) - true)
        assert error <= 0.5001 * 10.0 ** (power - digits), (sentence, word, true)


def shown(text: str, sentence: str) -> list[float]:
    """The numbers of a sentence, with N for each, in a text."""
    return [float(word.replace("−", "-")) for word in _words(text, sentence)]


def _words(text: str, sentence: str) -> tuple[str, ...]:
    found = re.search(NUMBER.join(map(re.escape, re.split(r"\bN\b", sentence))), text)
    assert found, f"{sentence!r} is not in {text!r}"
    return found.groups()


def drawn_pictures(landscape: np.ndarray) -> Iterator[np.ndarray]:
    """Five pictures, BGR: a landscape, noise, soft colours, gray steps, and almost nothing."""
    random = np.random.default_rng(5)
    yield landscape
    yield random.integers(0, 256, (60, 80, 3), np.uint8)
    x, y = np.meshgrid(np.arange(128), np.arange(96))
    yield np.stack([2 * x, 255 - 2 * y, x + y], axis=-1).astype(np.uint8)
    yield np.kron(random.integers(0, 6, (6, 8), np.uint8) * 50, np.ones((16, 16), np.uint8))[
        ..., None
    ].repeat(3, axis=2)
    flat = np.full((40, 50, 3), 90, np.uint8)
    flat[20, 25] = (10, 200, 90)
    yield flat


def small(picture: np.ndarray) -> np.ndarray:
    """A picture of at most 320 pixels, which takes little time."""
    return fit(picture, 320)
