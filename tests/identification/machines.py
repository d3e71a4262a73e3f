"""Machines, motions and logs for identification, made with the library's own loop."""

import jax
import jax.numpy as jnp
import numpy as np
import xarray as xr

import contourlab as cl
from contourlab import Recording
from contourlab.recordings import Reference


def varied_reference(size, sample_time, duration=6.0, rate=3.0, middle=None):
    """A Lissajous figure at a varied rate: reversals at many speeds."""
    t = np.arange(round(duration / sample_time) + 1) * sample_time
    curve = cl.contours.Lissajous(amplitudes=size, frequencies=(2, 3), phases=(0.3, 0.0))
    if middle is not None:
        curve = curve.translated(middle)
    ease = np.clip(t / 0.5, 0.0, 1.0)
    ease = ease**3 * (10.0 + ease * (6.0 * ease - 15.0))  # from rest
    speed = ease * rate * (1.0 + 0.35 * np.cos(2.3 * t))
    parameter = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * sample_time)])
    change = np.gradient(speed, sample_time)
    return Reference.along(
        curve, sample_time=sample_time, parameter=parameter, parameter_rate=speed,
        parameter_acceleration=change, parameter_jerk=np.gradient(change, sample_time),
    )  # fmt: skip


def with_sensor(machine, resolution, noise):
    return cl.replace(
        machine, sensor=cl.replace(machine.sensor, resolution=resolution, noise=noise)
    )


def open_loop(machine, command, sample_time, seed=0):
    """Measured positions of a machine that a recorded command drives, from rest."""
    bound = machine.bind(sample_time)
    still = jnp.zeros(machine.n_axes)

    def step(state, u):
        return bound.advance(state, u, still), bound.measure(state).position

    run = jax.jit(lambda state, u: jax.lax.scan(step, state, u)[1])
    return np.asarray(run(bound.init(still, seed), jnp.asarray(command)))


def log_of(measured, command, sample_time, kind, reference=None):
    rows = ("time", "axis")
    data = {"measured": (rows, measured), "command": (rows, command, {"kind": kind})}
    if reference is not None:
        data["reference"] = (rows, reference)
    names = ["X", "Y", "Z", "A"][: measured.shape[1]]
    time = sample_time * np.arange(len(measured))
    return Recording(xr.Dataset(data, coords={"time": time, "axis": names}))


def chirp(sample_time, duration, low, high, amplitude):
    """A sine whose frequency rises exponentially."""
    t = np.arange(round(duration / sample_time)) * sample_time
    k = np.log(high / low) / duration
    return amplitude * np.sin(2 * np.pi * low * np.expm1(k * t) / k)
