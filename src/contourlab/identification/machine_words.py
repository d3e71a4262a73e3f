"""What is said about an identified axis beside its numbers."""

from __future__ import annotations

from contourlab.identification.machine_result import AxisModel
from contourlab.identification.record import Record
from contourlab.identification.separability import reason

__all__ = ["NOTES", "sentences"]

NOTES = (
    "Mass, friction and stiffness are in units of the command: position and command alone do not "
    "tell mass from input gain. Divide by a known gain, or multiply, for units of effort.",
    "What one direction takes more than the other may be friction or a constant force (weight, "
    "cable): a motion does not tell which.",
    "Intervals are of Student's t over equal-weighted cosines of the scores, which stand residuals "
    "of any colour. An error of the model is not in them.",
)
"""What holds for every record."""
MISFIT = 3.0
"""Residual over the noise of the encoder from which the model leaves something out."""
COLOUR = 0.3
"""Correlation of the whitened residual from which it is worth a word."""
NEGLIGIBLE = 2e-3
BIAS_SHARE = 0.01


def sentences(axis: AxisModel, record: Record, confidence: float) -> list[str]:
    """Return what could not be found and why, and what speaks against the model.

    Parameters
    ----------
    axis
        As it was found.
    record
        From which.
    confidence
        Of the intervals.
    """
    if axis.method == "none":
        return [
            f"it never moved faster than {axis.minimum_speed:.3g} m/s for long enough: nothing was "
            "found"
        ]
    said = []
    if "mass" in axis.unexcited:
        said.append("mass was not found: the axis hardly accelerated")
    ways = [name for name in axis.unexcited if name.startswith("coulomb")]
    for name in ways:
        said.append(f"{name} was not found: it never moved {name.removeprefix('coulomb_')}")
    if axis.inseparable:
        *first, last = axis.inseparable
        which = f"{', '.join(first)} and {last}" if first else last
        said.append(f"{which} cannot be told apart: {reason(axis.inseparable)}")
    if axis.method == "least squares":
        if axis.astray:
            said.append(
                "the simulated response could not be fitted: forces or dynamics that the model "
                "does not know (cogging, backlash, elasticity); the values are of least squares"
            )
        elif "mass" not in axis.unexcited:
            said.append("no stretch one way was long enough to be simulated: least squares alone")
        return said
    if "delay" not in axis.free and not axis["delay"].known:
        said.append(
            "the motion does not tell the delay from mass or friction: it was taken for 0 s; "
            "give it as known if there is one"
        )
    mass = axis["mass"]
    if mass.identified and not mass.known and mass.low <= 0.0:
        said.append("0 is within the interval of the mass: the record says next to nothing of it")
    for name in ("viscous", "coulomb_forward", "coulomb_backward", "stiffness"):
        one = axis[name]
        if one.identified and one.high < 0.0:
            force = name.startswith("coulomb") and axis.coulomb > 0.0
            why = "a constant force is larger than friction" if force else "the model does not fit"
            said.append(f"{name} came out negative: {why}")
    if axis["delay"].identified and axis["delay"].high < 0.0:
        said.append(
            "the axis moves before the command that moves it: the time stamps of position and "
            "command do not belong together"
        )
    if axis.residual_rms > MISFIT * axis.encoder_noise:
        said.append(
            f"the simulated motion misses the measured one by {1e6 * axis.residual_rms:.3g} um "
            f"rms, with {1e6 * axis.encoder_noise:.2g} um of noise and counts: forces or dynamics "
            "that the model does not know"
        )
    if axis.correlation > COLOUR:
        said.append(
            f"the whitened residual is still correlated ({axis.correlation:.2f}): dynamics that "
            "the model does not know, such as elasticity or a lag of the drive"
        )
    return said
