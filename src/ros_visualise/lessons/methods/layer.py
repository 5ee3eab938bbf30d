"""The first layer of a network: 3x3 convolutions of a colour picture, and their kinds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from ros_visualise.data import Floats, Pixels

KINDS = ("edge", "spot", "colour")
"""Kinds of kernels, in the order of the cosines of `likeness`."""

_MIDDLE = 0.5  # subtracted from the colours, 0 to 1, before the first layer
_STRIDE = 2
_GX = np.array([[-1, 0, 1], [-2, 0, 2], [-1, 0, 1]], float)
_CENTRE = np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]], float)
_RING = 1 - _CENTRE


@dataclass(frozen=True, eq=False)
class Layer:
    """``kernels`` (N, 3, 3, 3) are of R, G and B, their rows and columns; ``biases`` (N,)."""

    kernels: Floats
    biases: Floats


def first_layer(metadata: Mapping[str, str]) -> Layer:
    """The first layer, from the metadata of one of our networks."""
    kernels, biases = (json.loads(metadata[f"first_{name}"]) for name in ("kernels", "biases"))
    return Layer(np.array(kernels, np.float32), np.array(biases, np.float32))


def respond(bgr: Pixels, layer: Layer) -> Floats:
    """Output of the layer before its ReLU, (N, rows, columns), at every second pixel.

    Outside, the picture is middle gray, which is zero for the layer.
    """
    rgb = cv2.cvtColor(bgr, cv2.COLOR_BGR2RGB).astype(np.float32) / 255 - np.float32(_MIDDLE)
    wide = np.pad(rgb, ((1, 1), (1, 1), (0, 0)))
    windows = sliding_window_view(wide, (3, 3), axis=(0, 1))[::_STRIDE, ::_STRIDE]
    sums: Floats = np.einsum("kcij,yxcij->kyx", layer.kernels, windows)
    return sums + layer.biases[:, None, None]


def beside(values: Pixels | Floats) -> Pixels | Floats:
    """Values at the pixels where the layer has outputs."""
    return values[::_STRIDE, ::_STRIDE]


def relu(values: Floats) -> Floats:
    """Values with negative ones set to zero."""
    return np.maximum(values, 0)


def sobel_cosines(kernels: Floats) -> Floats:
    """Cosines of the angles to Sobel's Gx and Gy of gray, (N, 2): 1 is equal, -1 opposite."""
    return np.stack([_cosines(kernels, _gray(one)) for one in (_GX, _GX.T)], axis=1)


def likeness(kernels: Floats) -> Floats:
    """Similarity of a kernel to each of `KINDS`: cosines from 0 to 1, (N, 3).

    Each kind is the span of some kernels: an edge of Gx and Gy of gray, a spot of a centre and the
    ring around it in gray, colour of all with zero sum over the colours. They are orthogonal, so
    the squares of the cosines add up to at most 1.
    """
    edge = np.hypot(*sobel_cosines(kernels).T)
    spot = np.hypot(*(_cosines(kernels, _gray(one)) for one in (_CENTRE, _RING)))
    colored = kernels - kernels.mean(axis=1, keepdims=True)
    return np.stack([edge, spot, _lengths(colored) / _lengths(kernels)], axis=1)


def correlation(one: Floats | Pixels, other: Floats | Pixels) -> float:
    """Pearson's coefficient of two pictures of one size; 0 if either is flat."""
    a, b = (np.ravel(values - values.mean(dtype=float)) for values in (one, other))
    return float(a @ b / max(np.linalg.norm(a) * np.linalg.norm(b), 1e-12))


def _gray(kernel: Floats) -> Floats:
    """A kernel (3, 3, 3) that is the same for all colours."""
    return np.stack([kernel] * 3)


def _cosines(kernels: Floats, other: Floats) -> Floats:
    cosines: Floats = np.tensordot(kernels, other, 3) / (_lengths(kernels) * np.linalg.norm(other))
    return cosines


def _lengths(kernels: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(kernels.reshape(len(kernels), -1), axis=1)
    return np.maximum(lengths, 1e-12)
