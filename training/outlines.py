"""Outlines of bodies from their geoms, and their exact boxes in a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Parts = tuple[Array, ...]
"""Convex groups of points, each (N, 3) metres."""
_NEAR_M = 0.1


@dataclass(frozen=True)
class View:
    """A pinhole camera at a place: square pixels, its principal point in the middle.

    ``R_map_camera`` has x right, y down, z forward; ``focal`` in pixels; ``size`` width, height.
    """

    position_xyz: Array
    R_map_camera: Array
    focal: float
    size: tuple[int, int]

    @property
    def middle(self) -> Array:
        """The principal point; pixel centres are at whole numbers."""
        return (np.array(self.size) - 1) / 2

    def project(self, points_xyz: Array) -> tuple[Array, Array]:
        """Pixels (N, 2) and depths (N,) in metres of points in the world."""
        local = (points_xyz - self.position_xyz) @ self.R_map_camera
        depth = local[:, 2]
        uv = self.focal * local[:, :2] / np.where(depth > 1e-9, depth, 1e-9)[:, None] + self.middle
        return uv, depth

    def ray(self, uv: Array) -> Array:
        """The unit direction (3,) in the world of what is seen at a pixel."""
        local = np.append((uv - self.middle) / self.focal, 1.0)
        return np.asarray(self.R_map_camera @ (local / np.linalg.norm(local)))


def body_parts(model: Any, data: Any, body: int) -> Parts:
    """The outline of all geoms of a body and of those below it, in the body's frame."""
    position, R = data.xpos[body], data.xmat[body].reshape(3, 3)
    parts = []
    for number in range(model.ngeom):
        if model.body_rootid[model.geom_bodyid[number]] != model.body_rootid[body]:
            continue
        local = _geom_points(model, number)
        world = local @ data.geom_xmat[number].reshape(3, 3).T + data.geom_xpos[number]
        parts.append((world - position) @ R)
    return tuple(parts)


def _geom_points(model: Any, number: int) -> Array:
    """Points whose convex hull is a geom, in its frame; curves by so many points."""
    import mujoco

    shape, (a, b, c) = int(model.geom_type[number]), model.geom_size[number]
    kinds = mujoco.mjtGeom
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float64)
    if shape == kinds.mjGEOM_BOX:
        return np.asarray(signs * (a, b, c))
    if shape == kinds.mjGEOM_CYLINDER:
        return np.vstack([_circle(a, -b), _circle(a, b)])
    if shape == kinds.mjGEOM_CAPSULE:
        ball = a * _ball()
        end = np.array([0, 0, b])
        return np.vstack([ball + end, ball - end])
    if shape == kinds.mjGEOM_SPHERE:
        return np.asarray(a * _ball())
    if shape == kinds.mjGEOM_ELLIPSOID:
        return np.asarray(_ball() * (a, b, c))
    if shape == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[number]
        start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        return np.array(model.mesh_vert[start : start + count], np.float64)
    raise ValueError(f"a {kinds(shape).name} has no outline: use boxes, cylinders, meshes or balls")


def _circle(radius: float, z: float, count: int = 48) -> Array:
    angle = 2 * math.pi * np.arange(count) / count
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.full(count, z)], axis=1)


def _ball(rings: int = 25) -> Array:
    tilt = np.linspace(-math.pi / 2, math.pi / 2, rings)
    return np.vstack([_circle(math.cos(each), math.sin(each)) for each in tilt])


def clip_parts(view: View, parts_xyz: Parts) -> tuple[list[Array], Array] | None:
    """The silhouettes of convex parts in a picture.

    Returns:
        The convex polygons (N, 2) that lie in the picture, and the box (4,) x0 y0 x1 y1 of the
        whole, beyond the picture's edges too; None where a part reaches behind the camera.
    """
    width, height = view.size
    frame = np.array([[-0.5, -0.5], [width - 0.5, -0.5], [width - 0.5, height - 0.5]])
    frame = np.vstack([frame, [[-0.5, height - 0.5]]]).astype(np.float32)
    polygons, low, high = [], np.full(2, np.inf), np.full(2, -np.inf)
    for part in parts_xyz:
        uv, depth = view.project(part)
        if depth.min() < _NEAR_M:
            return None
        hull = cv2.convexHull(uv.astype(np.float32))
        low = np.minimum(low, hull[:, 0].min(axis=0))
        high = np.maximum(high, hull[:, 0].max(axis=0))
        area, inside = cv2.intersectConvexConvex(hull, frame)
        if area > 0 and inside is not None:
            polygons.append(inside.reshape(-1, 2).astype(np.float64))
    return polygons, np.concatenate([low, high])


def box_of(polygons: list[Array]) -> Array:
    """(4,) x0 y0 x1 y1 around polygons, pixels; a pixel reaches half a pixel from its centre."""
    points = np.vstack(polygons)
    return np.concatenate([points.min(axis=0), points.max(axis=0)])


def hull_of(polygons: list[Array]) -> Array:
    """(N, 2) the convex outline of polygons, pixels."""
    return np.asarray(cv2.convexHull(np.vstack(polygons).astype(np.float32))[:, 0], np.float64)


def turned_sides(polygons: list[Array]) -> Array:
    """(2,) the longer and the shorter side, pixels, of the smallest rectangle around polygons."""
    sides = cv2.minAreaRect(np.vstack(polygons).astype(np.float32))[1]
    return np.sort(np.array(sides, np.float64))[::-1]


def visible_share(
    world: Any, view: View, body: int, polygons: list[Array], random: np.random.Generator
) -> float:
    """Visible fraction of a body, 0 to 1, by rays through its silhouette.

    Args:
        world: with the ``model`` and its ``data``.
    """
    import mujoco

    model, data = world.model, world.data
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    hit, seen, count = np.zeros(1, np.int32), 0, 0
    for polygon in polygons:
        weights = random.dirichlet(np.ones(len(polygon)), max(3, 24 // len(polygons)))
        for uv in weights @ polygon:
            far = mujoco.mj_ray(
                model, data, view.position_xyz, view.ray(uv), groups, 1, -1, hit, None
            )
            own = far >= 0 and model.body_rootid[model.geom_bodyid[hit[0]]] == body
            seen, count = seen + own, count + 1
    return seen / max(count, 1)
