"""Drawings of helipads, of styles that are trained on and of those held out."""

import itertools

import cv2
import numpy as np
import pads
import pytest

STYLES = [
    *itertools.product([False], pads.FRAMES, pads.LETTERS),
    *itertools.product([True], pads.HELD_OUT_FRAMES, pads.HELD_OUT_LETTERS),
]


def test_what_is_held_out_is_not_trained_on():
    assert not set(pads.FRAMES) & set(pads.HELD_OUT_FRAMES)
    assert not set(pads.LETTERS) & set(pads.HELD_OUT_LETTERS)


@pytest.mark.parametrize(("held_out", "frame", "letter"), STYLES)
def test_the_letter_is_inside_of_the_outline(held_out, frame, letter, monkeypatch):
    for name, one in (("FRAMES", frame), ("LETTERS", letter)):
        monkeypatch.setattr(pads, f"HELD_OUT_{name}" if held_out else name, (one,))
    random = np.random.default_rng(len(frame) * len(letter))
    for _ in range(4):
        pad, mask = pads.draw_any_pad(random, held_out)
        inside = np.zeros_like(mask)
        cv2.fillPoly(inside, [pads.to_pixels(pad.outline_xy)], 255, cv2.LINE_8, 4)
        inside = cv2.dilate(inside, np.ones((5, 5), np.uint8))  # edges are smooth
        assert np.abs(pad.outline_xy).max() <= 1
        assert (mask > 127).sum() > 100
        if frame != "cross":  # whose letter may be wider than its arms
            assert not (mask[inside == 0] > 127).any()
