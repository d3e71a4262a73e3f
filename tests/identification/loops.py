"""An independent closed loop for identification: NumPy, dry friction that truly sticks, many runs.

M q'' + B q' + A sign(q') - d = u + w, with w a coloured force. Between substeps friction takes away
what it can of the speed and no more, which is exact for a force that is constant over a substep.
"""

import numpy as np
import xarray as xr

from contourlab import Recording

T = 1e-3
MASS = np.array([5.0, 3.0])
VISCOUS = np.array([25.0, 18.0])
COULOMB = np.array([6.0, 4.0])
PUSH = np.array([2.0, 0.0])
TRUE = np.stack([MASS, VISCOUS, COULOMB, PUSH])


def motions(duration=8.0):
    """Two axes at one frequency each, over some ten reversals: position, velocity, acceleration."""
    t = np.arange(round(duration / T) + 1) * T
    size, rate, phase = np.array([0.08, 0.05]), np.array([6.0, 9.0]), np.array([0.3, 0.0])
    angle = t[:, None] * rate + phase
    return size * np.sin(angle), size * rate * np.cos(angle), -size * rate**2 * np.sin(angle)


def of_velocity(velocity):
    """Position, velocity and acceleration from velocities of shape (n, 2)."""
    position = np.concatenate([np.zeros((1, 2)), np.cumsum(velocity[:-1] + velocity[1:], 0)])
    return position * T / 2, velocity, np.gradient(velocity, T, axis=0)


def run(motion, *, n_runs=1, noise=1e-6, resolution=1e-6, force=0.0, time=0.01, seed=0):
    """Measured positions and commands of many runs, shape (n_runs, n_samples, 2)."""
    rng = np.random.default_rng(seed)
    position, velocity, acceleration = motion
    rate, parts = 2 * np.pi * 20.0, 4
    stiffness, damping, integral = MASS * rate**2, 2 * MASS * rate, 0.2 * MASS * rate**3
    h = T / parts
    decay = np.exp(-VISCOUS / MASS * h)
    lost = COULOMB / VISCOUS * (1 - decay)
    keep = np.exp(-T / time)
    q, v = np.tile(position[0], (n_runs, 1)), np.tile(velocity[0], (n_runs, 1))
    w = force * rng.standard_normal(q.shape)
    last, total = None, np.zeros_like(q)
    shift = resolution * rng.uniform(size=q.shape)  # of the counts against the axis
    measured, commands = [], []
    for k in range(len(position)):
        seen = q + noise * rng.standard_normal(q.shape)
        if resolution:
            seen = np.round((seen + shift) / resolution) * resolution - shift
        rate_seen = velocity[k] if last is None else (seen - last) / T
        last, error = seen, position[k] - seen
        total = total + integral * error * T
        u = MASS * acceleration[k] + VISCOUS * velocity[k] + COULOMB * np.sign(velocity[k])
        u = u + stiffness * error + damping * (velocity[k] - rate_seen) + total
        measured.append(seen)
        commands.append(u)
        w = keep * w + np.sqrt(1 - keep**2) * force * rng.standard_normal(q.shape)
        end = (u + w + PUSH) / VISCOUS
        for _ in range(parts):
            new = end + (v - end) * decay
            new = np.sign(new) * np.maximum(np.abs(new) - lost, 0.0)
            q, v = q + h * (v + new) / 2, new
    return np.stack(measured, 1), np.stack(commands, 1)


def recording(measured, command, reference=None, kind="force"):
    """A recording as a log would give it."""
    axes = ("time", "axis")
    data = {
        "measured": (axes, measured, {"units": "m"}),
        "command": (axes, command, {} if kind is None else {"kind": kind}),
    }
    if reference is not None:
        data["reference"] = (axes, reference, {"units": "m"})
    coordinates = {"time": T * np.arange(len(measured)), "axis": ["X", "Y"]}
    return Recording(xr.Dataset(data, coords=coordinates))
