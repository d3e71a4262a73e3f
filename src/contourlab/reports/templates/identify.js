// Draws the figures that the page's data list: panels above each other over one axis.

for (const figure of data.figures) {
  for (const panel of figure.panels) {
    for (const curve of panel.curves) {
      if (!Array.isArray(curve.x)) curve.x = numbers(curve.x);
      curve.y = Array.from(numbers(curve.y), (v) => (Number.isFinite(v) ? v : null));
      if (curve.error) curve.error = numbers(curve.error);
    }
  }
}

function draw(figure) {
  const look = theme();
  const n = figure.panels.length, gap = n > 1 ? 0.09 : 0;
  const height = (1 - gap * (n - 1)) / n;
  const traces = [];
  const layout = {
    ...baseLayout(look, 70 + 210 * n),
    showlegend: figure.panels.some((p) => p.curves.some((c) => c.name)),
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" },
    margin: { l: narrow() ? 56 : 76, r: 16, t: 36, b: 48 }, shapes: [],
  };
  layout.xaxis = axis(look, plain(figure.x), {
    type: figure.log ? "log" : figure.category ? "category" : "linear", anchor: n > 1 ? `y${n}` : "y",
  });
  figure.panels.forEach((panel, k) => {
    const name = k ? `y${k + 1}` : "y", top = 1 - k * (height + gap);
    layout[k ? `yaxis${k + 1}` : "yaxis"] = axis(look, plain(panel.y), {
      domain: [top - height, top], type: panel.log ? "log" : "linear", exponentformat: "e",
    });
    for (const curve of panel.curves) {
      const color = look.run(curve);
      traces.push({
        type: "scatter", mode: curve.mode, x: curve.x, y: curve.y, xaxis: "x", yaxis: name,
        name: plain(curve.name || ""), showlegend: Boolean(curve.name),
        line: { color, width: 1.6, dash: curve.dash || "solid", simplify: false },
        marker: { color, size: 6 },
        error_y: curve.error ? { type: "data", array: curve.error, color, thickness: 1.2 } : undefined,
      });
    }
    for (const level of panel.levels || []) {
      layout.shapes.push({
        type: "line", xref: "paper", x0: 0, x1: 1, yref: name, y0: level, y1: level,
        line: { color: look.alarm, width: 1, dash: "dot" },
      });
    }
  });
  return Plotly.react(figure.id, traces, layout, plotConfig(figure.id));
}

const drawAll = () => Promise.all(data.figures.map(draw));
darkness.addEventListener("change", drawAll);
drawAll().then(() => { document.documentElement.dataset.ready = "1"; });
