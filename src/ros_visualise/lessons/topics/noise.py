"""Noise, and smoothing against it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import Image, Message, Pixels
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.methods.quality import FULL, mean_square, psnr
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import INK, RED
from ros_visualise.plotting.figure import Figure
from ros_visualise.vision.smoothing import bilateral, median, sigma_of


class NoiseModel(Enum):
    """Models of noise."""

    GAUSSIAN = "gaussian"
    SALT_AND_PEPPER = "salt_and_pepper"
    POISSON = "poisson"


@dataclass(frozen=True)
class NoiseParams:
    """Noise added to the picture."""

    model: NoiseModel = param(
        NoiseModel.GAUSSIAN,
        "gaussian: from the electronics; salt_and_pepper: from broken pixels; poisson: from light"
        " itself",
    )
    strength: float = param(
        20.0,
        "standard deviation, levels (for poisson, at white); for salt_and_pepper, percentage of"
        " pixels",
        min=0,
        max=100,
    )
    seed: int = param(0, "seed of the random numbers", min=0, max=1000, slider=(0, 20))


@dataclass(frozen=True, eq=False)
class _Noisy:
    """The gray picture without and with noise."""

    clean: Pixels
    noisy: Pixels


@node("noisy", params=NoiseParams, inputs=TAKES, outputs=GIVES)
def noisy(image: Image, params: NoiseParams) -> dict[str, Message]:
    """The picture with noise."""
    clean = cv2.cvtColor(work_of(image, np.ndarray), cv2.COLOR_BGR2GRAY)
    added = add_noise(clean, params.model, params.strength, params.seed)
    work = _Noisy(clean, added)
    error = mean_square(added, clean)
    model = _MODELS[params.model].format(strength=params.strength)
    text = f"""
        {model}

        How far a picture is from the truth is measured by the peak signal-to-noise ratio:

            PSNR = 10 log₁₀(255² / MSE)

        MSE is the mean of the squared differences.

        Here the MSE is {error:.1f}, its square root {math.sqrt(error):.1f} levels, and the PSNR
        {psnr(added, clean):.2f} dB. 20 dB means an error of a tenth of the full range (255 / 10),
        40 dB a hundredth.
        """
    return show(image, added, text, work)


@dataclass(frozen=True)
class GaussParams:
    """Strength of the smoothing."""

    sigma: float = param(1.2, "standard deviation, pixels", min=0.3, max=20, slider=(0.3, 5))


@node("gauss", params=GaussParams, inputs=TAKES, outputs=GIVES)
def gauss(image: Image, params: GaussParams) -> dict[str, Message]:
    """A Gaussian: the weighted mean of the neighbours."""
    work = work_of(image, _Noisy)
    smoothed = cv2.GaussianBlur(work.noisy, (0, 0), params.sigma)
    weights = cv2.getGaussianKernel(round(6 * params.sigma + 1) | 1, params.sigma)
    left = float((weights**2).sum())
    text = f"""
        Noise makes a pixel too bright as often as too dark, so it averages out in a mean. Each
        pixel becomes the mean of its neighbours, weighted by a Gaussian of their distance d:

            w(d) = exp(−d² / 2σ²),   σ = {params.sigma:g}

        This multiplies the standard deviation of independent noise by √(Σ w²) / Σ w = {left:.2f},
        about 1 / (2σ√π) if σ is not small. But edges are averaged too, and become soft.
        {_result(work, smoothed)}
        """
    return show(image, _beside(work, smoothed), text)


@dataclass(frozen=True)
class MedianParams:
    """Size of the window."""

    size: int = param(3, "width of the window, pixels; even values are rounded up to odd",
                      min=3, max=31, slider=(3, 15))  # fmt: skip


@node("median", params=MedianParams, inputs=TAKES, outputs=GIVES)
def by_median(image: Image, params: MedianParams) -> dict[str, Message]:
    """A median: the middle level of the neighbours."""
    work = work_of(image, _Noisy)
    size = params.size | 1
    smoothed = median(work.noisy, size)
    text = f"""
        The {size**2} levels in the {size} × {size} window around a pixel are sorted, and the middle
        one is taken. A level that is far off, such as that of a broken pixel, has no influence.
        Straight edges stay where they are; corners are rounded, and thin lines vanish.
        {_result(work, smoothed)}
        """
    return show(image, _beside(work, smoothed), text)


@dataclass(frozen=True)
class BilateralParams:
    """Size of the window, and allowed difference of levels."""

    size: int = param(7, "width of the window, pixels; even values are rounded up to odd",
                      min=3, max=31, slider=(3, 15))  # fmt: skip
    sigma_color: float = param(
        50.0,
        "standard deviation of the Gaussian that weights neighbours by difference in level",
        min=1,
        max=255,
        slider=(1, 150),
    )


@node("bilateral", params=BilateralParams, inputs=TAKES, outputs=GIVES)
def by_bilateral(image: Image, params: BilateralParams) -> dict[str, Message]:
    """A bilateral filter: the mean of similar neighbours."""
    work = work_of(image, _Noisy)
    size = params.size | 1
    smoothed = bilateral(work.noisy, size, params.sigma_color, sigma_of(size))
    text = f"""
        The nearer a neighbour is, and the more similar its level, the more it counts (Tomasi and
        Manduchi, 1998):

            w = exp(−d² / 2σ²) · exp(−l² / 2σ_c²)
            l: difference in level,   σ_c = {params.sigma_color:g}

        Pixels on the other side of an edge are not similar, so edges stay sharp. Salt and pepper
        stays too: nothing near it is similar. {_result(work, smoothed)}
        """
    return show(image, _beside(work, smoothed), text)


LESSON = Lesson(
    "noise",
    "noise models, and smoothing with Gaussian, median and bilateral filters, compared by PSNR",
    """
    Every measurement has noise. Here your picture of {width} x {height} pixels, in gray, is the
    truth. Noise is added to it, so that we can measure how much of the noise each filter removes.
    """,
    [Step(noisy), Step(gauss), Step(by_median, "noisy"), Step(by_bilateral, "noisy")],
)

_MODELS = {
    NoiseModel.GAUSSIAN: "A random number with a standard deviation of {strength:g} levels is added"
    " to each pixel, like the noise of the electronics.",
    NoiseModel.SALT_AND_PEPPER: "{strength:g} % of the pixels are black or white, as if they were"
    " broken or had been lost in transmission.",
    NoiseModel.POISSON: "Light comes in photons, and how many arrive is random: the variance equals"
    " the mean number. So bright pixels have more noise; white has a standard deviation of "
    "{strength:g} levels.",
}


def add_noise(gray: Pixels, model: NoiseModel, strength: float, seed: int) -> Pixels:
    """A picture with noise, 8 bits.

    Args:
        gray: 8 bits.
        model: of the noise.
        strength: standard deviation in levels (of white, for Poisson), or per cent of the pixels.
        seed: of the random numbers.
    """
    random = np.random.default_rng(seed)
    if model is NoiseModel.SALT_AND_PEPPER:
        chance = random.random(gray.shape)
        broken: Pixels = np.where(random.random(gray.shape) < 0.5, np.uint8(0), np.uint8(FULL))
        return np.where(chance < strength / 100, broken, gray)
    if model is NoiseModel.POISSON and strength > 0:
        photons = (FULL / strength) ** 2 / FULL  # for a level
        found = random.poisson(gray * photons) / photons
    else:
        found = gray + random.normal(0, strength, gray.shape)
    added: Pixels = np.rint(found).clip(0, FULL).astype(np.uint8)
    return added


def _result(work: _Noisy, smoothed: Pixels) -> str:
    before, after = psnr(work.noisy, work.clean), psnr(smoothed, work.clean)
    return f"PSNR: {before:.2f} dB before, {after:.2f} dB after: {after - before:+.2f} dB."


def _beside(work: _Noisy, smoothed: Pixels) -> Figure:
    """The smoothed picture, and a row of it before and after."""
    width = WIDTH
    shown = (width - 70) * smoothed.shape[0] / smoothed.shape[1]
    figure = Figure(width, round(shown + 190))
    figure.picture((60, 0, width - 70, shown), smoothed)
    row = smoothed.shape[0] // 2
    axes = PlotAxes(figure, (60, shown + 30, width - 70, 110), np.zeros(2),
                np.array([smoothed.shape[1] - 1.0, FULL]))  # fmt: skip
    axes.draw("x (pixels)", f"level along row {row}: noisy, truth and smoothed")
    x = np.arange(smoothed.shape[1])
    curves = ((work.noisy, (205, 205, 205)), (work.clean, INK), (smoothed, RED))
    for values, color in curves:
        axes.curve(np.stack([x, values[row]], axis=1).astype(float), color, 1.3)
    return figure
