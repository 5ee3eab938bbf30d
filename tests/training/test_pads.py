"""Drawings of helipads, of styles that are trained on and of those held out."""

import itertools

import cv2
import numpy as np
import pads
import pytest

STYLES = [
    *itertools.product([False], sorted(set(pads.FRAMES)), pads.LETTERS),
    *itertools.product([True], pads.HELD_OUT_FRAMES, pads.HELD_OUT_LETTERS),
]


def test_what_is_held_out_is_not_trained_on():
    assert not set(pads.FRAMES) & set(pads.HELD_OUT_FRAMES)
    assert not set(pads.LETTERS) & set(pads.HELD_OUT_LETTERS)


def test_a_cross_is_a_pad_and_no_distractor(monkeypatch):
    """Whether a cross of one colour is a pad must not depend on the half of the world it is in."""
    monkeypatch.setattr(pads, "FRAMES", ("none",))
    monkeypatch.setattr(pads, "LETTERS", ("cross",))
    _, mask = pads.draw_any_pad(np.random.default_rng(1), False)
    quarters = [np.rot90(mask, turns) for turns in range(4)]
    assert all(np.mean(mask != each) < 0.02 for each in quarters)  # an H is not
    assert 0.03 < np.mean(mask > 127) < 0.6


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


@pytest.mark.parametrize("letter", [*pads.LETTERS, *pads.HELD_OUT_LETTERS])
def test_what_has_no_frame_is_painted_by_its_strokes_alone(letter, monkeypatch):
    monkeypatch.setattr(pads, "FRAMES", ("none",))
    monkeypatch.setattr(pads, "LETTERS", (letter,))
    pad, mask = pads.draw_any_pad(np.random.default_rng(2), False)
    strokes = np.zeros_like(mask)
    for stroke in pad.strokes:
        cv2.fillConvexPoly(strokes, pads.to_pixels(stroke), 255, cv2.LINE_8, 4)
    beside = mask[cv2.dilate(strokes, np.ones((5, 5), np.uint8)) == 0]
    assert (beside > 127).sum() < 0.05 * (mask > 127).sum()  # round letters fill their corners
    outline = np.zeros_like(mask)
    cv2.fillConvexPoly(outline, pads.to_pixels(pad.outline_xy), 255, cv2.LINE_8, 4)
    assert (strokes > 0).sum() < 0.9 * (outline > 0).sum()  # the ground between them stays
