// Figures with a row for each axis: tracking errors and commands.

// when a run was where; times rise, and so does the search
function distanceAt(run, time) {
  const times = run.axes.time;
  let low = 0, high = times.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle; else high = middle;
  }
  return run.axes.distance[time - times[low] < times[high] - time ? low : high];
}

// one row per panel over a common time or distance
function axisFigure(key, panels, over) {
  const look = theme(), inside = framed();
  const count = panels.length, gap = 0.24 / Math.max(count, 2);
  const traces = [], annotations = [];
  const shapes = stopLines(look, over), at = over === "time" ? "s" : "mm";
  const layout = baseLayout(look, Math.min(70 + (narrow() ? 150 : 180) * count, 1400));
  const share = (1 - gap * (count - 1)) / count;
  panels.forEach((panel, row) => {
    const unit = panel.unit, limit = panel.limit;
    const suffix = row === 0 ? "" : String(row + 1);
    const top = 1 - row * (share + gap);
    let [low, high] = [Infinity, -Infinity];
    for (const run of data.drawn) {
      if (!panel.runs.includes(data.runs.indexOf(run))) continue;
      const y = run.axes[key] && run.axes[key][panel.axis];
      if (!y) continue;
      if (key === "command" ? !run.hidden : inside.includes(run)) {
        const [a, b] = bounds(y);
        [low, high] = [Math.min(low, a), Math.max(high, b)];
      }
      traces.push(line(run, look, run.axes[over], y, 1.3, {
        yaxis: `y${suffix}`,
        hovertemplate: `<b>${run.label.replace(/%/g, "&#37;")}</b><br>%{y:.4g} ${plain(unit)} at %{x:.4g} ${at}<extra></extra>`,
      }));
      const saturated = (key === "command" && run.axes.saturated[panel.axis]) || [];
      const spans = over === "time" ? saturated :
        saturated.map((span) => span.map((time) => distanceAt(run, time)));
      if (spans.length) traces.push(shading(run, look, spans, limit, suffix));
    }
    if (!(low <= high)) [low, high] = [-1, 1];
    const peak = Math.max(Math.abs(low), Math.abs(high));
    const pad = 0.08 * (high - low || peak || 1);
    [low, high] = [low - pad, high + pad];
    let title = `<b>${plain(panel.title)}</b>`;
    if (typeof limit === "number" && peak >= 0.35 * limit) {
      [low, high] = [Math.min(low, -1.12 * limit), Math.max(high, 1.12 * limit)];
      for (const sign of [-1, 1]) {
        shapes.push({
          type: "line", xref: "paper", x0: 0, x1: 1, yref: `y${suffix}`, y0: sign * limit,
          y1: sign * limit, line: { color: look.ink, width: 1, dash: "dash" },
        });
      }
      title += `  limit ±${Number(limit.toPrecision(4))} ${plain(unit)}`;
    } else if (limit !== undefined) {
      title += limit === null ? "  no limit" :
        `  limit ±${Number(limit.toPrecision(4))} ${plain(unit)}, outside the picture`;
    }
    annotations.push({
      text: title, xref: "paper", yref: "paper", x: 0, y: top, xanchor: "left", yanchor: "bottom",
      showarrow: false, font: { size: 12.5, color: look.ink },
    });
    layout[`yaxis${suffix}`] = axis(look, `[${plain(unit)}]`, {
      domain: [Math.max(0, top - share), top], range: [low, high], anchor: "x", nticks: 6,
    });
  });
  layout.xaxis = axis(look, overTitle[over], {
    anchor: count > 1 ? `y${count}` : "y", zeroline: false,
    range: bounds(data.runs.flatMap((run) => bounds(run.axes[over]))),
  });
  return { traces, layout: { ...layout, shapes, annotations, uirevision: over } };
}

function shading(run, look, saturated, limit, suffix) {
  const x = [], y = [];
  for (const [from, to] of saturated) {
    x.push(from, from, to, to, from, null);
    y.push(-limit, limit, limit, -limit, -limit, null);
  }
  return {
    type: "scatter", mode: "none", x, y, yaxis: `y${suffix}`, fill: "toself", hoverinfo: "skip",
    visible: !run.hidden, fillcolor: faded(look.run(run), 0.16),
  };
}
