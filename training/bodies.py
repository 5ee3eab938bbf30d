"""Bodies of random shapes as MJCF: vehicles, posts, and what stands about.

Each stands on z = 0 of its own frame, whose origin is the point that it stands on. Metres.
"""

from __future__ import annotations

import colorsys
import math
from collections.abc import Sequence

import numpy as np
from grounds import random_colour

Random = np.random.Generator


def geom(
    shape: str,
    size: Sequence[float],
    position: Sequence[float],
    look: str,
    more: str = "",
) -> str:
    """One geom. ``look`` is ``r g b`` in 0 to 1, or a material's name."""
    paint = f'rgba="{look} 1"' if " " in look else f'material="{look}"'
    sizes = f'size="{_text(size)}"' if size else ""
    return f'<geom type="{shape}" {sizes} pos="{_text(position)}" {paint} {more}/>'


def build_post(random: Random) -> str:
    """A post of a strong colour, some with bands of another one, a foot or a knob."""
    tall = random.uniform(0.8, 2.4)
    wide = tall * random.uniform(0.03, 0.1)
    shape = str(random.choice(["cylinder", "cylinder", "box"]))
    colours = [_strong_paint(random), paint(random)]
    bands = 1 if random.random() < 0.6 else int(random.integers(2, 7))
    half = tall / bands / 2
    size = (wide, half) if shape == "cylinder" else (wide, wide, half)
    parts = [
        geom(shape, size, (0, 0, half * (2 * number + 1)), colours[number % 2])
        for number in range(bands)
    ]
    if random.random() < 0.3:
        foot = wide * random.uniform(1.5, 3)
        parts.append(geom("cylinder", (foot, 0.03 * tall), (0, 0, 0.03 * tall), paint(random)))
    if random.random() < 0.25:
        parts.append(geom("sphere", (wide * random.uniform(1, 1.7),), (0, 0, tall), colours[0]))
    return "".join(parts)


def build_vehicle(random: Random, name: str, held_out: bool = False) -> tuple[str, str]:
    """A car, van, truck or the like; x is ahead.

    Returns:
        Its cabin as a MJCF mesh that is called ``name``, and its geoms.
    """
    long = random.uniform(3.2, 5.2) if random.random() < 0.75 else random.uniform(5.5, 9)
    wide = long * random.uniform(0.36, 0.46) if long < 5.5 else random.uniform(2, 2.6)
    clear = random.uniform(0.15, 0.4)
    body_high = random.uniform(0.45, 0.8) * (1 if long < 5.5 else 1.4)
    colour, glass = paint(random), gray(random, 0.02, 0.16)
    middle = clear + body_high / 2
    parts = [geom("box", (long / 2, wide / 2, body_high / 2), (0, 0, middle), colour)]
    top = clear + body_high
    cabin_high = random.uniform(0.45, 0.8) * (1 if long < 5.5 else 1.3)
    kinds = ("sedan", "hatch", "van", "truck", "pickup")
    kind = "tank" if held_out and random.random() < 0.2 else str(random.choice(kinds))
    start, end = {
        "sedan": (-0.34, 0.22),
        "hatch": (-0.48, 0.2),
        "van": (-0.49, 0.38),
        "truck": (0.22, 0.48),
        "pickup": (-0.12, 0.24),
        "tank": (-0.2, 0.2),
    }[kind]
    start, end = start * long, end * long
    slope = cabin_high * random.uniform(0.15, 0.9)
    narrow = wide / 2 * random.uniform(0.72, 0.96)
    inset = min(slope, (end - start) * 0.3)
    steep = inset * random.uniform(0.2, 1.0)
    corners = [(x, y, top) for x in (start, end) for y in (-wide * 0.485, wide * 0.485)]
    corners += [
        (x, y, top + cabin_high) for x in (start + steep, end - inset) for y in (-narrow, narrow)
    ]
    parts.append(f'<geom type="mesh" mesh="{name}" rgba="{glass} 1"/>')
    lid = (end - start - inset - steep) / 2
    at = (start + steep + end - inset) / 2
    parts.append(geom("box", (lid, narrow, 0.035), (at, 0, top + cabin_high + 0.02), colour))
    for x in (start + steep, at, end - inset):  # pillars
        if random.random() < 0.6:
            size = (0.07, narrow + 0.05, cabin_high / 2)
            parts.append(geom("box", size, (x, 0, top + cabin_high / 2), colour))
    if kind == "truck":
        load = random.uniform(0.8, 1.8) * cabin_high
        size = ((start + long / 2) / 2 - 0.05, wide / 2, load / 2)
        place = ((start - long / 2) / 2, 0, top + load / 2)
        parts.append(geom("box", size, place, paint(random)))
    if kind == "pickup":
        size = ((start + long / 2) / 2 - 0.1, wide / 2 - 0.12, 0.02)
        parts.append(geom("box", size, ((start - long / 2) / 2, 0, top), gray(random, 0.05, 0.3)))
    parts += _wheels(random, long, wide, clear) + _lamps(random, long, wide, middle)
    vertices = " ".join(_text(corner) for corner in corners)
    return f'<mesh name="{name}" vertex="{vertices}"/>', "".join(parts)


def _wheels(random: Random, long: float, wide: float, clear: float) -> list[str]:
    radius = clear + random.uniform(0.12, 0.3)
    turned = 'euler="90 0 0"'
    black = gray(random, 0.02, 0.12)
    ends = (-long * random.uniform(0.28, 0.36), long * random.uniform(0.28, 0.36))
    return [
        geom("cylinder", (radius, 0.12), (x, side * (wide / 2 - 0.08), radius), black, turned)
        for x in ends
        for side in (-1, 1)
    ]


def _lamps(random: Random, long: float, wide: float, z: float) -> list[str]:
    size = (0.03, wide * random.uniform(0.06, 0.12), 0.08)
    lamps = [
        geom("box", size, (end * long / 2, side * wide * 0.36, z), colour)
        for end, colour in ((1, "0.95 0.95 0.85"), (-1, "0.8 0.08 0.06"))
        for side in (-1, 1)
    ]
    bumper = geom("box", (0.06, wide * 0.47, 0.09), (long / 2, 0, z - 0.15), gray(random, 0, 0.4))
    return [*lamps, bumper] if random.random() < 0.7 else []


def build_thing(random: Random, material: str) -> str:
    """A person, tree, bush, rock, tank, bale, wall or crate, some with a material's picture.

    What is long and thin is gray or brown: with a strong colour it would look like a post.
    """
    if random.random() < 0.3:
        return _build_person(random)
    kind = int(random.integers(7))
    look = material if random.random() < 0.35 else paint(random)
    a, b, c = random.uniform(0.3, 1.8, 3)
    a, b = max(a, 0.6 * b), max(b, 0.6 * a)
    if kind == 0:
        green = f"{random.uniform(0.1, 0.4):.2f} {random.uniform(0.25, 0.5):.2f} 0.12"
        trunk = geom("cylinder", (0.06 + 0.05 * a, 1.2 * b), (0, 0, 1.2 * b), "0.33 0.24 0.16")
        crown = geom("ellipsoid", (a, a * 0.9, b * 1.3), (0, 0, 2.6 * b), green)
        return trunk + crown + geom("sphere", (0.6 * a,), (0.7 * a, 0.2, 2.2 * b), green)
    if kind == 1:
        bush = f"{random.uniform(0.1, 0.5):.2f} {random.uniform(0.2, 0.5):.2f} 0.15"
        return geom("ellipsoid", (a, b, 0.6 * c), (0, 0, 0.4 * c), bush)
    if kind == 2:
        half = min(0.6 * b, a)
        return geom("cylinder", (1.3 * a, half), (0, 0, half), look)  # a tank, wider than high
    if kind == 3:
        thick = max(0.5 * a, 0.6 * b)  # a bale
        return geom("cylinder", (thick, 0.7 * b), (0, 0, thick), look, 'euler="90 0 0"')
    if kind == 4:
        size = (max(0.1, 0.3 * b), 2.5 * max(a, 0.5 * b), b)
        return geom("box", size, (0, 0, b), gray(random))  # a wall
    if kind == 5:
        size = (0.8 * a, 0.6 * b, 0.5 * c)
        return geom("ellipsoid", size, (0, 0, 0.2 * c), gray(random, 0.3, 0.7))  # a rock
    half = min(0.8 * c, 1.2 * min(a, b))
    return geom("box", (a, b, half), (0, 0, half), look)


def _build_person(random: Random) -> str:
    """Somebody who stands or walks, with legs, arms and a head, sometimes with a bag."""
    tall = random.uniform(1.2, 1.95)
    hip, neck = 0.48 * tall, 0.82 * tall
    wide = tall * random.uniform(0.1, 0.14)
    skin, hair = paint(random), gray(random, 0.02, 0.4)
    coat, trousers = paint(random), paint(random)
    stride = random.uniform(0, 25) if random.random() < 0.7 else 0.0
    parts = []
    for side in (-1, 1):
        turn = side * stride
        reach = hip / 2 * math.sin(math.radians(turn))
        leg = (0.035 * tall, hip / 2 - 0.035 * tall)
        parts.append(
            geom(
                "capsule",
                leg,
                (-reach, side * wide / 2, hip / 2),
                trousers,
                f'euler="0 {turn:.0f} 0"',
            )
        )
        arm, middle = (0.026 * tall, 0.17 * tall), (hip + neck) / 2
        turn = -side * stride + random.normal(0, 8)
        parts.append(
            geom("capsule", arm, (0, side * 1.15 * wide, middle), coat, f'euler="0 {turn:.0f} 0"')
        )
    trunk = (0.6 * wide, wide, (neck - hip) / 2 + 0.02)
    parts.append(
        geom("ellipsoid" if random.random() < 0.5 else "box", trunk, (0, 0, (hip + neck) / 2), coat)
    )
    parts.append(geom("sphere", (0.065 * tall,), (0, 0, neck + 0.08 * tall), skin))
    parts.append(geom("sphere", (0.066 * tall,), (-0.01, 0, neck + 0.095 * tall), hair))
    if random.random() < 0.3:
        bag = (0.08 * tall, 0.08 * tall, 0.1 * tall)
        parts.append(geom("box", bag, (-wide, 0, neck - 0.12 * tall), paint(random)))
    return "".join(parts)


def paint(random: Random) -> str:
    """A colour for a geom, ``r g b`` in 0 to 1."""
    if random.random() < 0.4:
        return " ".join(f"{each:.2f}" for each in random.uniform(0, 1, 3))
    return " ".join(f"{each / 255:.2f}" for each in random_colour(random))


def _strong_paint(random: Random) -> str:
    """A colour that is far from gray, ``r g b`` in 0 to 1."""
    hue, saturation, value = random.uniform((0, 0.55, 0.45), (1, 1, 1))
    return " ".join(f"{each:.2f}" for each in colorsys.hsv_to_rgb(hue, saturation, value))


def gray(random: Random, low: float = 0.15, high: float = 0.85) -> str:
    """A gray between two levels, ``r g b`` in 0 to 1."""
    level = random.uniform(low, high)
    return f"{level:.2f} {level:.2f} {level:.2f}"


def yaw_quat(yaw: float) -> tuple[float, float, float, float]:
    """A turn about z as a quaternion, w x y z."""
    return math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{value:.5g}" for value in values)
