"""Odometry and IMU that disagree: neither wins silently.

A trusted IMU is followed for a while, and the odometry beside it, as a rival. Meanwhile their
difference is part of the uncertainty. What else measures decides by likelihood; an IMU that is
wrong is ignored, and tried again later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ros_visualise.data import Floats
from ros_visualise.estimation.belief import Belief, ImuTrust, Undecided
from ros_visualise.estimation.camera_view import CameraView
from ros_visualise.estimation.gates import DECIDED, WORST, Innovation
from ros_visualise.estimation.landmark_map import ImageOutcome
from ros_visualise.estimation.measuring import Pair
from ros_visualise.estimation.odometry import (
    OdometryNoise,
    OdometryStep,
    check_odometry,
    propagate_by_odometry,
)
from ros_visualise.estimation.pose_search import apart, completed
from ros_visualise.estimation.robot import POSE
from ros_visualise.estimation.sensors import Reading, Sensor
from ros_visualise.estimation.updating import fits
from ros_visualise.geometry import se3

_MEMORY = 0.99  # smoothing of the rate of disagreements
_TOO_MUCH = 0.2  # of the odometry messages
_CONFIRMED_S = 2.0  # agreement that makes an IMU trusted
_DISAGREEMENT_NS = 2_000_000_000  # longest that a trusted IMU is followed alone, or doubt grows
_SHORTEST_S = 0.02  # of a disagreement


@dataclass(eq=False)
class ImuIsWrong(Exception):
    """The IMU contradicts the odometry: go on from ``belief`` without it."""

    belief: Belief


def compare(belief: Belief, step: OdometryStep, model: OdometryNoise, has_jumped: bool) -> None:
    """Compare the motion by the IMU with a step of odometry.

    Raises:
        ImuIsWrong: see there.
    """
    trust = belief.imu
    checked = check_odometry(belief.state, step, model)
    if checked is not None:
        belief.state = checked
        if belief.rival is not None and not trust.disagreements:
            _widen(belief, apart(belief.rival, belief.state))  # nothing has decided
            belief.rival = None
        agreed_s, rate = trust.agreed_s + step.seconds, trust.rate * _MEMORY
        belief.imu = replace(trust, agreed_s=agreed_s, disagreements=0, rate=rate)
    elif has_jumped or step.is_long:
        belief.note("the odometry restarted elsewhere; continuing from the IMU")
    else:
        _disagree(belief, step, model)


def grow(belief: Belief, to_ns: int) -> None:
    """Let an undecided difference grow until a time, while the odometry alone is followed.

    It does so for 2 s, unless a tag decides: odometry that trembles where it has stopped is not to
    be believed any more than the IMU.
    """
    undecided = belief.imu.undecided
    if undecided is None or to_ns <= undecided.until_ns:
        return
    if belief.tags_ns > undecided.since_ns or to_ns > undecided.end_ns:
        belief.imu = replace(belief.imu, undecided=None)
        return
    before_s, now_s = ((one - undecided.since_ns) / 1e9 for one in (undecided.until_ns, to_ns))
    _widen(belief, undecided.rate * math.sqrt(now_s**2 - before_s**2))
    belief.imu = replace(belief.imu, undecided=undecided._replace(until_ns=to_ns))


def judge_by_tags(belief: Belief, view: CameraView) -> None:
    """Let the tags of an image decide."""
    tags = belief.map.usable(view, ImageOutcome())
    belief.state = belief.map.enter(belief.state, tags)
    keys = belief.map.keys_of(tags)
    if belief.rival is None or not keys:
        return
    belief.rival = completed(belief.rival, belief.state, list(keys.values()))
    pairs = [Pair(sight, keys[sight.name]) for sight in tags if sight.name in keys]
    _decide(belief, *(fits(view, pairs, one) for one in (belief.rival, belief.state)))


def judge_by_sensor(belief: Belief, reading: Reading, sensor: Sensor, params: object) -> None:
    """Let another sensor decide."""
    if belief.rival is None:
        return
    several = [sensor.fit(one, reading, params) for one in (belief.rival, belief.state)]
    odometry, imu = ([fit] if fit is not None else [] for fit in several)
    if odometry and imu:
        _decide(belief, odometry, imu)


def _disagree(belief: Belief, step: OdometryStep, model: OdometryNoise) -> None:
    """Follow a trusted IMU for a while, beside the odometry; else go back to the odometry."""
    trust = belief.imu
    rate = _MEMORY * trust.rate + (1 - _MEMORY)
    since_ns = trust.since_ns if trust.disagreements else step.from_ns
    # no robot stops as odometry that stalls does: even a new IMU is as likely
    is_trusted = trust.agreed_s >= _CONFIRMED_S or step.speed_before > 0
    if is_trusted and step.to_ns - since_ns <= _DISAGREEMENT_NS and rate <= _TOO_MUCH:
        if belief.rival is None and belief.after_odometry is not None:
            belief.rival = belief.after_odometry.state.copy()
            belief.rival_lead = 0.0
            propagate_by_odometry(belief.rival, step, model)
        count = trust.disagreements + 1
        if count == 2:
            belief.note("odometry and IMU disagree: is a wheel slipping, or a sensor stuck?")
        belief.imu = replace(trust, disagreements=count, since_ns=since_ns, rate=rate)
        belief.counts["odometry rejected"] += 1
        return
    if belief.rival is not None:
        _follow_odometry(belief)
        return
    assert belief.after_odometry is not None
    back = belief.after_odometry.copy()
    if rate > _TOO_MUCH:
        _ignore_imu(back)
    else:
        back.imu = replace(trust, rate=rate, ignored_until_ns=step.to_ns)
    back.counts["imu rejected"] += 1
    raise ImuIsWrong(back)


def _ignore_imu(belief: Belief) -> None:
    until_ns = belief.now_ns + round(belief.imu.back_off_s * 1e9)
    belief.imu = ImuTrust(ignored_until_ns=until_ns, back_off_s=2 * belief.imu.back_off_s)
    belief.note("the IMU contradicts the odometry; ignoring the IMU; check its tf frame")


def _follow_odometry(belief: Belief) -> None:
    """Go over to the rival; if nothing has decided, their difference stays uncertain."""
    assert belief.rival is not None
    off, since_ns = apart(belief.rival, belief.state), belief.imu.since_ns
    belief.state, belief.rival, belief.is_by_imu = belief.rival, None, False
    _ignore_imu(belief)
    if belief.rival_lead <= DECIDED:
        _widen(belief, off)
        rate = off / max((belief.now_ns - since_ns) / 1e9, _SHORTEST_S)
        end_ns = belief.now_ns + _DISAGREEMENT_NS
        undecided = Undecided(rate, since_ns, end_ns, belief.now_ns)
        belief.imu = replace(belief.imu, undecided=undecided)
    belief.counts["imu rejected"] += 1


def _widen(belief: Belief, off: Floats) -> None:
    """Add a difference (6,), of the position and about the robot, to the uncertainty."""
    twist = se3.about_origin(belief.state.robot.p) @ off
    belief.state = belief.state.copy()
    belief.state.inflate(POSE, np.multiply.outer(twist, twist))


def _decide(belief: Belief, odometry: list[Innovation], imu: list[Innovation]) -> None:
    """Compare how well measurements fit the rival, by odometry, and the state, by the IMU."""
    by_odometry, by_imu = (sum(max(fit.evidence, WORST) for fit in one) for one in (odometry, imu))
    belief.rival_lead += by_odometry - by_imu
    if belief.rival_lead > DECIDED:
        _follow_odometry(belief)
    elif belief.rival_lead < -DECIDED:
        belief.rival = None
        belief.imu = replace(belief.imu, disagreements=0, rate=0.0)
