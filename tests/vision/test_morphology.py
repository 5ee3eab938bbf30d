import numpy as np
import pytest
from by_definition import differ_by

from ros_visualise.vision.morphology import KernelShape, Morphology, morph

CROSS = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
ELEMENTS = {
    (KernelShape.RECT, 2): np.ones((3, 3), bool),
    (KernelShape.RECT, 5): np.ones((5, 5), bool),
    (KernelShape.CROSS, 3): CROSS,
    (KernelShape.ELLIPSE, 3): CROSS,
}


def eroded(gray, element):
    """The least value under the element; what is outside the image does not count."""
    return -dilated(-gray, element)


def dilated(gray, element):
    reach = element.shape[0] // 2
    padded = np.pad(gray.astype(float), reach, constant_values=-np.inf)
    around = np.lib.stride_tricks.sliding_window_view(padded, element.shape)
    return around[..., element].max(axis=-1)


def opened(gray, element):
    return dilated(eroded(gray, element), element)


def closed(gray, element):
    return eroded(dilated(gray, element), element)


DEFINITIONS = {
    Morphology.ERODE: eroded,
    Morphology.DILATE: dilated,
    Morphology.OPEN: opened,
    Morphology.CLOSE: closed,
    Morphology.GRADIENT: lambda gray, e: dilated(gray, e) - eroded(gray, e),
    Morphology.TOPHAT: lambda gray, e: gray - opened(gray, e),
    Morphology.BLACKHAT: lambda gray, e: closed(gray, e) - gray,
}


@pytest.mark.parametrize("operation", DEFINITIONS)
@pytest.mark.parametrize("kernel", ELEMENTS, ids=lambda kernel: f"{kernel[0].value}{kernel[1]}")
def test_every_operation_by_its_definition(gray, operation, kernel):
    expected = DEFINITIONS[operation](gray.astype(float), ELEMENTS[kernel]).astype(gray.dtype)
    assert differ_by(morph(gray, operation, *kernel), expected) == 0


def test_opening_twice_is_opening_once(colored):
    once = morph(colored, Morphology.OPEN, KernelShape.ELLIPSE, 5)
    assert differ_by(morph(once, Morphology.OPEN, KernelShape.ELLIPSE, 5), once) == 0
    assert (once <= colored).all()


def test_off_is_the_same_array(gray):
    assert morph(gray, Morphology.OFF, KernelShape.RECT, 3) is gray
