"""Flight modes of PX4, for a vehicle that follows velocities: what a simulated autopilot does.

Source: PX4 1.15, its user guide's pages on flight modes and safety, `precland.cpp`, and the
defaults of the parameters that are named here.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np

from ros_visualise.data import Floats

log = logging.getLogger(__name__)

PARAMETERS: dict[str, float] = {
    "COM_DISARM_LAND": 2.0,
    "COM_DISARM_PRFLT": 10.0,
    "COM_DL_LOSS_T": 10,
    "COM_OBL_RC_ACT": 5,
    "COM_OF_LOSS_T": 1.0,
    "EKF2_EVA_NOISE": 0.1,
    "EKF2_EVP_GATE": 5.0,
    "EKF2_EVP_NOISE": 0.1,
    "EKF2_EV_DELAY": 0.0,
    "EKF2_GPS_CTRL": 7,
    "EKF2_NOAID_TOUT": 5_000_000,
    "MIS_TAKEOFF_ALT": 2.5,
    "MPC_LAND_SPEED": 0.7,
    "MPC_TKO_SPEED": 1.5,
    "MPC_XY_CRUISE": 5.0,
    "MPC_XY_P": 0.95,
    "MPC_Z_P": 1.0,
    "MPC_Z_V_AUTO_DN": 1.5,
    "MPC_Z_V_AUTO_UP": 3.0,
    "NAV_DLL_ACT": 0,
    "PLD_BTOUT": 5.0,
    "PLD_FAPPR_ALT": 0.1,
    "PLD_HACC_RAD": 0.2,
    "PLD_MAX_SRCH": 3,
    "PLD_SRCH_ALT": 10.0,
    "PLD_SRCH_TOUT": 10.0,
    "RTL_RETURN_ALT": 10.0,
}
"""PX4's names of parameters -> values; integers are INT32. Defaults are PX4's, but for
COM_OBL_RC_ACT, which is to hold, as there is no remote control, and a lower RTL_RETURN_ALT."""

_TURN = 2.0  # 1/s: response to a heading
_MOST_TURN = math.radians(45)  # per second
_ARRIVED_M, _CLOSE_M = 0.2, 0.5
_STILL_M_S, _LANDED_S = 0.1, 1.0
_LIFTED_M = 0.15
_SETTLING_S = 2.0  # it is held down after it was disarmed
_FEET_M = 0.2  # from its middle to its feet
_HELD_M_S = 0.5  # above a target, before the descent
_FRESH_S = 0.5  # age of a target while descending, unless it is low
_LOW_M = 1.0


class Px4Mode(Enum):
    """Modes: main and sub mode of ``custom_mode``."""

    HOLD = 4, 3
    TAKEOFF = 4, 2
    RETURN = 4, 5
    LAND = 4, 6
    PRECISION_LAND = 4, 9
    OFFBOARD = 6, 0


class NedState(NamedTuple):
    """The vehicle's estimate of itself: time, position, velocity (north, east, down), heading."""

    time_s: float
    position: Floats
    velocity: Floats
    yaw: float


class NedSetPoint(NamedTuple):
    """A set point: position and velocity (north, east, down; NaN: not given), and heading."""

    position: Floats
    velocity: Floats
    yaw: float = math.nan
    yaw_rate: float = math.nan


class NedCommand(NamedTuple):
    """Velocity north, east, down in m/s, and turn to the right in rad/s."""

    velocity: Floats
    turn: float


@dataclass
class _Approach:
    """Progress of a precision landing."""

    descends: bool = False
    sinks: bool = False  # down to the ground, whatever is seen
    searches: int = 0
    since_s: float = math.inf  # of the present search


class Px4Modes:
    """The modes, and what they make of commands, set points and landing targets.

    Args:
        parameters: as `PARAMETERS`; may change at any time.
        say: shows a text to ground stations.

    Attributes:
        mode: the mode.
        armed: it follows commands.
        landed: it is on the ground.
        home: where it was armed, north, east, down.
    """

    def __init__(self, parameters: dict[str, float], say: Callable[[str], None]) -> None:
        self.mode, self.armed, self.landed = Px4Mode.HOLD, False, True
        self.home: Floats = np.zeros(3)
        self._p, self._say = parameters, say
        self._now: NedState | None = None
        self._goal = NedSetPoint(np.zeros(3), np.full(3, math.nan))
        self._set_point: tuple[float, NedSetPoint] | None = None  # of offboard control
        self._target: tuple[float, Floats] | None = None
        self._approach = _Approach()
        self._armed_s = self._disarmed_s = self._heard_s = self._moved_s = -math.inf
        self._ground = 0.0  # down, where it took off or landed
        self._wanted = NedCommand(np.zeros(3), 0.0)

    def arm(self) -> str:
        """Arm; the reason why not, or empty."""
        if self._now is None:
            return "no position estimate"
        if not self.armed:
            self.armed, self._armed_s, self.home = True, self._now.time_s, self._now.position
            if self.mode not in (Px4Mode.TAKEOFF, Px4Mode.OFFBOARD):
                self._hold()
        return ""

    def disarm(self) -> str:
        """Disarm; the reason why not, or empty."""
        if self.armed and not self.landed:
            return "not landed"
        if self.armed and self._now is not None:
            self.armed, self._disarmed_s = False, self._now.time_s
        return ""

    def enter(self, mode: Px4Mode) -> str:
        """Change the mode; the reason why not, or empty."""
        if self._now is None:
            return "no position estimate"
        if mode is Px4Mode.OFFBOARD and not self._has_set_points:
            return "no offboard setpoints"
        here = self._now.position
        if mode is Px4Mode.TAKEOFF:
            ground = self.home if self.armed else here
            return self.take_off(self._p["MIS_TAKEOFF_ALT"] - float(ground[2]))
        if mode is Px4Mode.RETURN:
            high = min(float(here[2]), float(self.home[2]) - self._p["RTL_RETURN_ALT"])
            self._go(np.array([here[0], here[1], high]))
        else:
            self._hold()
        self._approach = _Approach()
        self.mode = mode
        return ""

    def take_off(self, height_m: float) -> str:
        """Rise to a height above the local origin; the reason why not, or empty."""
        assert self._now is not None
        north, east, _ = self._now.position
        self._go(np.array([north, east, -height_m]), self._now.yaw)
        self.mode = Px4Mode.TAKEOFF
        return ""

    def go_to(self, position: Floats, yaw: float) -> str:
        """Fly to a place and hold there, NaN: as it is now; the reason why not, or empty."""
        assert self._now is not None
        if self.landed:
            return "on the ground; take off first"
        here = self._goal.position if self.mode is Px4Mode.HOLD else self._now.position
        self._go(np.where(np.isnan(position), here, position), yaw)
        self.mode = Px4Mode.HOLD
        return ""

    def set_point(self, time_s: float, set_point: NedSetPoint) -> None:
        """Take a set point of offboard control."""
        self._set_point = time_s, set_point

    def target(self, time_s: float, position: Floats) -> None:
        """Take the place of a landing target."""
        self._target = time_s, position

    def shift(self, moved: Floats, turned: float) -> None:
        """Follow a jump of the estimate, so that the vehicle stays where it is."""
        goal = self._goal
        self._goal = goal._replace(position=goal.position + moved, yaw=goal.yaw + turned)
        self.home, self._ground = self.home + moved, self._ground + float(moved[2])
        self._target = None
        if self._now is not None:
            self._now = self._now._replace(position=self._now.position + moved)

    def lose_position(self) -> None:
        """Descend, as the position is unknown."""
        if not self.landed:
            self._fall_back(Px4Mode.LAND, "position")

    def heard(self, time_s: float) -> None:
        """Take note that a ground station or a companion is there."""
        self._heard_s = time_s

    def step(self, now: NedState) -> NedCommand | None:
        """The command of one step; None while it is disarmed."""
        self._now = now
        self._watch_ground(now)
        if self.armed:
            self._fail_safe(now)
        elif now.time_s - self._disarmed_s > _SETTLING_S:
            return None
        down = NedCommand(np.array([0.0, 0.0, self._p["MPC_LAND_SPEED"]]), 0.0)
        is_done = self.landed and self.mode not in (Px4Mode.TAKEOFF, Px4Mode.OFFBOARD)
        self._wanted = down if is_done or not self.armed else self._choose(now)
        return self._wanted

    def _choose(self, now: NedState) -> NedCommand:
        if self.mode is Px4Mode.OFFBOARD and self._set_point is not None:
            return self._follow(now, self._set_point[1])
        if self.mode is Px4Mode.LAND:
            return self._sink(now, self._goal.position)
        if self.mode is Px4Mode.PRECISION_LAND:
            return self._land_on_target(now)
        away_m = float(np.linalg.norm(self._goal.position - now.position))
        if self.mode is Px4Mode.TAKEOFF and away_m < _CLOSE_M:
            self.mode = Px4Mode.HOLD
        if self.mode is Px4Mode.RETURN and away_m < _CLOSE_M:
            self._return_on(now)
        return self._follow(now, self._goal)

    def _return_on(self, now: NedState) -> None:
        """Above the start of its way home, fly home; there, land."""
        home = np.array([self.home[0], self.home[1], self._goal.position[2]])
        if math.dist(home, self._goal.position) > _ARRIVED_M:
            self._go(home)
        else:
            self.enter(Px4Mode.LAND)

    def _land_on_target(self, now: NedState) -> NedCommand:
        """Over the target, down while it is seen; search for it above; else land here."""
        p, state = self._p, self._approach
        age_s = math.inf if self._target is None else now.time_s - self._target[0]
        if state.sinks or self._target is None or age_s > p["PLD_BTOUT"]:
            return self._search(now)
        target = self._target[1]
        state.since_s, clear_m = math.inf, float(target[2] - now.position[2])
        offset = target[:2] - now.position[:2]
        aside_m, speed = float(np.hypot(*offset)), float(np.hypot(*now.velocity[:2]))
        is_above = aside_m < p["PLD_HACC_RAD"] and speed < _HELD_M_S
        state.descends = state.descends or is_above  # until the target is lost
        self._go(np.array([*target[:2], self._goal.position[2]]), self._goal.yaw)
        if clear_m < p["PLD_FAPPR_ALT"] + _FEET_M and state.descends:
            state.sinks = True
        if state.descends and (age_s < _FRESH_S or clear_m < _LOW_M):
            self._goal = self._goal._replace(position=np.array([*target[:2], now.position[2]]))
            return self._sink(now, target)
        return self._follow(now, self._goal)

    def _search(self, now: NedState) -> NedCommand:
        """Climb and wait for the target; after the last search, land."""
        p, state = self._p, self._approach
        if state.sinks:
            return self._sink(now, self._goal.position)
        if state.since_s == math.inf:
            state.since_s, state.descends = now.time_s, False
            self._say("No landing target, searching")
            high = min(float(now.position[2]), float(self.home[2]) - p["PLD_SRCH_ALT"])
            self._go(np.array([now.position[0], now.position[1], high]), self._goal.yaw)
        if now.time_s - state.since_s > p["PLD_SRCH_TOUT"]:
            state.searches, state.since_s = state.searches + 1, math.inf
            if state.searches >= p["PLD_MAX_SRCH"]:
                self._say("Landing target not found; landing here")
                state.sinks = True
        return self._follow(now, self._goal)

    def _go(self, position: Floats, yaw: float = math.nan) -> None:
        self._goal = NedSetPoint(position, np.full(3, math.nan), yaw)

    def _hold(self) -> None:
        """Hold where it would come to rest."""
        assert self._now is not None
        self.mode = Px4Mode.HOLD
        self._go(self._now.position + 0.5 * self._now.velocity, self._now.yaw)

    def _sink(self, now: NedState, over: Floats) -> NedCommand:
        command = self._follow(now, NedSetPoint(over, np.full(3, math.nan), self._goal.yaw))
        command.velocity[2] = self._p["MPC_LAND_SPEED"]
        return command

    def _follow(self, now: NedState, wanted: NedSetPoint) -> NedCommand:
        """Velocities by the distances, plus those that are given; as PX4's position control."""
        p = self._p
        gains = np.array([p["MPC_XY_P"], p["MPC_XY_P"], p["MPC_Z_P"]])
        pull = np.nan_to_num(gains * (wanted.position - now.position))
        velocity = pull + np.nan_to_num(wanted.velocity)
        speed = float(np.hypot(*velocity[:2]))
        velocity[:2] *= min(1.0, p["MPC_XY_CRUISE"] / max(speed, 1e-9))
        up = p["MPC_TKO_SPEED" if self.mode is Px4Mode.TAKEOFF else "MPC_Z_V_AUTO_UP"]
        velocity[2] = np.clip(velocity[2], -up, p["MPC_Z_V_AUTO_DN"])
        turn = 0.0 if math.isnan(wanted.yaw_rate) else wanted.yaw_rate
        if not math.isnan(wanted.yaw):
            turn = _TURN * math.remainder(wanted.yaw - now.yaw, math.tau)
        return NedCommand(velocity, max(-_MOST_TURN, min(_MOST_TURN, turn)))

    @property
    def _has_set_points(self) -> bool:
        """True while set points for offboard control come."""
        if self._set_point is None or self._now is None:
            return False
        return self._now.time_s - self._set_point[0] <= self._p["COM_OF_LOSS_T"]

    def _fail_safe(self, now: NedState) -> None:
        """Leave offboard control without set points; act on a lost ground station."""
        if self.mode is Px4Mode.OFFBOARD and not self._has_set_points:
            action = {3: Px4Mode.RETURN, 4: Px4Mode.LAND}
            self._fall_back(action.get(int(self._p["COM_OBL_RC_ACT"]), Px4Mode.HOLD), "setpoints")
        is_lost = now.time_s - self._heard_s > self._p["COM_DL_LOSS_T"]
        after = {1: Px4Mode.HOLD, 2: Px4Mode.RETURN, 3: Px4Mode.LAND}.get(
            int(self._p["NAV_DLL_ACT"])
        )
        landings = (Px4Mode.RETURN, Px4Mode.LAND, Px4Mode.PRECISION_LAND, after)
        if after and is_lost and not self.landed and self.mode not in landings:
            self._fall_back(after, "ground station")

    def _fall_back(self, mode: Px4Mode, lost: str) -> None:
        self.enter(mode)
        text = f"Failsafe: {lost} lost; mode {mode.name.lower()}"
        log.warning("%s", text)
        self._say(text)

    def _watch_ground(self, now: NedState) -> None:
        """Notice take-off and landing; disarm on the ground after a while."""
        down, was_landed = float(now.position[2]), self.landed
        if self.landed:
            self.landed = down > self._ground - _LIFTED_M
        elif self.armed:
            is_still = float(np.linalg.norm(now.velocity)) < _STILL_M_S
            if not (is_still and self._wanted.velocity[2] > _STILL_M_S):
                self._moved_s = now.time_s
            self.landed = now.time_s - self._moved_s > _LANDED_S
        else:  # flown by other means
            self.landed = abs(down - self._ground) < _LIFTED_M
        if self.landed is not was_landed:
            self._ground, self._moved_s = down, now.time_s
        stands_s = now.time_s - max(self._moved_s, self._armed_s)
        is_new = self._armed_s > self._moved_s
        limit_s = self._p["COM_DISARM_PRFLT" if is_new else "COM_DISARM_LAND"]
        if self.armed and self.landed and stands_s > limit_s > 0:
            self.disarm()
