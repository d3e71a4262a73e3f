"use strict";
// Colours, decoding and words that every figure uses.

const data = JSON.parse(document.getElementById("data").textContent);
const darkness = matchMedia("(prefers-color-scheme: dark)");
const narrow = () => document.documentElement.clientWidth < 600;

function numbers(packed) {
  const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
  return packed.type === "i4" ? new Int32Array(bytes.buffer) : new Float32Array(bytes.buffer);
}

// plotly reads a little HTML in its texts: names and program lines come from files
function plain(text) {
  return String(text)
    .replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

function digits(value, count) {
  if (!Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  return value.toFixed(Math.min(6, Math.max(0, count - 1 - size)));
}

function theme() {
  const style = getComputedStyle(document.documentElement);
  const read = (name) => style.getPropertyValue(`--${name}`).trim();
  return {
    ground: read("ground"), panel: read("panel"), ink: read("ink"), muted: read("muted"),
    rule: read("rule"), grid: read("grid"), path: read("path"), alarm: read("alarm"),
    run: (run) => (darkness.matches ? run.dark : run.light),
    font: getComputedStyle(document.body).fontFamily,
  };
}

function faded(colour, share) {
  const value = parseInt(colour.slice(1), 16);
  return `rgba(${value >> 16},${(value >> 8) & 255},${value & 255},${share})`;
}

function axis(look, title, more = {}) {
  return {
    title: { text: title, font: { size: 13, color: look.muted }, standoff: 8 },
    gridcolor: look.grid, zerolinecolor: look.rule, linecolor: look.rule, color: look.muted,
    tickfont: { size: 12, color: look.muted }, automargin: true, exponentformat: "none", ...more,
  };
}

function baseLayout(look, height) {
  return {
    height, showlegend: false, hovermode: "closest", dragmode: narrow() ? false : "zoom",
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: look.font, size: 13, color: look.ink },
    margin: { l: narrow() ? 44 : 64, r: 16, t: 28, b: 44 },
    hoverlabel: {
      bgcolor: look.panel, bordercolor: look.rule, align: "left",
      font: { family: look.font, size: 13, color: look.ink },
    },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: look.rule, activecolor: look.muted },
    uirevision: "keep",
  };
}

// the buttons are named, so that none that sends data anywhere can appear
function plotConfig(id) {
  const space = id === "path" && data.shown === 3 && webgl;
  return {
    responsive: true, displaylogo: false, showTips: false, scrollZoom: false, plotlyServerURL: "",
    typesetMath: false,
    displayModeBar: id.startsWith("closeup") || narrow() ? false : "hover",
    modeBarButtons: [space
      ? ["toImage", "orbitRotation", "pan3d", "zoom3d", "resetCameraDefault3d"]
      : ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]],
    toImageButtonOptions: { format: "png", scale: 2, filename: `contourlab_${id}` },
  };
}
