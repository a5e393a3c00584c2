"""Scenario keys of a flight: goal, measurements, navigator, controller, errors, and when it ends."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from posse_core._plugins.options import Options
from posse_core._scenario.component import ComponentChoice
from posse_core._scenario.limits import MOST_FRAMES
from posse_core._scenario.orbit import RelativeConfig, Vector3

Matrix3 = tuple[Vector3, Vector3, Vector3]


class WaypointConfig(Options):
    """A relative state to reach, and to hold for a while."""

    t_s: float = Field(gt=0, description="when it is to be reached, seconds after the epoch")
    r_rtn_m: Vector3 = Field(description="position in the target's RTN axes, m")
    v_rtn_m_s: Vector3 = Field((0.0, 0.0, 0.0), description="velocity in the rotating axes, m/s")
    hold_s: float = Field(0.0, ge=0, description="how long the position is held, seconds")

    @model_validator(mode="after")
    def _held_at_rest(self) -> WaypointConfig:
        if self.hold_s > 0 and any(self.v_rtn_m_s):
            raise ValueError("a waypoint that is held has no velocity; leave v_rtn_m_s or hold_s out")
        return self


class OrbitGoalConfig(Options):
    """A natural relative orbit to follow, by waypoints on it."""

    relative: RelativeConfig = Field(description="the relative orbit, as in the key 'relative'")
    from_s: float = Field(gt=0, description="when it is to be reached, seconds after the epoch")
    every_s: float = Field(gt=0, description="time between waypoints on it, seconds")


class GoalConfig(Options):
    """What the controller is to achieve. Give exactly one key."""

    waypoints: tuple[WaypointConfig, ...] | None = Field(
        None, min_length=1, description="states to reach, in order of time"
    )
    orbit: OrbitGoalConfig | None = Field(None, description="a natural relative orbit to follow")

    @model_validator(mode="after")
    def _one_and_in_order(self) -> GoalConfig:
        if (self.waypoints is None) == (self.orbit is None):
            raise ValueError("give exactly one of waypoints, orbit")
        for before, after in zip(self.waypoints or (), (self.waypoints or ())[1:], strict=False):
            if after.t_s <= before.t_s + before.hold_s:
                raise ValueError(
                    f"the waypoint of t_s = {after.t_s:g} is to be reached before the one of"
                    f" t_s = {before.t_s:g} is left; give them in order of time"
                )
        return self


class MeasurementConfig(Options):
    """What the chaser reads from each frame."""

    use: Literal["keypoints", "pose", "line-of-sight"] = Field(
        "keypoints",
        description="what the navigator gets: keypoints with their standard deviations, the pose that"
        " follows from them, or the direction to the middle of the box",
    )
    source: Literal["nets", "truth"] = Field(
        "nets",
        description="nets: found in the image; truth: the true projections of the keypoints that are"
        " in view and not hidden, with noise of sigma_px, while the Sun shines on the target",
    )
    boxes: Path | None = Field(None, description="model file that finds boxes; null: the shipped one")
    keypoints: Path | None = Field(
        None, description="model file that finds keypoints; null: the shipped one"
    )
    least_score: float = Field(0.3, ge=0, le=1, description="detections below it are ignored")
    sigma_px: float = Field(
        1.0,
        gt=0,
        description="standard deviation of each coordinate of a keypoint, pixels; with nets it is added"
        " in quadrature to what they report",
    )
    largest_sigma: float = Field(
        0.02,
        gt=0,
        description="with a net that tells one place of each keypoint: a detection is ignored if the"
        " mean standard deviation is above this share of the box's larger side",
    )
    least_trust: float = Field(
        0.5,
        ge=0,
        le=1,
        description="with a net that tells several places of each keypoint: a detection is ignored if"
        " the probability that its pose is right within 5 % and 5 degrees is lower",
    )
    correction: ComponentChoice | None = Field(
        None,
        description="renderer that the chaser carries: each image is compared with one that it makes of"
        " what the chaser expects to see, and what the nets get wrong there is taken off what they"
        " found; null: no correction",
    )
    refiner: ComponentChoice | None = Field(
        None,
        description="with 'use: pose', refines the pose in each image, from those that the nets find and"
        " from the one that the chaser expects: a name, or {name, options}; null: poses are those of the"
        " keypoints",
    )
    range_sigma_m: float | None = Field(
        None, gt=0, description="standard deviation of a laser range finder, m; null: there is none"
    )
    delay_s: float | Literal["measured"] = Field(
        0.2,
        description="time from the frame to the arrival of its readings; 'measured': what the nets took"
        " on this machine, so that a flight cannot be repeated to the bit",
    )

    @model_validator(mode="after")
    def _consistent(self) -> MeasurementConfig:
        if self.delay_s != "measured" and self.delay_s < 0:
            raise ValueError("delay_s is negative; readings arrive after their frame")
        if self.correction is not None and (self.source == "truth" or self.use == "line-of-sight"):
            raise ValueError("correction is of the keypoints that nets find; leave it out, or say null")
        if self.refiner is not None and self.use != "pose":
            raise ValueError(f"refiner is for poses, and use is {self.use!r}; say use: pose, or null")
        if self.refiner is not None and self.correction is not None:
            raise ValueError("correction and refiner both improve the pose; say null to one of them")
        return self


class StartErrorsConfig(Options):
    """Standard deviations, per axis, of the true start about the one in 'relative'."""

    position_m: float = Field(1.0, gt=0, description="of the position, m")
    velocity_m_s: float = Field(0.005, gt=0, description="of the velocity, m/s")


class NavigationErrorsConfig(Options):
    """What the chaser does not know exactly; standard deviations."""

    start: StartErrorsConfig = Field(StartErrorsConfig(), description="of the start")
    impulse_size: float = Field(0.01, ge=0, description="of an impulse's size, relative")
    impulse_direction_deg: float = Field(
        0.5, ge=0, description="of an impulse's direction, about each of two axes, degrees"
    )
    least_impulse_m_s: float = Field(
        1e-4, ge=0, description="impulses below it are not carried out, m/s"
    )
    camera_attitude_deg: float = Field(
        0.01, ge=0, description="of the camera's attitude as the chaser knows it, per axis, degrees"
    )


class FlightErrorsConfig(NavigationErrorsConfig):
    """What the chaser does not know and does not carry out exactly; standard deviations."""

    pointing_deg: float = Field(
        0.05, ge=0, description="of the camera's attitude about the commanded one, per axis, degrees"
    )


class NavigationConfig(Options):
    """How the chaser navigates."""

    measurement: MeasurementConfig = Field(
        MeasurementConfig(), description="what the chaser reads from each frame"
    )
    navigator: ComponentChoice = Field(
        ComponentChoice(name="ekf"),
        description="estimates the relative motion: a name, or {name, options}",
    )
    inertia_kg_m2: Matrix3 | None = Field(
        None,
        description="the target's inertia in body axes as the chaser knows it, up to a factor; null:"
        " unknown, and the target is taken to turn at a constant rate in body axes",
    )
    errors: NavigationErrorsConfig = Field(
        NavigationErrorsConfig(), description="what is not known exactly"
    )

    @model_validator(mode="before")
    @classmethod
    def _names(cls, raw: Any) -> Any:
        """Give options without a name the default component's name."""
        if not isinstance(raw, dict):
            return raw
        named = dict(raw)
        for key, part in cls.model_fields.items():
            chosen = raw.get(key)
            if part.annotation is ComponentChoice and isinstance(chosen, dict) and "name" not in chosen:
                named[key] = {"name": part.default.name, **chosen}
        return named


class ConeConfig(Options):
    """An approach cone, which the chaser does not leave once it is nearer than its length."""

    axis_rtn: Vector3 = Field(description="from the target along the axis, RTN axes, of any length")
    half_angle_deg: float = Field(gt=0, lt=90, description="between axis and surface, degrees")
    length_m: float = Field(gt=0, description="how far the cone reaches from the target, m")

    @model_validator(mode="after")
    def _has_an_axis(self) -> ConeConfig:
        if not any(self.axis_rtn):
            raise ValueError("axis_rtn is zero; give a direction")
        return self


class SafetyConfig(Options):
    """Where the chaser may fly."""

    keep_out_m: Vector3 | None = Field(
        None, description="semi-axes along R, T, N of an ellipsoid that the chaser does not enter, m"
    )
    cone: ConeConfig | None = Field(None, description="an approach cone")
    passive_s: float = Field(
        0.0,
        ge=0,
        description="for how long after each impulse the chaser stays out of the ellipsoid if it makes"
        " no other, seconds",
    )

    @model_validator(mode="after")
    def _consistent(self) -> SafetyConfig:
        if self.keep_out_m is not None and min(self.keep_out_m) <= 0:
            raise ValueError("keep_out_m has a semi-axis that is not above 0")
        if self.passive_s > 0 and self.keep_out_m is None:
            raise ValueError("passive_s needs keep_out_m")
        return self


class EndConfig(Options):
    """What ends a flight before its duration is over."""

    below_m: float | None = Field(
        None, gt=0, description="a true distance below this, m; null: the target's radius"
    )
    without_readings_s: float | None = Field(
        None, gt=0, description="so long without readings, seconds; null: never"
    )


class FlightConfig(NavigationConfig):
    """A flight, in which the chaser sees and steers. Only ``duration_s`` has no default."""

    duration_s: float = Field(gt=0, description="duration, seconds")
    period_s: float = Field(10.0, gt=0, description="time from one frame to the next, seconds")
    burn_after_s: float = Field(
        1.0, ge=0, description="time from a frame to the impulse that may follow it, seconds"
    )
    goal: GoalConfig | None = Field(None, description="waypoints, or a relative orbit to follow")
    controller: ComponentChoice = Field(
        ComponentChoice(name="impulsive-mpc"),
        description="decides on the impulses: a name, or {name, options}",
    )
    largest_impulse_m_s: float | None = Field(
        None, gt=0, description="limit of the size of an impulse, m/s; null: none"
    )
    safety: SafetyConfig = Field(SafetyConfig(), description="where the chaser may fly")
    errors: FlightErrorsConfig = Field(
        FlightErrorsConfig(), description="what is not known and not carried out exactly"
    )
    end: EndConfig = Field(EndConfig(), description="what ends the flight early")

    @model_validator(mode="after")
    def _within(self) -> FlightConfig:
        if self.burn_after_s >= self.period_s:
            raise ValueError(
                "burn_after_s is not below period_s; an impulse comes before the next frame"
            )
        if self.duration_s < self.period_s:
            raise ValueError("duration_s is below period_s; a flight has at least two frames")
        if not self.duration_s / self.period_s < MOST_FRAMES:
            raise ValueError(
                f"a frame every {self.period_s:g} s in {self.duration_s:g} s makes more than"
                f" {MOST_FRAMES} frames; lower duration_s, or give a longer period_s"
            )
        last_s = 0.0
        if self.goal is not None and self.goal.waypoints is not None:
            last_s = max(point.t_s + point.hold_s for point in self.goal.waypoints)
        if self.goal is not None and self.goal.orbit is not None:
            last_s = self.goal.orbit.from_s
            if not (self.duration_s - last_s) / self.goal.orbit.every_s < MOST_FRAMES:
                raise ValueError(
                    f"goal.orbit: a waypoint every {self.goal.orbit.every_s:g} s makes more than"
                    f" {MOST_FRAMES}; give a longer every_s"
                )
        if last_s > self.duration_s:
            raise ValueError(f"the goal reaches to {last_s:g} s, beyond duration_s")
        return self
