// The runs of a comparison: decoded, and what they are called in the figures.

for (const run of data.runs) {
  for (const key of ["time", "distance", "error", "line"]) run[key] = numbers(run[key]);
  run.foot = run.foot.map(numbers);
  run.vector = run.vector.map(numbers);
  for (const key of ["time", "distance"]) run.axes[key] = numbers(run.axes[key]);
  for (const key of ["command", "tracking_error"]) {
    if (run.axes[key]) run.axes[key] = run.axes[key].map(numbers);
  }
  run.label = plain(run.name);
  run.hidden = false;
  run.largest = run.error.reduce((most, error) => Math.max(most, Math.abs(error) || 0), 0);
  run.hover = Array.from(run.error, (error, k) => where(run, k));
}
data.path = data.path.map(numbers);
for (const strips of data.spread) {
  for (const row of strips.rows) {
    row.values = numbers(row.values);
    row.offset = numbers(row.offset);
  }
}

// in the order of drawing, the best on top
data.drawn = [...data.runs].sort((a, b) => b.diverged - a.diverged || b.largest - a.largest);

// the runs that decide how large a picture is: none far worse than the best
function framed() {
  const visible = data.runs.filter((run) => !run.hidden);
  const good = visible.filter((run) => !run.diverged);
  const least = Math.min(...good.map((run) => run.largest));
  return visible.filter((run) => run.diverged || run.largest <= data.far_worse * least);
}

// the runs whose worst point is written beside it: with many, the least and the greatest
function labelled() {
  const good = framed().filter((run) => run.worst).sort((a, b) => a.largest - b.largest);
  return good.length <= 4 ? good : [good[0], good[good.length - 1]];
}

function lineText(line) {
  if (!line) return "";
  const text = data.lines[line];
  return text ? `line ${line}: ${plain(text)}` : `line ${line}`;
}

function where(run, k) {
  const line = lineText(run.line[k]);
  return `<b>${run.label}</b><br>contour error ${digits(run.error[k], 3)} µm` +
    `<br>at ${digits(run.distance[k], 4)} mm, ${digits(run.time[k], 4)} s` +
    (line ? `<br>${line}` : "");
}

// "12.3 µm · line 23", or where it is along the path
function worstText(run) {
  return `${digits(Math.abs(run.error[run.worst.row]), 3)} µm · ${plain(run.worst.where)}`;
}
