# ruff: noqa: D103
"""Builds docs/estimators.md and its figure from a run: numbers in the page are never typed.

    python docs/build_estimators.py

Takes a minute or two, most of it compiling. Errors are the same on every machine to the digits
shown; the cost of a call is of the machine it ran on.
"""

from __future__ import annotations

import textwrap
from pathlib import Path

import contourlab as cl
from contourlab.reports.accuracy_figure import write_accuracy_figure

HERE = Path(__file__).parent
LAGS = (1e-4, 2e-4, 5e-4, 1e-3, 2e-3)
SHOWN = (1e-4, 5e-4, 1e-3, 2e-3)
PLACES = ("ellipse", "figure_eight", "parabola", "helix")


def words(name):
    return name.replace("figure_eight", "figure of eight").replace("_", " ")


def um(metres):
    if metres is None:
        return "refused"
    value = 1e6 * metres
    return "exact" if value < 1e-5 else f"{value:.2g}" if value < 100 else f"{value:.0f}"


def table(head, lines):
    rule = "|".join(["---", *["---:"] * (len(head) - 1)])
    return "\n".join(["| " + " | ".join(head) + " |", f"|{rule}|",
                      *("| " + " | ".join(line) + " |" for line in lines)])  # fmt: skip


def error_table(study, contour):
    found = {(r.estimator, r.lag): r for r in study.rows if r.contour == contour}
    lines = []
    for name in dict.fromkeys(r.estimator for r in study.rows):
        own = [found[name, lag] for lag in SHOWN]
        if own[0].note:
            continue
        cells = [
            um(r.error_max)
            if um(r.error_mean) == "exact" or r.error_max < 1.0001 * r.error_mean
            else f"{um(r.error_mean)} / {um(r.error_max)}"
            for r in own
        ]
        lines.append([f"`{name}`", *cells])
    return table(["estimator", *(f"lag {1e3 * lag:g} mm" for lag in SHOWN)], lines)


def main():
    study = cl.estimate_accuracy(PLACES, lag=LAGS)
    write_accuracy_figure(study, HERE / "images" / "estimators.png", force=True)
    at = {(r.contour, r.estimator, r.lag): r for r in study.rows}
    beside = ["osculating_circle", "natural_local", "extended_natural_local"]
    on = cl.estimate_accuracy("ellipse", beside, lag=LAGS, offset=0.0, cost=False)
    far = cl.estimate_accuracy(
        "ellipse", [*beside, "global_task_frame"], lag=1e-3, offset=[-1e-4, 1e-4], cost=False
    )
    coarse = cl.estimate_accuracy(
        "ellipse", ["tangent", "osculating_circle", "extended_natural_local", "newton"],
        lag=[1e-4, 1e-3], resolution=[0.0, 1e-7, 1e-6, 1e-5], cost=False,
    )  # fmt: skip
    fast = cl.estimate_accuracy(
        "ellipse", ["osculating_circle", "newton", "newton_projected", "newton_filtered"],
        lag=5e-4, feed=[1 / 60, 0.05, 0.2], cost=False,
    )  # fmt: skip
    bracket = cl.contours.read_gcode(HERE.parent / "examples" / "bracket" / "bracket.ngc")
    part = cl.estimate_accuracy(
        {"bracket": bracket.path},
        ["tangent", "osculating_circle", "extended_natural_local", "newton", "foot_point"],
        lag=5e-4, cost=False,
    )  # fmt: skip
    page = TEXT.format(
        part=table(
            ["estimator", "error"],
            [
                [f"`{r.estimator}`", "exact" if um(r.error_max) == "exact"
                 else f"{um(r.error_mean)} / {um(r.error_max)}"] for r in part.rows
            ],
        ),
        errors="\n\n".join(
            f"**{words(c.name)}** `{c.description}`, {1e3 * c.length:.4g} mm long, least "
            f"radius {1e3 / c.curvature_max:.3g} mm\n\n{error_table(study, c.name)}"
            for c in study.contours
        ),
        costs=cost_table(study),
        gain=gains(at),
        helix=ratio(at, "helix", "osculating_circle", "natural_local", "error_max"),
        local=span(
            at[c, "natural_local", lag].error_mean / at[c, "osculating_circle", lag].error_mean
            for c in PLACES[:3] for lag in SHOWN
        ),
        local_max=span(
            at[c, "natural_local", lag].error_max / at[c, "osculating_circle", lag].error_max
            for c in PLACES[:3] for lag in SHOWN
        ),
        direction=um(at["ellipse", "natural_local", 1e-4].vector_error_max),
        direction_circle=um(at["ellipse", "osculating_circle", 1e-4].vector_error_max),
        crossing=crossing(at),
        offsets=table(
            ["estimator", "on the contour", "10 µm inside", "0.1 mm outside", "0.1 mm inside"],
            [
                [
                    f"`{name}`",
                    *(
                        um(r.error_mean)
                        for s, offset in ((on, 0.0), (study, 1e-5), (far, -1e-4), (far, 1e-4))
                        for r in s.rows
                        if (r.contour, r.estimator, r.lag, r.offset)
                        == ("ellipse", name, 1e-3, offset)
                    ),
                ]
                for name in beside
            ],
        ),
        frame=" and ".join(
            f"{um(r.error_mean)} µm" for r in far.rows if r.estimator == "global_task_frame"
        ),
        frame_near=um(at["ellipse", "global_task_frame", 1e-3].error_mean),
        encoders=table(
            ["estimator, lag", "exact", "0.1 µm", "1 µm", "10 µm"],
            [
                [f"`{name}`, {1e3 * lag:g} mm", *(
                    um(r.error_mean) for r in coarse.rows if (r.estimator, r.lag) == (name, lag)
                )]
                for name in dict.fromkeys(r.estimator for r in coarse.rows) for lag in (1e-4, 1e-3)
            ],
        ),
        feeds=table(
            ["estimator", "1000 mm/min", "3000 mm/min", "12000 mm/min"],
            [
                [f"`{name}`", *(
                    f"{um(r.error_mean)} / {um(r.error_max)}" if um(r.error_mean) != "exact"
                    else "exact" for r in fast.rows if r.estimator == name
                )]
                for name in dict.fromkeys(r.estimator for r in fast.rows)
            ],
        ),
    )  # fmt: skip
    (HERE / "estimators.md").write_text(wrapped(page), encoding="utf-8")


def wrapped(page):
    """Return the page with its paragraphs filled; tables, code, lists and headings as they are."""
    parts = page.split("\n\n")
    return "\n\n".join(
        part if part.lstrip().startswith(("|", "`" * 3, "#", "*  ", "* ", "!", "    "))
        else textwrap.fill(part, 100, break_long_words=False, break_on_hyphens=False)
        for part in parts
    ).rstrip() + "\n"  # fmt: skip


def cost_table(study):
    names = list(dict.fromkeys(r.estimator for r in study.rows))
    lines = []
    for name in names:
        own = [[r.cost_ns for r in study.rows if r.estimator == name and r.contour == c]
               for c in ("ellipse", "helix")]  # fmt: skip
        lines.append([f"`{name}`", *(
            "refused" if None in costs else short(min(costs)) if max(costs) < 3 * min(costs)
            else f"{short(min(costs))} to {short(max(costs))}"
            for costs in own
        )])  # fmt: skip
    return table(["estimator", "ellipse [ns]", "helix [ns]"], lines)


def short(nanoseconds):
    return f"{float(f'{nanoseconds:.2g}'):g}"


def span(values):
    values = list(values)
    return f"{min(values):.2f} to {max(values):.2f}"


def ratio(at, contour, one, other, field):
    values = [getattr(at[contour, one, lag], field) / getattr(at[contour, other, lag], field)
              for lag in SHOWN]  # fmt: skip
    return f"{min(values):.2g} to {max(values):.2g}"


def gains(at):
    said = []
    for c in PLACES[:3]:
        circle, more = at[c, "osculating_circle", 1e-3], at[c, "extended_natural_local", 1e-3]
        said.append(f"{circle.error_mean / more.error_mean:.1f} (mean) and "
                     f"{circle.error_max / more.error_max:.1f} (largest) on the "
                     f"{words(c)}")  # fmt: skip
    return "; ".join(said)


def crossing(at):
    """Return the lag at which circle and projected Newton are equally good, by cubic growth."""
    said = []
    for c in PLACES:
        newton = at[c, "newton_projected", 1e-3].error_mean
        lower = [lag for lag in LAGS if at[c, "osculating_circle", lag].error_mean < newton]
        low = max(lower)
        share = newton / at[c, "osculating_circle", low].error_mean
        said.append(f"{1e3 * low * share ** (1 / 3):.2g} mm on the {words(c)}")
    return ", ".join(said)


TEXT = """# Which contour error estimate should I use?

This page is built from a run (`python docs/build_estimators.py`); the same study for your own part,
lags and encoders is one command:

```bash
contourlab estimate-accuracy --contours ellipse,figure-eight,helix --lag "0.5 mm,1 mm,2 mm" \\
    --offset "10 um" --output accuracy
contourlab estimate-accuracy --part bracket.ngc --axes XYZ --lag "0.1 mm,0.5 mm"
```

In short, by how far the tool lags behind its reference (feed over position gain; 3000 mm/min and a
gain of 50 /s are 1 mm):

* **Lag of a few per cent of the radius:** `osculating_circle`. Its error grows with the cube of the
  lag, it takes any number of axes, and both size and direction are right.
* **Up to a tenth or two:** `extended_natural_local` for the size. It needs the third derivative.
* **Large or unknown lag on a smooth contour, and room for a microsecond:** `newton`, the converged
  form: exact at every lag here, at a fixed count of iterations. At corners it may be off by up
  to the lag.
* **An implicit form at hand, small errors:** `global_task_frame`; the lag does not enter at all.
* **`tangent`** only where lag² over twice the radius is small against the error that matters.
* **`newton_filtered`** as a contour error: never at ordinary rates, see below.
* **`foot_point`** is the judge: exact, also at corners, but without a bound on its time.

## What is compared

The reference runs along the contour; the actual point is behind by the lag, as an arc length, and
10 µm beside it along the left normal (in space the principal normal, and the binormal too). 200
places, even over the length. The error is | |estimate| - |exact| |, with the exact contour error
from the local foot point; mean / largest in µm, one number where both are the same, "exact" below
10 pm. `estimate-accuracy` gives the error of the vector too (`vector_error_mean`), which is what
recordings call `estimate_error`. Estimators with a state run along at 3000 mm/min, sampled every
1 ms, and are judged after 0.1 s. The two laws in time have Newton's k' = c' = 500 /s.

![Errors of the estimators over the lag](images/estimators.png)

{errors}

## How far the papers' claims are borne out

**"The natural local approximation is more accurate than the circle."** Not in the plane: its mean
error is {local} times the circle's on the three planar contours above, the largest {local_max}
times. Both leave out κ' lag³ / 6. It is better where the curvature is constant and the torsion is
not zero: on the circular helix the circle's error is {helix} times as large. Its vector is
perpendicular to the tangent at the reference point, not at the foot: on the ellipse, 0.1 mm behind,
the vector is off by up to {direction} µm, the circle's by {direction_circle} µm.

**With the term in κ' kept** (`extended_natural_local`, not in the paper) the error at 1 mm of lag
is less than the circle's by a factor of {gain}. The factor is set by the contour and the offset: an
offset δ adds δ (κ lag)² / 2, which the term does not touch.

**"Static estimates are inadequate; Newton's is needed."** Only at large lags. On a moving foot the
law in time stays V / k' behind (0.1 mm at 3000 mm/min and k' = 500 /s). Taken as it is
(`newton_filtered`) that miss is the estimate: ten times the error of 10 µm. Projected on
the normal, the miss m costs κ m² / 2 whatever the lag, as a tangent estimate at a lag of m; the
osculating circle is better below a lag of {crossing} (means). Iterated within each sample
(`newton`) it is exact on these contours, and costs more.

The speed decides over the laws in time and over nothing else (ellipse, lag 0.5 mm, mean /
largest in µm):

{feeds}

**"The coordinate r_c of the global frame is the contour error."** To first order. It is off by a
term in the square of the error, that belongs to the implicit form and not to the curve: on the
ellipse {frame_near} µm at 10 µm, {frame} at 0.1 mm outside and inside, the same at every lag. The
local alternative for a contour without an implicit form is the signed distance
(`contours.SignedDistance`), which is the foot point.

## On a part with corners

The bracket of the examples (`examples/bracket/bracket.ngc`: lines, arcs and corners), lag 0.5 mm,
mean / largest in µm:

{part}

The circle is exact but for the places whose lag spans a joint. `newton` steps by derivatives that
are one-sided at a corner; where it stays behind at one, it begins anew at the reference point as
soon as that is nearer. `foot_point` is the only one here that is exact on parts by construction.

## What offset and encoders change

Mean error on the ellipse in µm, lag 1 mm:

{offsets}

Mean error on the ellipse in µm by the resolution of the encoders, offset 10 µm:

{encoders}

An encoder's step q leaves about a quarter of q on average, whatever the estimator: a better
estimate than that is lost. At 0.1 mm of lag the circle is good enough for any of these encoders.

## What a call costs

In a compiled loop on one core, with the reading of its sample; the contour's derivatives at the
reference point, which a loop has beforehand, are not counted. Best of five runs on the machine that
built this page, which was not idle: take ratios rather than numbers. A range is over the lags.

{costs}
"""

if __name__ == "__main__":
    main()
