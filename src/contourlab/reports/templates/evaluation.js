// The page of an evaluated log.

for (const key of ["time", "error", "half"]) data[key] = numbers(data[key]);
data.foot = data.foot.map(numbers);
data.vector = data.vector.map(numbers);
for (const cause of data.causes) cause.signal = numbers(cause.signal);
for (const curve of data.tracking) curve.values = numbers(curve.values);
let factor = data.magnification;
const timeTitle = data.timed ? "time [s]" : "sample";
const input = document.getElementById("factor");
input.value = factor;

function colour(look) {
  return darkness.matches ? look.dark : look.light;
}

function trace(name, x, y, look, more = {}) {
  return {
    type: "scatter", mode: "lines", name: plain(name), x, y, connectgaps: false,
    line: { color: colour(look), width: 1.4, dash: look.dash }, ...more,
  };
}

function pathPicture() {
  const look = theme();
  const moved = data.foot.map((column, k) => Float64Array.from(column, (v, i) => v - factor * data.vector[k][i]));
  const marks = data.worst.map((w) => [0, 1].map((k) => w.foot[k] - factor * w.vector[k]));
  const [a, b] = data.coordinates.map(plain);
  return {
    traces: [
      { type: "scatter", mode: "lines", x: data.foot[0], y: data.foot[1], hoverinfo: "skip",
        line: { color: look.path, width: 3 } },
      trace("actual", moved[0], moved[1], data.own, {
        hovertext: Array.from(data.error, (e, i) => `${digits(e, 3)} µm at ${digits(data.time[i], 5)}`),
        hoverinfo: "text",
      }),
      { type: "scatter", mode: "markers", x: marks.map((m) => m[0]), y: marks.map((m) => m[1]),
        hovertext: data.worst.map((w) => `${digits(w.error, 3)} µm<br>${plain(w.where)}`), hoverinfo: "text",
        marker: { size: 9, color: look.alarm, symbol: "circle-open", line: { width: 2 } } },
    ],
    layout: {
      ...baseLayout(look, narrow() ? 380 : 560),
      xaxis: axis(look, `${a} [mm]`, { zeroline: false }),
      yaxis: axis(look, `${b} [mm]`, { zeroline: false, scaleanchor: "x", scaleratio: 1 }),
      annotations: [{
        text: `deviation × ${digits(factor, 3)}`, x: 0, y: 1, xref: "paper", yref: "paper", xanchor: "left",
        yanchor: "bottom", showarrow: false, font: { size: 13, color: look.ink },
      }],
    },
  };
}

function errorPicture() {
  const look = theme();
  const low = Float64Array.from(data.error, (e, i) => e - data.half[i]);
  const high = Float64Array.from(data.error, (e, i) => e + data.half[i]);
  const edge = { width: 0, color: colour(data.own) };
  return {
    traces: [
      { type: "scatter", mode: "lines", x: data.time, y: low, line: edge, hoverinfo: "skip" },
      { type: "scatter", mode: "lines", x: data.time, y: high, line: edge, hoverinfo: "skip", fill: "tonexty",
        fillcolor: faded(colour(data.own), 0.18) },
      trace("contour error", data.time, data.error, data.own),
    ],
    layout: {
      ...baseLayout(look, 340), xaxis: axis(look, timeTitle, { zeroline: false }),
      yaxis: axis(look, "contour error [µm]", { zerolinewidth: 1.5 }),
    },
  };
}

function listed(curves, key, title) {
  const look = theme();
  return {
    traces: curves.map((curve) => trace(curve.name, data.time, curve[key], curve.look)),
    layout: {
      ...baseLayout(look, 360), showlegend: true, legend: { orientation: "h", y: 1.12, font: { color: look.ink } },
      xaxis: axis(look, timeTitle, { zeroline: false }), yaxis: axis(look, title, { zerolinewidth: 1.5 }),
    },
  };
}

const pictures = {
  path: pathPicture,
  error: errorPicture,
  causes: () => listed(data.causes, "signal", "contour error [µm]"),
  tracking: () => listed(data.tracking, "values", "[µm]"),
};

function drawAll() {
  for (const [id, picture] of Object.entries(pictures)) {
    if (!document.getElementById(id)) continue;
    const { traces, layout } = picture();
    Plotly.react(id, traces, layout, plotConfig(id));
  }
}

input.addEventListener("input", () => {
  const value = Number(input.value);
  if (value >= 0 && Number.isFinite(value)) {
    factor = value;
    const { traces, layout } = pathPicture();
    Plotly.react("path", traces, layout, plotConfig("path"));
  }
});
darkness.addEventListener("change", drawAll);
drawAll();
document.documentElement.dataset.ready = "yes";
