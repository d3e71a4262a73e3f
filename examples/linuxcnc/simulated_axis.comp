component simulated_axis "Axis with mass, viscous and dry friction, and an encoder, for trying a controller without a machine";

description
"""
Integrates M v' = K u - B v - F(v), with F(v) = (Fc + (Fs - Fc) exp(-(v/vs)^2)) tanh(v/v0), over each
servo period, the command u being held. Each substep replaces F by its secant k v, with k at the middle
of the substep as backward Euler predicts it, and solves the linear equation that is left. All
parameters in SI, the pins in machine units.
""";

pin in float command "force or voltage";
pin in bit enable "FALSE: no current, the axis runs out";
pin out float position_fb "as the encoder shows it [machine unit]";
pin out float position "true [machine unit]";
pin out float velocity "true [machine unit/s]";

param rw float mass = 1.0 "M [effort per m/s^2]";
param rw float viscous = 0.0 "B [effort per m/s]";
param rw float gain = 1.0 "K [effort per unit of command]";
param rw float coulomb = 0.0 "Fc [effort]";
param rw float breakaway = 0.0 "Fs [effort]";
param rw float stribeck_velocity = 0.01 "vs [m/s]";
param rw float smoothing_velocity = 0.0001 "v0 [m/s]";
param rw float resolution = 0.0000001 "of the encoder [m]; 0: none";
param rw float scale = 0.001 "m per machine unit";
param rw u32 substeps = 10;

variable double metres;
variable double speed;

function move fp "Once in every servo period, before motion-controller: the motion since the last one";

license "GPL";
author "contourlab";
;;

#include <rtapi_math.h>

static double secant(double at, double low, double high, double vs, double v0)
{
    double level = low + (high - low) * exp(-(at / vs) * (at / vs));
    return fabs(at) < 1e-6 * v0 ? level / v0 : level * tanh(at / v0) / at;
}

FUNCTION(move)
{
    rtapi_u32 count = substeps > 0 ? substeps : 1;
    double h = fperiod / count;
    double effort = enable ? gain * command : 0.0;
    rtapi_u32 i;

    for (i = 0; i < count; i++) {
        double k = secant(speed, coulomb, breakaway, stribeck_velocity, smoothing_velocity);
        double middle = (speed + 0.5 * h * effort / mass) / (1.0 + 0.5 * h * (viscous + k) / mass);
        double rate, share, next;
        k = secant(middle, coulomb, breakaway, stribeck_velocity, smoothing_velocity);
        rate = (viscous + k) / mass;
        share = rate * h > 1e-6 ? -expm1(-rate * h) / rate : h; /* (1 - exp(-rate h)) / rate */
        next = speed + (effort / mass - rate * speed) * share;
        metres += rate * h > 1e-6 ? (effort / mass * h - (next - speed)) / rate
                                  : 0.5 * h * (speed + next);
        speed = next;
    }
    position = metres / scale;
    velocity = speed / scale;
    position_fb = resolution > 0.0 ? floor(metres / resolution + 0.5) * resolution / scale
                                   : metres / scale;
}
