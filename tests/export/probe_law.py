"""A law written by hand in C, which shows what it was given: for what stands around a law."""

import numpy as np

from contourlab.controllers.base import Needs
from contourlab.export.fields import Field
from contourlab.export.generate import GeneratedC
from contourlab.export.law_facts import LawFacts

T = 1e-3
KP, KD = 4000.0, 40.0
START = 0.5
"""What init sets the number of steps to: not 0, so that leaving it out shows."""


def facts(n=2, command="force", *, preview=0, contour=False, own_time=False, limit=100.0):
    needs = Needs(
        command=command, derivatives=4, preview=preview, contour=contour, own_time=own_time
    )
    return LawFacts("Probe", n, needs, (limit,) * n, ("normal", "saturated"))


def probe(n=2, *, preview=0, prefix="probe", precision="double", order=4, without=()):
    """Return kp e + kd e', and 1e9 (not finite soon) where the status asks for it."""
    point = ("position", "velocity", "acceleration", "jerk")
    place = ("parameter", "parameter_rate", "parameter_acceleration")
    inputs = [
        Field("time", (), "s", "real", "time"),
        *(Field(f"reference_{k}", (), "", "real", f"reference.{k}") for k in place),
        *(Field(f"reference_{k}", (n,), "m", "real", f"reference.{k}") for k in point),
        Field("geometry", (order + 1, n), "", "real", "geometry"),
        *(Field(f"preview_{k}", (preview,), "", "real", f"preview.{k}") for k in place if preview),
        *(Field(f"preview_{k}", (preview, n), "", "real", f"preview.{k}")
          for k in point if preview),
        Field("position", (n,), "m", "real", "position"),
        Field("velocity", (n,), "m/s", "real", "velocity"),
    ]  # fmt: skip
    inputs = [field for field in inputs if field.path not in without]
    parameters = [Field("kp", (n,), "N/m", "real", "kp"), Field("kd", (n,), "N s/m", "real", "kd"),
                  Field("offset", (), "N", "real", "offset")]  # fmt: skip
    state = [Field("steps", (), "", "real", "steps")]
    outputs = [
        Field("command", (n,), "N", "real", "command"),
        Field("status", (), "", "int32", "status"),
        Field("finished", (), "", "int32", "finished"),
        Field("steps", (), "", "real", "steps"),
    ]
    groups = {"parameters": parameters, "state": state, "inputs": inputs, "outputs": outputs}
    real = "double" if precision == "double" else "float"
    header = [f"#ifndef {prefix.upper()}_H", f"#define {prefix.upper()}_H", "#include <stdint.h>",
              f"typedef {real} {prefix}_real;"]  # fmt: skip
    for name, fields in groups.items():
        header.append("typedef struct {")
        for field in fields:
            kind = f"{prefix}_real" if field.dtype == "real" else "int32_t"
            header.append(f"{kind} {field.name}{f'[{field.size}]' if field.shape else ''};")
        header.append(f"}} {prefix}_{name};")
    ends = {
        "default_parameters": "PARAMETERS *p",
        "init": "const PARAMETERS *p, const INPUTS *in, STATE *s",
        "step": "const PARAMETERS *p, const INPUTS *in, STATE *s, OUTPUTS *out",
    }
    bodies = {
        "default_parameters": f"int i; for (i = 0; i < {n}; i++) {{ p->kp[i] = {KP}; "
        f"p->kd[i] = {KD}; }} p->offset = 0;",
        "init": f"(void)p; (void)in; s->steps = {START};",
        "step": f"int i; for (i = 0; i < {n}; i++) out->command[i] = p->offset + p->kp[i] * "
        "(in->reference_position[i] - in->position[i]) + p->kd[i] * "
        "(in->reference_velocity[i] - in->velocity[i]); "
        "s->steps += 1; out->steps = s->steps; out->status = s->steps > 3; out->finished = 0;",
    }
    source = [f'#include "{prefix}.h"']
    for name, arguments in ends.items():
        for group in groups:
            arguments = arguments.replace(group.upper(), f"{prefix}_{group}")
        header.append(f"void {prefix}_{name}({arguments});")
        source.append(f"void {prefix}_{name}({arguments}) {{ {bodies[name]} }}")
    header.append("#endif")
    return GeneratedC(
        prefix=prefix, precision=precision, sample_time=T, header="\n".join(header) + "\n",
        source="\n".join(source) + "\n", operations=10, statuses=("normal", "saturated"),
        law="Probe", defaults={"kp": np.full(n, KP), "kd": np.full(n, KD), "offset": 0.0},
        **{name: tuple(fields) for name, fields in groups.items()},
    )  # fmt: skip
