"""Horizons, weights and polynomials that predictive laws refuse, and their sampled model."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import contourlab as cl
from contourlab.contours import Circle, Lissajous
from contourlab.controllers.held_model import held_polynomials
from contourlab.errors import ConfigurationError, RefusedError
from contourlab.machines.base import NominalModel

from .predictive_material import (
    PATHS,
    T,
    by_axis,
    law,
    model,
)


@pytest.mark.parametrize("stiffness", [None, 2000.0])
@pytest.mark.parametrize("viscous", [0.0, 279.0, 4e5])
def test_the_sampled_model_is_the_zero_order_hold(stiffness, viscous):
    from scipy.signal import cont2discrete

    told = NominalModel(
        mass=np.array([45.0]), viscous=np.array([viscous]), coulomb=np.zeros(1),
        gain=np.array([2.0]), command_limit=np.full(1, np.inf), command="force",
        stiffness=None if stiffness is None else np.array([stiffness]),
    )  # fmt: skip
    numerator, denominator = held_polynomials(told, T)
    b, a, _ = cont2discrete(([2.0], [45.0, viscous, stiffness or 0.0]), T)
    assert_allclose(denominator[0], a, rtol=1e-9, atol=1e-12)
    assert_allclose(numerator[0], b[0, 1:], rtol=1e-7, atol=1e-7 * np.max(b))


# -- refusals ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"prediction_horizon": 0}, "prediction_horizon must be a whole number >= 1, got 0"),
        ({"control_horizon": True}, "control_horizon must be a whole number >= 1, got True"),
        ({"delay": -1}, "delay must be a whole number >= 0, got -1"),
        ({"disturbance_integrators": -1}, "disturbance_integrators must be a whole number >= 0"),
        ({"control_horizon": 10}, "control_horizon must be <= prediction_horizon - delay = 9"),
        ({"delay": 7}, "control_horizon must be <= prediction_horizon - delay = 2, got 3"),
        ({"delay": 9}, "delay must be < prediction_horizon = 9, got 9"),
        ({"minimum_horizon": 10}, "minimum_horizon must be <= prediction_horizon = 9, got 10"),
        ({"contour_weight": 0.0}, "contour_weight must be > 0, got 0"),
        ({"lag_weight": -1.0}, "lag_weight must be > 0, got -1"),
        ({"normal_input_weight": -1.0}, "normal_input_weight must be >= 0"),
        ({"tangential_input_weight": np.nan}, "tangential_input_weight must be finite"),
        ({"normal_input_weight": 0.0, "minimum_horizon": 8}, "control_horizon must be <= 2"),
        (
            {
                "normal_input_weight": 0.0,
                "control_horizon": 8,
                "delay": 1,
                "plant_numerator": (0.0, 1e-7),
                "plant_denominator": (1.0, -1.0),
            },
            "control_horizon must be <= 7, the number of outputs that count",
        ),
        ({"disturbance_plant": False}, "form 'realigned' needs disturbance_plant=True"),
        ({"noise_polynomial": (1.0, -1.0)}, "noise_polynomial must have its roots inside"),
        ({"noise_polynomial": 1.0}, "noise_polynomial must list coefficients"),
        ({"input_filter_denominator": (1.0, -1.1)}, "input_filter_denominator must have its roots"),
        ({"holding_polynomial": (0.0, 1.0)}, "holding_polynomial must not begin with 0"),
        ({"plant_numerator": (1.0,)}, "plant_numerator and plant_denominator must be given tog"),
        (
            {"plant_numerator": (1.0, -1.0), "plant_denominator": (1.0, -1.0)},
            "plant_numerator must not add up to 0",
        ),
        ({"angle": "both"}, "angle must be one of the allowed values"),
    ],
)
def test_what_cannot_be_is_said(changes, message):
    with pytest.raises(ConfigurationError, match=message.replace("(", r"\(")):
        law(**changes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"input_weight": -1e-9}, "input_weight must be >= 0 .*, got -1e-09"),
        ({"input_weight": (1e-9, np.inf)}, "input_weight must be finite, got inf"),
        ({"input_weight": (1e-9, 0.0), "minimum_horizon": 8}, "control_horizon must be <= 2"),
        ({"control_horizon": 10}, "control_horizon must be <= prediction_horizon - delay = 9"),
        ({"disturbance_plant": False}, "form 'realigned' needs disturbance_plant=True"),
    ],
)
def test_what_cannot_be_is_said_of_the_axis_law(changes, message):
    with pytest.raises(ConfigurationError, match=message):
        by_axis(**changes)
    with pytest.raises(ConfigurationError, match="input_weight must be one number or one for each"):
        by_axis(input_weight=np.full(3, 1e-9)).bind(PATHS[2], T)


def test_what_cannot_be_bound_is_said():
    contour = Circle(radius=0.02)
    with pytest.raises(RefusedError, match="needs one axis for each coordinate"):
        law(3).bind(contour, T)
    with pytest.raises(RefusedError, match=r"4 axes, the contour 2.*InternalModelContouring"):
        law(4).bind(contour, T)
    law(4).bind(Lissajous(amplitudes=[0.01] * 4, frequencies=[1.0, 2.0, 3.0, 4.0]), T)
    with pytest.raises(ConfigurationError, match="one for each of the 2 axes, got shape"):
        law(noise_polynomial=np.ones((3, 1))).bind(contour, T)
    with pytest.raises(ConfigurationError, match="sample_time must be > 0 s"):
        law().bind(contour, 0.0)
    told = cl.replace(model(), command="position")
    with pytest.raises(RefusedError, match="needs that loop as plant_numerator"):
        law(told=told)
    fields = {"plant_numerator": (0.3, 0.1), "plant_denominator": (1.0, -0.6)}
    assert law(told=told, **fields).needs.command == "position"
    with pytest.raises(ConfigurationError, match="model must be a NominalModel"):
        law(told=3.0)
