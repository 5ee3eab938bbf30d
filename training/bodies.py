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
        Two MJCF meshes, ``name`` for the cabin and ``name_body`` for the body; then all geoms.
    """
    long = random.uniform(3.2, 5.2) if random.random() < 0.75 else random.uniform(5.5, 9)
    wide = long * random.uniform(0.36, 0.46) if long < 5.5 else random.uniform(2, 2.6)
    clear = random.uniform(0.15, 0.4)
    body_high = random.uniform(0.45, 0.8) * (1 if long < 5.5 else 1.4)
    colour = paint(random)
    glass = gray(random, 0.02, 0.16) if random.random() < 0.6 else gray(random, 0.1, 0.6)
    middle, top = clear + body_high / 2, clear + body_high
    parts = [f'<geom type="mesh" mesh="{name}_body" rgba="{colour} 1"/>']
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
    slope = cabin_high * random.uniform(0.15, 1.5)
    narrow = wide / 2 * random.uniform(0.72, 0.96)
    inset = min(slope, (end - start) * 0.36)
    steep = inset * random.uniform(0.2, 1.0)
    body = _body_corners(random, (long / 2, wide / 2), (clear, top), (start, end))
    corners = [(x, y, top) for x in (start, end) for y in (-wide * 0.46, wide * 0.46)]
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
    parts += _wheels(random, long, wide, (clear, body_high)) + _lamps(random, long, wide, middle)
    parts += _mirrors(random, wide / 2, (end - inset / 2, top), colour)
    return _hull(name, corners) + _hull(f"{name}_body", body), "".join(parts)


def _body_corners(
    random: Random,
    half: tuple[float, float],
    z: tuple[float, float],
    cabin: tuple[float, float],
) -> list[tuple[float, float, float]]:
    """Corners of a vehicle's body, a convex hull: round or sharp, level or falling to its ends.

    Args:
        half: of its length and width.
        z: of its lower and upper side.
        cabin: where the cabin begins and ends, along x.
    """
    (x, y), (low, high) = half, z
    tall = high - low
    cut_x, cut_y = random.uniform(0.02, 0.22) * y, random.uniform(0.02, 0.35) * y
    drop = random.uniform(0, 0.35) * tall
    shoulder = random.uniform(0, 0.12) * y
    ends = [(x, y - cut_y), (x - cut_x, y)]
    outline = [(a * along, b * side) for a, b in ends for along in (-1, 1) for side in (-1, 1)]
    corners = [(0.98 * a, 0.96 * b, low) for a, b in outline]
    corners += [(a, b, low + 0.4 * tall) for a, b in outline]
    corners += [(0.98 * a, b - math.copysign(shoulder, b), high - drop) for a, b in outline]
    reach = x - cut_x
    level = (max(cabin[0], -reach), min(cabin[1], reach))
    return corners + [(a, side * (y - shoulder), high) for a in level for side in (-1, 1)]


def _hull(name: str, corners: Sequence[Sequence[float]]) -> str:
    """The convex hull of some corners as a MJCF mesh."""
    return f'<mesh name="{name}" vertex="{" ".join(_text(corner) for corner in corners)}"/>'


def _mirrors(random: Random, y: float, at: tuple[float, float], colour: str) -> list[str]:
    """Two mirrors beside the cabin, or none; ``at`` is their x and z, ``y`` half the width."""
    size = tuple(random.uniform((0.03, 0.08, 0.05), (0.09, 0.16, 0.1)))
    places = ((at[0], side * (y + size[1] / 2), at[1] + size[2]) for side in (-1, 1))
    return [geom("box", size, place, colour) for place in places] if random.random() < 0.5 else []


def _wheels(random: Random, long: float, wide: float, z: tuple[float, float]) -> list[str]:
    """Four wheels; ``z`` is where the body's lower side is, and how tall the body is."""
    radius = (z[0] + random.uniform(0.35, 0.75) * z[1]) / 2
    turned = 'euler="90 0 0"'
    black = gray(random, 0.02, 0.12)
    ends = (-long * random.uniform(0.28, 0.36), long * random.uniform(0.28, 0.36))
    return [
        geom("cylinder", (radius, 0.1), (x, side * (wide / 2 - 0.13), radius), black, turned)
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
    """A standing or walking person with legs, arms and a head, sometimes with a bag."""
    tall = random.uniform(1.2, 1.95)
    hip, neck = 0.48 * tall, 0.82 * tall
    wide = tall * random.uniform(0.1, 0.14)
    skin, hair = paint(random), gray(random, 0.02, 0.4)
    coat = paint(random)
    trousers = gray(random, 0.02, 0.6) if random.random() < 0.7 else paint(random)
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
