// The page: draws the figures, and draws again when the reader or the system changes something.

const root = document.documentElement;
const state = { factor: data.magnification, over: "time" };
const decade = (value) => Math.log10(value);
const ceiling = Math.max(10, 10 ** Math.ceil(decade(data.magnification) + 1.5));

function draw(id, { traces, layout }) {
  return Plotly.react(id, traces, layout, plotConfig(id));
}

const figures = {
  path: () => pathFigure(state.factor),
  error_distance: () => errorFigure("distance"),
  error_time: () => errorFigure("time"),
  tracking_error: () => axisFigure("tracking_error", data.tracking, state.over),
  command: () => axisFigure("command", data.commands, state.over),
  spread: () => spreadFigure(),
};

function drawAll() {
  showOutside();
  const drawn = [];
  for (const [id, figure] of Object.entries(figures)) {
    if (document.getElementById(id)) drawn.push(draw(id, figure()));
  }
  data.runs.forEach((run, k) => {
    const panel = document.getElementById(`closeup_${k}`);
    if (!panel) return;
    panel.parentElement.hidden = run.hidden;
    if (!run.hidden) drawn.push(draw(panel.id, closeupFigure(run)));
  });
  return Promise.all(drawn);
}

function makeCloseups() {
  const grid = document.getElementById("closeups");
  if (!grid) return;
  data.runs.forEach((run, k) => {
    if (!run.closeup) return;
    const box = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const name = document.createElement("b");
    const panel = document.createElement("div");
    const size = digits(Math.abs(run.error[run.worst.row]), 3);
    const text = data.lines[run.line[run.worst.row]];
    const away = Math.max(...run.closeup.reference.map(Math.abs)) > run.closeup.half;
    box.className = `closeup c${k}`;
    name.textContent = run.name;
    caption.append(name, ` · ${size} µm · ${run.worst.where}${text ? `: ${text}` : ""}` +
      (away ? `; the reference is ${digits(run.closeup.lag, 3)} µm from the tool, outside` : ""));
    panel.id = `closeup_${k}`;
    box.append(caption, panel);
    grid.append(box);
  });
}

// -- magnification ---------------------------------------------------------------------------

function showOutside() {
  const inside = framed();
  for (const run of data.runs) run.far = !run.hidden && !inside.includes(run);
  const outside = data.runs.filter((run) => run.far);
  for (const place of document.querySelectorAll(".outside")) {
    place.textContent = outside.length
      ? ` ${outside.map((run) => `${run.name} (${digits(run.largest, 3)} µm)`).join(", ")} ` +
        "is so much worse than the best that it leaves the picture; hide the others to see it whole."
      : "";
  }
}

function showFactor() {
  if (!document.getElementById("path")) return;  // of one axis alone there is no picture
  const shown = Number(state.factor.toPrecision(6));
  const field = document.getElementById("factor");
  if (document.activeElement !== field) field.value = shown;
  document.getElementById("slider").value = 1000 * decade(state.factor) / decade(ceiling);
  for (const place of document.querySelectorAll(".factor")) place.textContent = shown;
  root.dataset.magnification = shown;
}

function setFactor(factor, { remember = true } = {}) {
  if (!(Number.isFinite(factor) && factor > 0 && document.getElementById("path"))) return;
  state.factor = factor;
  showFactor();
  draw("path", figures.path());
  if (remember) {
    try {
      history.replaceState(null, "", `#magnification=${Number(factor.toPrecision(6))}`);
    } catch { /* a page opened in a frame may not change its address */ }
  }
}

function factorInAddress() {
  const match = /(?:^#|&)magnification=([0-9.eE+]+)/.exec(location.hash);
  const factor = match ? Number(match[1]) : NaN;
  return Number.isFinite(factor) && factor > 0 ? factor : null;
}

// two digits, so that the slider stops at round numbers
const rounded = (value) => Number(value.toPrecision(2));

document.getElementById("slider")?.addEventListener("input", (event) => {
  setFactor(rounded(10 ** (event.target.value / 1000 * decade(ceiling))));
});
document.getElementById("factor")?.addEventListener("input", (event) => {
  setFactor(Number(event.target.value));
});
document.getElementById("initial")?.addEventListener("click", () => setFactor(data.magnification));
addEventListener("hashchange", () => {
  const factor = factorInAddress();
  if (factor !== null) setFactor(factor, { remember: false });
});

// -- controllers, zoom, colours ------------------------------------------------------------

for (const key of document.querySelectorAll(".key")) {
  key.addEventListener("click", () => {
    const run = data.runs[Number(key.dataset.run)];
    run.hidden = !run.hidden;
    key.setAttribute("aria-pressed", String(!run.hidden));
    drawAll();
  });
}

for (const key of document.querySelectorAll("[data-over]")) {
  key.addEventListener("click", () => {
    state.over = key.dataset.over;
    for (const other of document.querySelectorAll("[data-over]")) {
      other.setAttribute("aria-pressed", String(other === key));
    }
    for (const id of axisIds) {
      if (document.getElementById(id)) draw(id, figures[id]());
    }
  });
}

// figures over the same quantity zoom together
const axisIds = ["tracking_error", "command"];
const overOf = (id) => (axisIds.includes(id) ? state.over : id === "error_time" ? "time" : "distance");
let linking = false;
function linkZooms() {
  const present = ["error_distance", "error_time", ...axisIds]
    .filter((id) => document.getElementById(id));
  for (const id of present) {
    document.getElementById(id).on("plotly_relayout", (change) => {
      if (linking) return;
      const keys = ["xaxis.range[0]", "xaxis.range[1]", "xaxis.range", "xaxis.autorange"];
      const zoom = Object.fromEntries(keys.filter((k) => k in change).map((k) => [k, change[k]]));
      if (!Object.keys(zoom).length) return;
      linking = true;
      const others = present.filter((other) => other !== id && overOf(other) === overOf(id));
      Promise.all(others.map((other) => Plotly.relayout(other, zoom)))
        .finally(() => { linking = false; });
    });
  }
}

darkness.addEventListener("change", drawAll);
let width = root.clientWidth;
addEventListener("resize", () => {
  const crossed = (root.clientWidth < 600) !== (width < 600);
  width = root.clientWidth;
  if (crossed) drawAll();
});

if (data.shown === 3 && !webgl) {
  document.getElementById("flat").textContent =
    "This browser has no WebGL, so the first two coordinates of the path are drawn.";
}
makeCloseups();
state.factor = factorInAddress() ?? state.factor;
showFactor();
drawAll().then(() => { linkZooms(); root.dataset.ready = "1"; });
