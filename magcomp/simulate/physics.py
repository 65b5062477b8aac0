"""What happens to the vehicle: motors, battery, the field in its body, its sensors.

One :func:`advance` makes one :class:`Block` of ten steps of 10 ms, as long as
the autopilot takes between two compass readings. Nothing here knows MAVLink.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from magcomp.simulate.flight import GRAVITY
from magcomp.simulate.motion import BoolArray, Motion
from magcomp.simulate.truth import MOTORS, Truth

FloatArray = NDArray[np.float64]

STEP_S = 0.01
STEPS = 10
BLOCK_S = STEP_S * STEPS

_MOTOR_LAG_S = 0.06
_CURRENT_LAG_S = 0.05
_FIELD_DELAY_STEPS = 2
_CURRENT_NOISE_A = 0.1
_VOLTAGE_NOISE_V = 0.01
_GYRO_NOISE = 0.003
_ACCEL_NOISE = 0.03


@dataclass(frozen=True, eq=False)
class State:
    """What one block leaves to the next.

    Attributes
    ----------
    thrust
        Thrust of each motor, 0 … 1, shape (4,).
    sensed_a
        The current sensor's output, A.
    voltage
        At the battery's terminals, V.
    used_ah
        Charge drawn so far.
    pose
        Last attitude, (3, 3); None before the first block.
    late_field
        Body fields that are still in the compasses' own filters, shape (2, 3).
    gyro_bias, accel_bias
        rad/s and m/s², shape (2, 3): one row an IMU.
    """

    voltage: float
    thrust: FloatArray = field(default_factory=lambda: np.zeros(MOTORS))
    sensed_a: float = 0.0
    used_ah: float = 0.0
    pose: FloatArray | None = None
    late_field: FloatArray | None = None
    gyro_bias: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))
    accel_bias: FloatArray = field(default_factory=lambda: np.zeros((2, 3)))


@dataclass(frozen=True, eq=False)
class Block:
    """A tenth of a second of the truth and of what the sensors make of it.

    Attributes
    ----------
    motion
        The true movement at the ten steps.
    rates, force
        True body rates, rad/s, and specific force, m/s², shape (10, 3).
    gyro, accel
        What the two IMUs measure, shape (2, 10, 3).
    demand
        Thrust the autopilot demands of each motor, 0 … 1, shape (10, 4).
    current
        True battery current, A, shape (10,).
    field
        True field in body axes with the interference, mGauss, shape (10, 3).
    raw
        The block's compass readings: sensor fields, mGauss, shape (3, 3), one row a compass.
    sensed_a, sensed_v, used_ah
        What the battery monitor says at the block's end.
    """

    motion: Motion
    rates: FloatArray
    force: FloatArray
    gyro: FloatArray
    accel: FloatArray
    demand: FloatArray
    current: FloatArray
    field: FloatArray
    raw: FloatArray
    sensed_a: float
    sensed_v: float
    used_ah: float


def initial_state(truth: Truth, rng: np.random.Generator) -> State:
    """The vehicle as it is switched on."""
    return State(
        voltage=truth.power.full_v,
        gyro_bias=rng.normal(scale=0.002, size=(2, 3)),
        accel_bias=rng.normal(scale=0.02, size=(2, 3)),
    )


def advance(
    state: State,
    motion: Motion,
    powered: bool,
    truth: Truth,
    earth: FloatArray,
    rng: np.random.Generator,
    tested: FloatArray | None = None,
) -> tuple[State, Block]:
    """Let one block of time pass.

    Parameters
    ----------
    state
        After the block before.
    motion
        Where the programme moves the vehicle at the block's ten steps.
    powered
        Whether the motors are armed.
    truth
        The vehicle.
    earth
        Field in north-east-down axes, mGauss, shape (3,).
    rng
        Source of all sensor noise.
    tested
        Thrust of each motor, 0 … 1, shape (4,), while a motor test drives them.
    """
    if tested is None:
        demand = _demand(motion, powered)
        running = (motion.armed & powered)[:, None]
    else:
        demand = np.tile(tested, (len(motion.throttle), 1))
        running = demand > 0.0
    thrust = np.clip(_lag(state.thrust, demand, _MOTOR_LAG_S), 0.0, 1.0)
    motors = _motor_currents(thrust, running, state.voltage, truth)
    current = truth.power.board_a + motors.sum(axis=-1)
    power = truth.power
    used = state.used_ah + float(current.sum()) * STEP_S / 3600.0
    voltage = _open_circuit(truth, used) - power.resistance_ohm * float(current[-1])
    sensed = _lag(np.array([state.sensed_a]), current[:, None], _CURRENT_LAG_S)[-1, 0]

    body_from_earth = np.swapaxes(motion.earth_from_body, -1, -2)
    interference = power.board_a * truth.interference + motors @ truth.motors
    field_body = body_from_earth @ earth + interference
    late = field_body[:1].repeat(_FIELD_DELAY_STEPS, 0)
    late = late if state.late_field is None else state.late_field
    seen = np.concatenate([late, field_body])
    mean = seen[:STEPS].mean(axis=0)
    raw = np.stack([c.raw(mean + rng.normal(scale=truth.noise, size=3)) for c in truth.compasses])

    rates = _body_rates(state.pose, motion.earth_from_body)
    gravity = np.array([0.0, 0.0, GRAVITY])
    force = (body_from_earth @ (motion.acceleration - gravity)[..., None])[..., 0]
    shape = (2, STEPS, 3)
    gyro = rates + state.gyro_bias[:, None] + rng.normal(scale=_GYRO_NOISE, size=shape)
    accel = force + state.accel_bias[:, None] + rng.normal(scale=_ACCEL_NOISE, size=shape)
    block = Block(
        motion=motion,
        rates=rates,
        force=force,
        gyro=gyro,
        accel=accel,
        demand=demand,
        current=current,
        field=field_body,
        raw=raw,
        sensed_a=max(0.0, float(sensed + rng.normal(scale=_CURRENT_NOISE_A))),
        sensed_v=float(voltage + rng.normal(scale=_VOLTAGE_NOISE_V)),
        used_ah=used,
    )
    following = State(
        voltage=voltage,
        thrust=thrust[-1],
        sensed_a=float(sensed),
        used_ah=used,
        pose=motion.earth_from_body[-1],
        late_field=seen[STEPS:],
        gyro_bias=state.gyro_bias,
        accel_bias=state.accel_bias,
    )
    return following, block


def _demand(motion: Motion, powered: bool) -> FloatArray:
    throttle = motion.throttle[:, None]
    wanted = np.clip(throttle + np.where(throttle > 0.0, motion.mix, 0.0), 0.0, 1.0)
    return np.asarray(np.where((motion.armed & powered)[:, None], wanted, 0.0))


def _motor_currents(
    thrust: FloatArray, running: BoolArray, voltage: float, truth: Truth
) -> FloatArray:
    """Each motor's current, A, shape (n, 4), of those running, shape (n, 1) or (n, 4)."""
    power = truth.power
    # The same thrust takes the same power: what the battery lacks in volts it gives in amperes.
    full = power.full_a * power.full_v / voltage
    return np.asarray((full * thrust**power.exponent + power.idle_a * running) / MOTORS)


def _open_circuit(truth: Truth, used_ah: float) -> float:
    power = truth.power
    left = max(0.0, 1.0 - used_ah / power.capacity_ah)
    return power.empty_v + (power.full_v - power.empty_v) * left


def _lag(before: FloatArray, wanted: FloatArray, time_constant: float) -> FloatArray:
    """First-order lag of ``wanted``, shape (n, k), that stood at ``before``, shape (k,)."""
    weights, memory = _lag_weights(len(wanted), time_constant)
    return np.asarray(weights @ wanted + memory * before)


@lru_cache
def _lag_weights(count: int, time_constant: float) -> tuple[FloatArray, FloatArray]:
    """How much each earlier input, shape (n, n), and the old state, (n, 1), still count."""
    keep = np.exp(-STEP_S / time_constant)
    steps = np.arange(count)
    age = steps[:, None] - steps
    weights = np.where(age >= 0, (1 - keep) * keep ** np.maximum(age, 0), 0.0)
    return weights, keep ** (steps[:, None] + 1.0)


def _body_rates(before: FloatArray | None, pose: FloatArray) -> FloatArray:
    """Body rates, rad/s, shape (n, 3), from successive attitudes, shape (n, 3, 3)."""
    earlier = np.concatenate([pose[:1] if before is None else before[None], pose[:-1]])
    turned = np.swapaxes(earlier, -1, -2) @ pose
    twist = np.stack(
        [
            turned[:, 2, 1] - turned[:, 1, 2],
            turned[:, 0, 2] - turned[:, 2, 0],
            turned[:, 1, 0] - turned[:, 0, 1],
        ],
        axis=-1,
    )
    return twist / (2 * STEP_S)
