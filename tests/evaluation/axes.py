"""An axis under a servo loop, written apart from the library: mass, friction that sticks, play.

Dry friction is exact: a speed that it would turn round within a step is zero. What a cause does is
the position with it minus that without.
"""

import math
from typing import NamedTuple

import numpy as np


class Loop(NamedTuple):
    """What moves a rigid axis."""

    mass: float = 40.0
    viscous: float = 100.0
    position_gain: float = 30.0
    velocity_gain: float = 8000.0
    integral_gain: float = 4e5
    feed_forward: float = 0.0
    delay: int = 0


class Dry(NamedTuple):
    """Dry friction: of Coulomb, higher at rest, or with presliding as of Dahl."""

    force: float = 0.0
    rest: float = 0.0
    speed: float = 5e-3
    distance: float = 0.0


FREE = Dry()


def followed(commanded, dt, loop, dry=FREE, substeps=12):
    """Return the position of the motor."""
    m, b, k_v, k_p, k_i, ff, delay = loop
    rate = np.gradient(commanded, dt)
    h = dt / substeps
    x, v, whole, force = commanded[0], 0.0, 0.0, 0.0
    waiting = [0.0] * delay
    out = []
    for r, r_dot in zip(commanded.tolist(), rate.tolist(), strict=True):
        out.append(x)
        wanted = k_v * (r - x) + ff * r_dot - v
        whole += k_i * wanted * dt
        waiting.append(k_p * wanted + whole)
        drive = waiting.pop(0)
        for _ in range(substeps):
            if dry.distance:
                v = (v + h / m * (drive - force)) / (1.0 + h * b / m)
                end = math.copysign(dry.force, v)
                force = end + (force - end) * math.exp(-abs(v) * h / dry.distance)
            else:
                level = dry.force
                if dry.rest:
                    level += (dry.rest - dry.force) * math.exp(-((v / dry.speed) ** 2))
                v = (v + h / m * drive) / (1.0 + h * b / m)
                v = math.copysign(max(abs(v) - h / m * level, 0.0), v)
            x += h * v
    return np.array(out)


def behind_play(motor, width):
    """Return what is behind a play that begins in its middle."""
    at, out = motor[0], []
    for x in motor.tolist():
        at = min(max(at, x - 0.5 * width), x + 0.5 * width)
        out.append(at)
    return np.array(out)


def there_and_back(dt, turns=2.0, seconds=2.4, size=0.02):
    """Return a motion from rest to rest whose speed rises and falls, and the same backwards."""
    share = np.arange(0.0, seconds, dt) / seconds
    angle = turns * 2.0 * np.pi * share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    way = size * (np.sin(angle + 0.3) + 0.3 * np.sin(2.0 * angle))
    rest = round(0.1 / dt)
    way = np.concatenate([np.full(rest, way[0]), way, np.full(rest, way[-1])])
    return np.concatenate([way, way[::-1]])
