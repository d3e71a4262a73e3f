"""Functions of the FMI standards that a sampled controller does not have, by their arguments.

A functional mock-up unit exports them all the same; each says that it is not supported. Names and
arguments are the standards' (FMI 2.0.4 and 3.0.1, https://fmi-standard.org).
"""

from __future__ import annotations

__all__ = ["MISSING_IN_FMI2", "MISSING_IN_FMI3"]

_REFERENCES_2 = ("const fmi2ValueReference references[]", "size_t count")
_REFERENCES_3 = ("const fmi3ValueReference references[]", "size_t count")

MISSING_IN_FMI2: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("fmi2GetBoolean", (*_REFERENCES_2, "fmi2Boolean values[]")),
    ("fmi2GetString", (*_REFERENCES_2, "fmi2String values[]")),
    ("fmi2SetBoolean", (*_REFERENCES_2, "const fmi2Boolean values[]")),
    ("fmi2SetString", (*_REFERENCES_2, "const fmi2String values[]")),
    (
        "fmi2GetDirectionalDerivative",
        (
            "const fmi2ValueReference unknowns[]",
            "size_t n_unknowns",
            "const fmi2ValueReference knowns[]",
            "size_t n_knowns",
            "const fmi2Real seed[]",
            "fmi2Real sensitivity[]",
        ),
    ),
    (
        "fmi2SetRealInputDerivatives",
        (*_REFERENCES_2, "const fmi2Integer orders[]", "const fmi2Real values[]"),
    ),
    (
        "fmi2GetRealOutputDerivatives",
        (*_REFERENCES_2, "const fmi2Integer orders[]", "fmi2Real values[]"),
    ),
    ("fmi2GetStatus", ("const fmi2StatusKind kind", "fmi2Status *value")),
    ("fmi2GetRealStatus", ("const fmi2StatusKind kind", "fmi2Real *value")),
    ("fmi2GetIntegerStatus", ("const fmi2StatusKind kind", "fmi2Integer *value")),
    ("fmi2GetBooleanStatus", ("const fmi2StatusKind kind", "fmi2Boolean *value")),
    ("fmi2GetStringStatus", ("const fmi2StatusKind kind", "fmi2String *value")),
)

_TYPES = ("Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "Int64", "UInt64", "Boolean",
          "String")  # fmt: skip

MISSING_IN_FMI3: tuple[tuple[str, tuple[str, ...]], ...] = (
    *(
        (f"fmi3Get{name}", (*_REFERENCES_3, f"fmi3{name} values[]", "size_t n_values"))
        for name in _TYPES
    ),
    *(
        (f"fmi3Set{name}", (*_REFERENCES_3, f"const fmi3{name} values[]", "size_t n_values"))
        for name in _TYPES
    ),
    (
        "fmi3GetBinary",
        (*_REFERENCES_3, "size_t sizes[]", "fmi3Binary values[]", "size_t n_values"),
    ),
    (
        "fmi3SetBinary",
        (*_REFERENCES_3, "const size_t sizes[]", "const fmi3Binary values[]", "size_t n_values"),
    ),
    ("fmi3GetClock", (*_REFERENCES_3, "fmi3Clock values[]")),
    ("fmi3SetClock", (*_REFERENCES_3, "const fmi3Clock values[]")),
    (
        "fmi3GetNumberOfVariableDependencies",
        ("fmi3ValueReference reference", "size_t *n_dependencies"),
    ),
    (
        "fmi3GetVariableDependencies",
        (
            "fmi3ValueReference dependent",
            "size_t dependent_elements[]",
            "fmi3ValueReference independents[]",
            "size_t independent_elements[]",
            "fmi3DependencyKind kinds[]",
            "size_t n_dependencies",
        ),
    ),
    *(
        (
            f"fmi3Get{name}Derivative",
            (
                "const fmi3ValueReference unknowns[]",
                "size_t n_unknowns",
                "const fmi3ValueReference knowns[]",
                "size_t n_knowns",
                "const fmi3Float64 seed[]",
                "size_t n_seed",
                "fmi3Float64 sensitivity[]",
                "size_t n_sensitivity",
            ),
        )
        for name in ("Directional", "Adjoint")
    ),
    ("fmi3EnterConfigurationMode", ()),
    ("fmi3ExitConfigurationMode", ()),
    ("fmi3EnterEventMode", ()),
    ("fmi3EnterStepMode", ()),
    (
        "fmi3GetIntervalDecimal",
        (*_REFERENCES_3, "fmi3Float64 intervals[]", "fmi3IntervalQualifier qualifiers[]"),
    ),
    (
        "fmi3GetIntervalFraction",
        (
            *_REFERENCES_3,
            "fmi3UInt64 counters[]",
            "fmi3UInt64 resolutions[]",
            "fmi3IntervalQualifier qualifiers[]",
        ),
    ),
    ("fmi3GetShiftDecimal", (*_REFERENCES_3, "fmi3Float64 shifts[]")),
    (
        "fmi3GetShiftFraction",
        (*_REFERENCES_3, "fmi3UInt64 counters[]", "fmi3UInt64 resolutions[]"),
    ),
    ("fmi3SetIntervalDecimal", (*_REFERENCES_3, "const fmi3Float64 intervals[]")),
    (
        "fmi3SetIntervalFraction",
        (*_REFERENCES_3, "const fmi3UInt64 counters[]", "const fmi3UInt64 resolutions[]"),
    ),
    ("fmi3SetShiftDecimal", (*_REFERENCES_3, "const fmi3Float64 shifts[]")),
    (
        "fmi3SetShiftFraction",
        (*_REFERENCES_3, "const fmi3UInt64 counters[]", "const fmi3UInt64 resolutions[]"),
    ),
    ("fmi3EvaluateDiscreteStates", ()),
    (
        "fmi3UpdateDiscreteStates",
        (
            "fmi3Boolean *need_update",
            "fmi3Boolean *terminate",
            "fmi3Boolean *nominals_changed",
            "fmi3Boolean *values_changed",
            "fmi3Boolean *next_event_defined",
            "fmi3Float64 *next_event_time",
        ),
    ),
    ("fmi3EnterContinuousTimeMode", ()),
    (
        "fmi3CompletedIntegratorStep",
        ("fmi3Boolean no_set_state_prior", "fmi3Boolean *event", "fmi3Boolean *terminate"),
    ),
    ("fmi3SetTime", ("fmi3Float64 time",)),
    ("fmi3SetContinuousStates", ("const fmi3Float64 states[]", "size_t n_states")),
    ("fmi3GetContinuousStateDerivatives", ("fmi3Float64 derivatives[]", "size_t n_states")),
    ("fmi3GetEventIndicators", ("fmi3Float64 indicators[]", "size_t n_indicators")),
    ("fmi3GetContinuousStates", ("fmi3Float64 states[]", "size_t n_states")),
    ("fmi3GetNominalsOfContinuousStates", ("fmi3Float64 nominals[]", "size_t n_states")),
    ("fmi3GetNumberOfEventIndicators", ("size_t *n_indicators",)),
    ("fmi3GetNumberOfContinuousStates", ("size_t *n_states",)),
    (
        "fmi3GetOutputDerivatives",
        (*_REFERENCES_3, "const fmi3Int32 orders[]", "fmi3Float64 values[]", "size_t n_values"),
    ),
    ("fmi3ActivateModelPartition", ("fmi3ValueReference clock", "fmi3Float64 time")),
)
