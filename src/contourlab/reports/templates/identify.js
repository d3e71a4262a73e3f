"use strict";
// Draws the figures that the page's data list: panels above each other over one axis.

const data = JSON.parse(document.getElementById("data").textContent);
const darkness = matchMedia("(prefers-color-scheme: dark)");
const narrow = () => document.documentElement.clientWidth < 600;

function numbers(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  return packed.type === "i4" ? new Int32Array(bytes.buffer) : new Float32Array(bytes.buffer);
}

// plotly reads a little HTML in its texts: names come from files
function plain(text) {
  return String(text)
    .replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

for (const figure of data.figures) {
  for (const panel of figure.panels) {
    for (const curve of panel.curves) {
      if (!Array.isArray(curve.x)) curve.x = numbers(curve.x);
      curve.y = Array.from(numbers(curve.y), (v) => (Number.isFinite(v) ? v : null));
      if (curve.error) curve.error = numbers(curve.error);
    }
  }
}

function theme() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ground: read("ground"), panel: read("panel"), ink: read("ink"), muted: read("muted"),
    rule: read("rule"), grid: read("grid"), alarm: read("alarm"),
    font: getComputedStyle(document.body).fontFamily,
  };
}

function draw(figure) {
  const look = theme(), dark = darkness.matches;
  const n = figure.panels.length, gap = n > 1 ? 0.09 : 0;
  const height = (1 - gap * (n - 1)) / n;
  const traces = [];
  const layout = {
    height: 70 + 210 * n, showlegend: figure.panels.some((p) => p.curves.some((c) => c.name)),
    legend: { orientation: "h", x: 0, y: 1.02, yanchor: "bottom" },
    hovermode: "closest", dragmode: narrow() ? false : "zoom",
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: look.font, size: 13, color: look.ink },
    margin: { l: narrow() ? 56 : 76, r: 16, t: 36, b: 48 }, uirevision: "keep", shapes: [],
    hoverlabel: { bgcolor: look.panel, bordercolor: look.rule, font: { color: look.ink } },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: look.rule, activecolor: look.muted },
  };
  const axis = (title, more) => ({
    title: { text: plain(title), font: { size: 13, color: look.muted }, standoff: 8 },
    gridcolor: look.grid, zerolinecolor: look.rule, linecolor: look.rule, color: look.muted,
    tickfont: { size: 12, color: look.muted }, automargin: true, ...more,
  });
  layout.xaxis = axis(figure.x, { type: figure.log ? "log" : figure.category ? "category" : "linear", anchor: n > 1 ? `y${n}` : "y" });
  figure.panels.forEach((panel, k) => {
    const key = k ? `yaxis${k + 1}` : "yaxis", top = 1 - k * (height + gap);
    layout[key] = axis(panel.y, { domain: [top - height, top], type: panel.log ? "log" : "linear", exponentformat: "e" });
    for (const curve of panel.curves) {
      const colour = dark ? curve.dark : curve.light;
      traces.push({
        type: "scatter", mode: curve.mode, x: curve.x, y: curve.y, xaxis: "x",
        yaxis: k ? `y${k + 1}` : "y", name: plain(curve.name || ""), showlegend: Boolean(curve.name),
        line: { color: colour, width: 1.6, dash: curve.dash || "solid", simplify: false },
        marker: { color: colour, size: 6 },
        error_y: curve.error ? { type: "data", array: curve.error, color: colour, thickness: 1.2 } : undefined,
      });
    }
    for (const level of panel.levels || []) {
      layout.shapes.push({
        type: "line", xref: "paper", x0: 0, x1: 1, yref: k ? `y${k + 1}` : "y", y0: level, y1: level,
        line: { color: look.alarm, width: 1, dash: "dot" },
      });
    }
  });
  return Plotly.react(figure.id, traces, layout, {
    responsive: true, displaylogo: false, showTips: false, plotlyServerURL: "", typesetMath: false,
    displayModeBar: narrow() ? false : "hover",
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
    toImageButtonOptions: { format: "png", scale: 2, filename: `contourlab_${figure.id}` },
  });
}

const drawAll = () => Promise.all(data.figures.map(draw));
darkness.addEventListener("change", drawAll);
drawAll().then(() => { document.documentElement.dataset.ready = "1"; });
