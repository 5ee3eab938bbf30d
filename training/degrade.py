"""Effects of a real camera on a picture."""

from __future__ import annotations

import math

import cv2
import numpy as np
from grounds import Canvas, Grains, smooth_noise


def degrade(random: np.random.Generator, picture: Canvas) -> Canvas:
    """Blur, light, colour and noise of a random camera; RGB, the size stays."""
    image = picture.astype(np.float32)
    if random.random() < 0.4:
        image = cv2.GaussianBlur(image, (0, 0), random.uniform(0.3, 1.4))
    if random.random() < 0.2:
        image = _move(random, image)
    if random.random() < 0.2:
        image = _glare(random, image)
    image *= random.uniform(0.92, 1.08, 3).astype(np.float32)
    gain, gamma = math.exp(random.normal(0, 0.25)), math.exp(random.normal(0, 0.2))
    gain *= random.uniform(50, 210) / max(image.mean(), 1) if random.random() < 0.5 else 1.0
    image = 255 * np.power(np.clip(image * gain / 255, 0, 1), gamma)
    if random.random() < 0.25:
        haze = random.uniform(0.05, 0.4)
        image += (random.uniform(120, 240) - image) * haze
    if random.random() < 0.06:
        image[:] = image.mean(axis=2, keepdims=True)
    if random.random() < 0.6:
        grain = random.standard_normal(image.shape, np.float32)
        image += random.uniform(1, 9) * grain
    return np.asarray(np.clip(image, 0, 255), np.uint8)


def _move(random: np.random.Generator, image: Grains) -> Grains:
    """Blur along a line."""
    length = int(random.integers(3, 8))
    kernel = np.zeros((length, length), np.float32)
    turn = random.uniform(0, math.pi)
    reach = (length - 1) / 2 * np.array([math.cos(turn), math.sin(turn)])
    start, end = (
        np.round((length - 1) / 2 + sign * reach).astype(int).tolist() for sign in (-1, 1)
    )
    cv2.line(kernel, start, end, 1.0)
    return np.asarray(cv2.filter2D(image, -1, kernel / kernel.sum()), np.float32)


def _glare(random: np.random.Generator, image: Grains) -> Grains:
    """Bright reflections and dark vignettes."""
    side = image.shape[0]
    light = smooth_noise(random, max(image.shape[:2]), int(random.integers(2, 9)))
    light = light[:side, : image.shape[1], None]
    return np.asarray(image * (1 + random.uniform(0.1, 0.5) * light), np.float32)
