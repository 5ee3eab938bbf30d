"""A lesson of one step: a picture and its negative."""

import numpy as np

from ros_visualise.data import Image, Message
from ros_visualise.lessons.lesson import GIVES, TAKES, Lesson, Step, show, work_of
from ros_visualise.nodes import node


@node("inverted", inputs=TAKES, outputs=GIVES)
def inverted(image: Image, params: object) -> dict[str, Message]:
    """Each level v becomes 255 - v."""
    pixels = work_of(image, np.ndarray)
    text = """
        What was dark is bright, and each colour becomes its complement. The mean level was
        {before:.1f}; now it is {after:.1f}, and both add up to 255.
        """
    negative = 255 - pixels
    return show(image, negative, text, negative, before=pixels.mean(), after=negative.mean())


LESSON = Lesson(
    "negative",
    "the simplest point operation: the negative of a picture",
    "This picture has {width} x {height} pixels. Its negative is computed pixel by pixel.",
    [Step(inverted)],
)
