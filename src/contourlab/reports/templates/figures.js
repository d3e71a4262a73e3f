// The figures: each is a function of nothing that returns traces and a layout.

function line(run, look, x, y, width, more = {}) {
  return {
    type: "scatter", mode: "lines", x, y, name: run.label, visible: !run.hidden,
    // plotly's own thinning leaves corners in smooth curves
    line: { color: look.run(run), width: run.far ? 0.6 * width : width, dash: run.dash, simplify: false },
    opacity: run.far ? 0.35 : run.diverged ? 0.8 : 1, ...more,
  };
}

function marker(run, look, x, y, hovertext, more = {}) {
  return {
    type: "scatter", mode: "markers", x, y, hovertext, hoverinfo: "text", visible: !run.hidden,
    marker: {
      color: look.run(run), size: 10, symbol: run.symbol, line: { color: look.ground, width: 1.5 },
    },
    ...more,
  };
}

function label(run, look, text, x, y, ax, ay, more = {}) {
  return {
    x, y, ax, ay, text, visible: !run.hidden, showarrow: true, arrowhead: 0, arrowwidth: 1,
    arrowcolor: look.run(run), font: { color: look.run(run), size: 12.5 }, bgcolor: look.ground,
    borderpad: 2, standoff: 6, ...more,
  };
}

const lost = (run) => (run.cut ? `leaves the picture, ${run.status}` : run.status);
const shift = (run, factor, axis) => run.foot[axis].map((at, k) => at - factor * run.vector[axis][k]);
const bounds = (values) => values.reduce(
  ([low, high], v) => [v < low ? v : low, v > high ? v : high], [Infinity, -Infinity]);
const webgl = data.shown === 3 && (() => {
  const canvas = document.createElement("canvas");
  return Boolean(canvas.getContext("webgl2") || canvas.getContext("webgl"));
})();

function factorText(factor) {
  return factor === 1 ? "deviation at true scale" : `deviation drawn ${factor.toLocaleString("en", { maximumSignificantDigits: 6 })} × larger`;
}

function pathFigure(factor) {
  const look = theme();
  return data.shown === 3 && webgl ? pathInSpace(factor, look) : pathInPlane(factor, look);
}

function pathInPlane(factor, look) {
  const inside = framed(), named = labelled();
  const [across, up] = [0, 1].map((k) => {
    const [low, high] = bounds([data.path[k], ...inside.map((run) => shift(run, factor, k))].flatMap(bounds));
    return { low, high, size: high - low || 1, middle: (low + high) / 2 };
  });
  const room = document.getElementById("path").clientWidth - (narrow() ? 60 : 90);
  const depth = Math.min(Math.max(1.12 * room * up.size / across.size, 200), narrow() ? 380 : 600);
  const height = depth + 180;  // above and below there is room for two rows of labels each
  const traces = [{
    type: "scatter", mode: "lines", x: data.path[0], y: data.path[1], hoverinfo: "skip",
    line: { color: look.path, width: 2, simplify: false },
  }];
  const annotations = [];
  const rows = { 1: 0, "-1": 0 };
  // labels stand above the part or below it, each in its row, and reach inwards
  const tag = (run, text, x, y) => {
    const side = y >= up.middle ? 1 : -1, share = (x - across.low) / across.size;
    const edge = side > 0 ? up.high : up.low;
    rows[side] += 1;
    const ay = edge + side * (0.02 + rows[side] * 19 / depth) * up.size;
    return label(run, look, text, x, y, 0, ay, {
      ayref: "y", xanchor: share < 0.4 ? "left" : share > 0.6 ? "right" : "center",
    });
  };
  for (const run of data.drawn) {
    const [x, y] = [shift(run, factor, 0), shift(run, factor, 1)];
    traces.push(line(run, look, x, y, 1.8, { hovertext: run.hover, hoverinfo: "text" }));
    if (run.diverged) {
      const last = x.length - 1;
      traces.push(marker(run, look, [x[last]], [y[last]], [`<b>${run.label}</b><br>${plain(lost(run))}`],
        { marker: { color: look.run(run), size: 10, symbol: "x" } }));
      if (!run.hidden) annotations.push(tag(run, narrow() ? "diverged" : plain(lost(run)), x[last], y[last]));
    } else if (run.worst && inside.includes(run)) {
      const k = run.worst.row;
      traces.push(marker(run, look, [x[k]], [y[k]], [run.hover[k]]));
      if (named.includes(run)) annotations.push(tag(run, worstText(run), x[k], y[k]));
    }
  }
  traces.push(stopMarkers(look, "scatter"));
  annotations.push({
    text: factorText(factor), x: 0, y: 1, xref: "paper", yref: "paper", xanchor: "left",
    yanchor: "bottom", showarrow: false, font: { size: 13, color: look.ink },
  });
  const [a, b] = data.coordinates.map(plain);
  return {
    traces,
    layout: {
      ...baseLayout(look, height), annotations,
      xaxis: axis(look, `${a} [mm]`, {
        zeroline: false, range: [across.low - 0.04 * across.size, across.high + 0.04 * across.size],
      }),
      yaxis: axis(look, `${b} [mm]`, {
        zeroline: false, scaleanchor: "x", scaleratio: 1, range: [
          up.low - (0.06 + rows[-1] * 19 / depth) * up.size,
          up.high + (0.06 + rows[1] * 19 / depth) * up.size,
        ],
      }),
    },
  };
}

function stopMarkers(look, type) {
  const [x, y, z] = data.stops.position;
  const hovertext = data.stops.time.map((time, k) => {
    const text = lineText(data.stops.line[k]);
    const at = data.stops.times_shown ? ` at ${digits(time, 4)} s` : "";
    return `exact stop${at}${text ? `<br>before ${text}` : ""}`;
  });
  return {
    type, mode: "markers", x, y, ...(type === "scatter3d" ? { z } : {}), hovertext, hoverinfo: "text",
    marker: {
      symbol: type === "scatter3d" ? "square" : "square-open", size: type === "scatter3d" ? 3 : 8,
      color: look.ink, line: { width: 1.5, color: look.ink },
    },
  };
}

function pathInSpace(factor, look) {
  const [x, y, z] = data.path;
  const traces = [{
    type: "scatter3d", mode: "lines", x, y, z, hoverinfo: "skip", line: { color: look.path, width: 3 },
  }, stopMarkers(look, "scatter3d")];
  for (const run of data.drawn) {
    const at = [0, 1, 2].map((k) => shift(run, factor, k));
    traces.push({
      type: "scatter3d", mode: "lines", x: at[0], y: at[1], z: at[2], visible: !run.hidden,
      hovertext: run.hover, hoverinfo: "text", line: { color: look.run(run), width: 4 },
    });
    const k = run.diverged ? at[0].length - 1 : run.worst && run.worst.row;
    if (k === null) continue;
    traces.push({
      type: "scatter3d", mode: "markers+text", x: [at[0][k]], y: [at[1][k]], z: [at[2][k]],
      visible: !run.hidden, hovertext: [run.hover[k]], hoverinfo: "text",
      text: [run.diverged ? plain(lost(run)) : worstText(run)],
      textposition: ["top center", "bottom center", "middle right"][data.runs.indexOf(run) % 3],
      textfont: { color: look.run(run), size: 12 },
      marker: { color: look.run(run), size: 5, symbol: run.diverged ? "x" : "circle" },
    });
  }
  const inSpace = (name) => ({
    ...axis(look, `${plain(name)} [mm]`), zeroline: false, showbackground: false,
  });
  const layout = baseLayout(look, narrow() ? 420 : 620);
  const [a, b, c] = data.coordinates;
  return {
    traces,
    layout: {
      ...layout, margin: { l: 0, r: 0, t: 28, b: 0 }, dragmode: "orbit",
      scene: {
        aspectmode: "data", xaxis: inSpace(a), yaxis: inSpace(b), zaxis: inSpace(c),
        camera: { eye: { x: 1.05, y: -1.3, z: 0.8 }, center: { x: 0, y: 0, z: -0.1 } },
      },
      annotations: [{
        text: factorText(factor), x: 0.01, y: 1, xref: "paper", yref: "paper", xanchor: "left",
        yanchor: "bottom", showarrow: false, font: { size: 13, color: look.ink },
      }],
    },
  };
}

function errorFigure(key) {
  const look = theme();
  const traces = [], annotations = [];
  const inside = framed(), named = labelled();
  const [low, high] = inside.length ? bounds(inside.flatMap((run) => bounds(run.error))) : [-1, 1];
  const [first, last] = bounds(data.runs.flatMap((run) => bounds(run[key])));
  const rows = { 1: 0, "-1": 0 }, step = 0.14 * (high - low || 1);
  for (const run of data.drawn) {
    const x = run[key];
    traces.push(line(run, look, x, run.error, 1.4, { hovertext: run.hover, hoverinfo: "text" }));
    if (run.diverged && !run.hidden) {
      const end = x.length - 1;
      traces.push(marker(run, look, [x[end]], [run.error[end]], [plain(lost(run))],
        { marker: { color: look.run(run), size: 9, symbol: "x" } }));
      annotations.push(label(run, look, narrow() ? "diverged" : plain(lost(run)), x[end], run.error[end], 36, 0,
        { xanchor: "left" }));
    } else if (run.worst && inside.includes(run)) {
      const k = run.worst.row;
      traces.push(marker(run, look, [x[k]], [run.error[k]], [run.hover[k]]));
      if (!named.includes(run)) continue;
      // labels stand in rows above the highest and below the lowest value, clear of the curves
      const side = run.error[k] >= 0 ? 1 : -1;
      rows[side] += 1;
      const text = narrow() ? worstText(run) :
        `${digits(Math.abs(run.error[k]), 3)} µm · ${lineText(run.line[k]) || plain(run.worst.where)}`;
      annotations.push(label(run, look, text, x[k], run.error[k], 0,
        (side > 0 ? high : low) + side * step * (rows[side] - 0.35),
        { ayref: "y", xanchor: x[k] < first + 0.5 * (last - first) ? "left" : "right" }));
    }
  }
  return {
    traces,
    layout: {
      ...baseLayout(look, narrow() ? 300 : 340), annotations, shapes: stopLines(look, key),
      xaxis: axis(look, overTitle[key], { zeroline: false, range: [first, last + 1e-9] }),
      yaxis: axis(look, "contour error [µm]", {
        range: [data.signed ? low - step * (rows[-1] + 0.4) : 0, high + step * (rows[1] + 0.4)],
        zerolinewidth: 1.5,
      }),
    },
  };
}

function closeupFigure(run) {
  const look = theme(), near = run.closeup;
  const traces = [{
    type: "scatter", mode: "lines", x: near.path[0], y: near.path[1], hoverinfo: "skip",
    line: { color: look.path, width: 4 },
  }];
  for (const track of near.tracks) {
    const other = data.runs[track.run], own = other === run;
    traces.push(line(other, look, track.points[0], track.points[1], own ? 2.4 : 1.2, {
      hoverinfo: "text", hovertext: other.label, opacity: own ? 1 : 0.5,
    }));
  }
  const [x, y] = near.actual;
  traces.push({
    type: "scatter", mode: "lines", x: [0, x], y: [0, y], hoverinfo: "skip",
    line: { color: look.ink, width: 1.5 },
  });
  traces.push(marker({ ...run, hidden: false }, look, [x], [y], ["the tool"]));
  traces.push({
    type: "scatter", mode: "markers", x: [near.reference[0]], y: [near.reference[1]],
    hovertext: "the reference at that instant", hoverinfo: "text",
    marker: { symbol: "circle-open", size: 11, color: look.ink, line: { width: 2 } },
  });
  const range = [-near.half, near.half];
  const layout = baseLayout(look, 330);
  return {
    traces,
    layout: {
      ...layout, margin: { l: 56, r: 8, t: 8, b: 44 },
      xaxis: axis(look, `${plain(near.axes[0])} [µm]`, { range, nticks: 6, constrain: "domain", constraintoward: "left" }),
      yaxis: axis(look, `${plain(near.axes[1])} [µm]`, {
        range, nticks: 6, scaleanchor: "x", scaleratio: 1, constrain: "domain",
      }),
    },
  };
}

// the exact stops as lines behind a figure over time or distance
function stopLines(look, over) {
  const drawn = data.stops.lines_shown && (over === "distance" || data.stops.times_shown);
  return !drawn ? [] : data.stops[over].map((at) => ({
    type: "line", x0: at, x1: at, y0: 0, y1: 1, yref: "paper", layer: "below",
    line: { color: look.path, width: 1, dash: "dot" },
  }));
}

const overTitle = { time: "time [s]", distance: "distance along the path [mm]" };

// how the contour error is distributed over the samples: a strip per run, rms beside max
function spreadFigure() {
  const look = theme(), side = !narrow();
  const shown = data.spread[0].rows.map((row, k) => k)
    .filter((k) => !data.runs[data.spread[0].rows[k].run].hidden);
  const each = 58 * Math.max(shown.length, 1);
  const layout = baseLayout(look, side ? 110 + each : 170 + 2 * each);
  const traces = [], annotations = [];
  data.spread.forEach((strips, column) => {
    const suffix = column ? String(column + 1) : "";
    const axes = { xaxis: `x${suffix}`, yaxis: `y${suffix}` };
    const end = Math.max(0, ...strips.rows.map((row) => row.values[row.values.length - 1] || 0));
    shown.forEach((k, place) => {
      const row = strips.rows[k], run = data.runs[row.run], colour = look.run(run);
      const words = `<b>${run.label}</b><br>median ${digits(row.median ?? NaN, 3)} µm` +
        `<br>5 to 95 %: ${digits(row.low ?? NaN, 3)} to ${row.high === null ? "diverged" : `${digits(row.high, 3)} µm`}` +
        (row.diverged ? `<br>${row.diverged} of ${row.samples} diverged` : "");
      traces.push({
        type: "scatter", mode: "markers", ...axes, x: row.values,
        y: Array.from(row.offset, (at) => place + 0.26 * at), hoverinfo: "text", hovertext: words,
        marker: { color: colour, size: 4.5, opacity: 0.4 },
      });
      if (row.low !== null) {
        traces.push({
          type: "scatter", mode: "lines", ...axes, x: [row.low, row.high ?? end], y: [place, place],
          hoverinfo: "skip", line: { color: colour, width: 4, dash: row.high === null ? "dot" : "solid" },
        });
      }
      if (row.median !== null) {
        traces.push({
          type: "scatter", mode: "markers", ...axes, x: [row.median], y: [place],
          hoverinfo: "text", hovertext: words,
          marker: { symbol: "line-ns-open", size: 20, color: colour, line: { width: 3, color: colour } },
        });
      }
      if (row.nominal !== null) {
        traces.push({
          type: "scatter", mode: "markers", ...axes, x: [row.nominal], y: [place],
          hoverinfo: "text", hovertext: `<b>${run.label}</b><br>as it stands: ${digits(row.nominal, 3)} µm`,
          marker: { symbol: "diamond", size: 9, color: look.ground, line: { width: 1.5, color: look.ink } },
        });
      }
    });
    const labels = shown.map((k) => {
      const row = strips.rows[k], run = data.runs[row.run];
      const name = run.name.length > 34 ? `${run.name.slice(0, 33)}…` : run.name;
      const lost = row.diverged ? `<br><i>${row.diverged} of ${row.samples} diverged</i>` : "";
      return `<span style="color:${look.run(run)}">${plain(name)}</span>${lost}`;
    });
    annotations.push({
      text: `<b>${plain(strips.title)}</b>`, xref: `x${suffix} domain`, yref: `y${suffix} domain`,
      x: 0, y: 1, xanchor: "left", yanchor: "bottom", showarrow: false,
      font: { size: 12.5, color: look.ink },
    });
    const last = data.spread.length - 1;
    layout[`xaxis${suffix}`] = axis(look, `[µm]${strips.logarithmic ? ", logarithmic" : ""}`, {
      type: strips.logarithmic ? "log" : "linear", anchor: `y${suffix}`, zeroline: false,
      rangemode: strips.logarithmic ? "normal" : "tozero", nticks: 7,
      domain: side ? [column * 0.52, column === last ? 1 : 0.48] : [0, 1],
    });
    layout[`yaxis${suffix}`] = axis(look, "", {
      anchor: `x${suffix}`, range: [shown.length - 0.45, -0.55], showgrid: false, zeroline: false,
      tickvals: shown.map((k, place) => place), fixedrange: true,
      ticktext: side && column ? shown.map(() => "") : labels,
      domain: side ? [0, 1] : column ? [0, 0.4] : [0.6, 1],
    });
  });
  return { traces, layout: { ...layout, annotations } };
}
