"""Drives with a position loop, in NumPy: held velocity command, dry friction that truly sticks."""

import numpy as np

MASS, VISCOUS, DRY = np.array([200.0, 150.0]), np.array([600.0, 400.0]), np.array([60.0, 40.0])
GAIN = np.array([50.0, 40.0])
"""K_v [1/s]."""
RATE = 400.0
"""k_p / m of the velocity loops [1/s]."""


def program(sample_time, duration, seed=1):
    """Commanded positions of moves with rests between, of limited acceleration and jerk."""
    random = np.random.default_rng(seed)
    n = round(duration / sample_time) + 1
    wanted = np.zeros((n, 2))
    for axis in range(2):
        velocity, k = np.zeros(n), round(0.2 / sample_time)
        while k < n:
            length = round(random.uniform(0.2, 0.9) / sample_time)
            velocity[k : k + length] = random.uniform(0.03, 0.25) * random.choice([-1, 1])
            k += length + round(random.uniform(0.0, 0.4) / sample_time)
        for width in (0.08, 0.05):  # seconds of acceleration, and of jerk
            window = round(width / sample_time)
            velocity = np.convolve(velocity, np.ones(window) / window)[:n]
        wanted[:, axis] = np.cumsum(velocity) * sample_time
    return wanted


def cascade(wanted, sample_time, *, feed_forward, integral, later=0, parts=4, speed=RATE):
    """Positions of a P-PI cascade: ``integral`` is x, ``speed`` k_p / m [1/s]."""
    h = sample_time / parts
    asked = np.concatenate([np.repeat(wanted[:1], later, 0), wanted])[: len(wanted)]
    ahead = np.gradient(asked, sample_time, axis=0)
    q, v, total = wanted[0].copy(), np.zeros(2), np.zeros(2)
    positions = np.empty_like(wanted)
    for k in range(len(wanted)):
        positions[k] = q
        rate = GAIN * (asked[k] - q) + feed_forward * ahead[k]
        for _ in range(parts):
            total = total + integral * (rate - v) * h
            force = MASS * speed * (rate - v + total)
            new = v + (force - VISCOUS * v) / MASS * h
            new = np.sign(new) * np.maximum(np.abs(new) - DRY / MASS * h, 0.0)
            q, v = q + h * (v + new) / 2.0, new
    return positions
