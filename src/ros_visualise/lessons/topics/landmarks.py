"""The pose of a tag in a picture: corners, homography, two poses, an ellipse."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from ros_visualise.core.params import param
from ros_visualise.data import CameraInfo, Floats, Image, Message
from ros_visualise.geometry import rotations
from ros_visualise.landmarks.pose import PoseEstimate, square_poses, squares_poses
from ros_visualise.lessons.lesson import GIVES, TAKES, WIDTH, Lesson, Step, show, work_of
from ros_visualise.lessons.magnifier import Zoom
from ros_visualise.lessons.methods.camera import camera_matrix, project
from ros_visualise.lessons.methods.homography import apply, ellipse, homography
from ros_visualise.lessons.methods.tags import SQUARE, TagSeen, draw_tag, find_tag
from ros_visualise.nodes import node
from ros_visualise.plotting.axes import PlotAxes
from ros_visualise.plotting.colors import BLUE, GREEN, ORANGE, RED
from ros_visualise.plotting.figure import Figure

_TRIALS = 300
_OUTER = 1 - np.exp(-2)  # of a normal distribution, within two standard deviations


@dataclass(frozen=True)
class TagLessonParams:
    """The camera, and the tag to draw into a picture without one."""

    focal: float = param(0.9, "focal length as a fraction of the image's width", min=0.2, max=5,
                         slider=(0.3, 2))  # fmt: skip
    size: float = param(
        0.16, "side of the black square, metres", min=0.01, max=10, slider=(0.02, 1)
    )
    distance: float = param(1.5, "distance to the drawn tag, metres", min=0.1, max=100,
                            slider=(0.3, 4))  # fmt: skip
    tilt: float = param(15.0, "backward tilt of the drawn tag, degrees", min=-80, max=80)
    turn: float = param(10.0, "yaw of the drawn tag, degrees", min=-80, max=80)


@node("tag", params=TagLessonParams, inputs=TAKES, outputs=GIVES)
def tag(image: Image, params: TagLessonParams) -> dict[str, Message]:
    """A tag: a square with an encoded number."""
    bgr = work_of(image, np.ndarray)
    height, width = bgr.shape[:2]
    K = camera_matrix(params.focal * width, width, height)
    info = CameraInfo(height, width, K)
    turned = np.radians([params.tilt, params.turn, 0])
    seen = find_tag(TagSeen(bgr, info, params.size, None))
    if seen is None:
        seen = find_tag(draw_tag(bgr, info, params.size, params.distance, turned))
    if seen is None:
        text = """
            There is no tag in your picture, and the drawn one is too small, too slanted, or outside
            the picture. Move the sliders of this step.
            """
        return show(image, bgr, text, TagSeen(bgr, info, params.size, None))
    figure = Figure(width, height)
    figure.picture((0, 0, width, height), seen.picture)
    figure.line(seen.corners[[0, 1, 2, 3, 0]], GREEN, 2)
    origin = (
        "found in your picture"
        if seen.truth is None
        else "drawn into your picture, which has no tag"
    )
    text = f"""
        A tag is a black square, which is easy to find, with black and white cells in it that encode
        its number. Here is {seen.name}, {origin}. The tags of this family differ from one another
        in at least 11 cells, so even with five wrong cells the number is still clear.
        """
    return show(image, figure, text, seen)


@node("corners", inputs=TAKES, outputs=GIVES)
def corners(image: Image, params: object) -> dict[str, Message]:
    """Its four corners, to a fraction of a pixel."""
    seen = _tag_of(image)
    if seen is None:
        return show(image, image.pixels, _NOTHING)
    side = WIDTH // 2
    figure = Figure(WIDTH, WIDTH)
    for number, (u, v) in enumerate(seen.corners):
        box = ((number % 2) * side + 2, (number // 2) * side + 2, side - 4, side - 4)
        zoom = Zoom(figure, box, (round(u), round(v)), 6)
        zoom.draw(seen.picture)
        x, y = zoom.place(u, v)
        figure.dot(x, y, 6, RED)
    rows = "\n".join(f"    {name}  ({u:8.3f}, {v:8.3f})"
                     for name, (u, v) in zip(_CORNERS, seen.corners, strict=True))  # fmt: skip
    text = f"""
A line is fitted to many edge pixels along each side. The corners are where two lines meet, so they
are known to much better than one pixel:

{rows}

{_corner_error(seen)}
"""
    return show(image, figure, text, seen)


@node("homography", inputs=TAKES, outputs=GIVES)
def plane(image: Image, params: object) -> dict[str, Message]:
    """The homography: from the plane of the tag to the picture."""
    seen = _tag_of(image)
    if seen is None:
        return show(image, image.pixels, _NOTHING)
    H = homography(SQUARE, seen.corners)
    to_square = np.array([[1 / 240.0, 0, -0.75], [0, -1 / 240.0, 0.75], [0, 0, 1]])
    flat = cv2.warpPerspective(seen.picture, H @ to_square, (360, 360),
                               flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)  # fmt: skip
    rows = "\n".join("    " + " ".join(f"{one:9.4f}" for one in row) for row in H)
    middle = apply(H, np.zeros((1, 2)))[0]
    text = f"""
A point x of a plane and its pixel u in the picture are linked by a matrix of nine numbers, the
homography: u ~ H x (equal up to scale; x in units of the tag's side). As the scale is
free, there are eight unknowns. Each corner gives two equations, so four corners are enough:

{rows}

With H the tag is drawn as if seen straight from the front, and its cells are read. The centre of
the tag is at ({middle[0]:.2f}, {middle[1]:.2f}). Because of the perspective, the mean of its
corners differs from it: ({seen.corners[:, 0].mean():.2f}, {seen.corners[:, 1].mean():.2f}).
"""
    return show(image, flat, text)


@dataclass(frozen=True)
class CornerParams:
    """Accuracy of the corners."""

    sigma: float = param(0.5, "standard deviation of a corner's coordinates, pixels", min=0.01,
                         max=10, slider=(0.05, 2))  # fmt: skip


@node("poses", params=CornerParams, inputs=TAKES, outputs=GIVES)
def poses(image: Image, params: CornerParams) -> dict[str, Message]:
    """Two poses: a square's picture can be read in two ways."""
    seen = _tag_of(image)
    found = () if seen is None else square_poses(seen.corners, seen.size_m, seen.info, params.sigma)
    if seen is None or not found:
        return show(image, image.pixels, _NOTHING)
    best = found[0]
    rows = "\n".join(map(_described, found))
    text = f"""
The homography, the size of the tag ({seen.size_m:g} m) and the focal length of the camera
({seen.info.K[0, 0]:.0f} pixels; a guess, if your camera is not calibrated) together give the pose
of the tag: its position and its orientation. It is {np.linalg.norm(best.position_xyz):.3f} m away.

From far away a square that is tilted to the left looks like one that is tilted to the right, so
there can be two readings. With corners that are off by {params.sigma:g} pixels, the table shows for
each reading its probability, the position of the tag, and how far the corners are from where they
should be:

{rows}

For each reading, a box half as high as it is wide is drawn standing on the tag: green for the
likelier one, orange for the other. {_other(found)}
"""
    return show(image, _draw_poses(seen, found), text)


@node("ellipse", params=CornerParams, inputs=TAKES, outputs=GIVES)
def uncertainty(image: Image, params: CornerParams) -> dict[str, Message]:
    """The covariance: position uncertainty."""
    seen = _tag_of(image)
    found = () if seen is None else square_poses(seen.corners, seen.size_m, seen.info, params.sigma)
    if seen is None or not found:
        return show(image, image.pixels, _NOTHING)
    best = found[0]
    tried = _tried(seen, params.sigma, best)
    spread = best.covariance[[0, 2]][:, [0, 2]]
    deviations = np.sqrt(np.diag(best.covariance))
    away = (tried - best.position_xyz)[:, [0, 2]]
    squared = np.einsum("ni,ij,nj->n", away, np.linalg.inv(spread), away)
    text = f"""
        If corners are off by {params.sigma:g} pixels, the tag's computed position is off too. The
        covariance of the pose is a measure of that (to first order):

            Σ = (Jᵀ J)⁻¹ σ²
            J: how the corners move with the pose

        The figure shows the position from above: each of the {len(tried)} dots was computed from
        corners with random noise. In theory the inner ellipse holds 39 % of them, the outer one 86
        %; here they hold {100 * (squared < 1).mean():.0f} % and {100 * (squared < 4).mean():.0f} %.
        With {len(tried)} random dots, a difference of up to
        {200 * np.sqrt(_OUTER * (1 - _OUTER) / max(len(tried), 1)):.0f} percentage points is usual;
        a larger one is beyond this first-order theory. The standard deviation is
        {1000 * deviations[0]:.2f} mm sideways, and {1000 * deviations[2]:.2f} mm along the camera's
        axis.
        """
    return show(image, _draw_ellipse(away * 1000, spread * 1e6), text)


LESSON = Lesson(
    "landmarks",
    "how a tag tells where it is: corners, homography, its two poses, covariance as an ellipse",
    """
    A robot that sees an object of known size and shape can compute its own pose. The images show
    how, using a tag that is in your picture ({width} x {height} pixels) or is drawn into it.
    """,
    [
        Step(tag),
        Step(corners, "tag"),
        Step(plane, "tag"),
        Step(poses, "tag"),
        Step(uncertainty, "tag"),
    ],
)

_CORNERS = ("lower left ", "lower right", "upper right", "upper left ")
_NOTHING = "No tag: see the first step."


def _tag_of(image: Image) -> TagSeen | None:
    seen = work_of(image, TagSeen)
    return seen if seen.name else None


def _corner_error(seen: TagSeen) -> str:
    if seen.truth is None:
        return "Their error is unknown, because the truth is not known for your own picture."
    error = np.linalg.norm(seen.corners - seen.truth, axis=1)
    return f"Their error is {error.mean():.3f} pixels on average, {error.max():.3f} at most."


def _described(pose: PoseEstimate) -> str:
    x, y, z = pose.position_xyz.round(3) + 0.0  # no minus before a zero
    return f"    {pose.probability:6.1%}  ({x:.3f}, {y:.3f}, {z:.3f}) m  {pose.rms_px:.3f} px"


def _other(found: tuple[PoseEstimate, ...]) -> str:
    if len(found) < 2:
        return "Here the perspective rules out the other reading: the tag is near, or tilted a lot."
    one, other = (rotations.to_matrix(pose.quat_xyzw)[:, 2] for pose in found[:2])
    angle = np.degrees(np.arccos(np.clip(one @ other, -1, 1)))
    return f"The two are {angle:.0f}° apart."


def _draw_poses(seen: TagSeen, found: Sequence[PoseEstimate]) -> Figure:
    """The tag, enlarged, as the floor of a box for each reading; the likeliest is drawn last."""
    reach = 1.3 * float(np.ptp(seen.corners, axis=0).max())
    middle = seen.corners.mean(axis=0)
    half = np.array([1.3, 1.0]) * reach
    low = np.clip(np.floor(middle - half), 0, None).astype(int)
    high = np.ceil(middle + half).astype(int) + 1
    part = np.ascontiguousarray(seen.picture[low[1] : high[1], low[0] : high[0]])
    scale = WIDTH / part.shape[1]
    figure = Figure(WIDTH, round(scale * part.shape[0]))
    figure.picture((0, 0, WIDTH, scale * part.shape[0]), part)
    corners = np.array([[x, y, z] for z in (0, 0.5) for x, y in SQUARE]) * seen.size_m
    for pose, color in reversed(list(zip(found, (GREEN, ORANGE), strict=False))):
        points = corners @ rotations.to_matrix(pose.quat_xyzw).T + pose.position_xyz
        places = (project(points, seen.info.K) + 0.5 - low) * scale
        for line in ([0, 1, 2, 3, 0], [4, 5, 6, 7, 4], [0, 4], [1, 5], [2, 6], [3, 7]):
            figure.line(places[line], color, 3)
    return figure


def _tried(seen: TagSeen, sigma: float, best: PoseEstimate) -> Floats:
    """Positions (N, 3), metres, from noisy corners.

    Each by the reading whose attitude is nearest to the best one's: the positions of two readings
    differ less than noise moves them.
    """
    random = np.random.default_rng(0)
    noisy = seen.corners + random.normal(0, sigma, (_TRIALS, 4, 2))
    several = squares_poses(
        noisy, np.full(_TRIALS, seen.size_m), seen.info, np.full(_TRIALS, sigma)
    )

    def likeness(one: PoseEstimate) -> float:
        return abs(float(one.quat_xyzw @ best.quat_xyzw))

    nearest = [max(some, key=likeness) for some in several if some]
    return np.array([one.position_xyz for one in nearest]).reshape(-1, 3)


def _draw_ellipse(away_mm: Floats, covariance: Floats) -> Figure:
    """Dots and ellipses from above: x to the right, y ahead."""
    figure = Figure(WIDTH, 480)
    lines = [ellipse(covariance, count) for count in (1, 2)]
    reach = np.abs(np.concatenate([*lines, away_mm])).max(axis=0)
    axes = PlotAxes(figure, (70, 30, WIDTH - 90, 390), -reach, reach, equal=True)
    axes.draw("to the right (mm)", "ahead (mm)")
    for x, y in axes.places(away_mm):
        figure.dot(x, y, 2, BLUE)
    for line in lines:
        axes.curve(line, RED, 2)
    return figure
