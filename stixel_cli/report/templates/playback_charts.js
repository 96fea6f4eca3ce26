// Charts of the errors over time, with a draggable cursor.
const DURATION = Math.max(times[LAST] - times[0], 1e-9);
const counts = (run) => data.scans[run.scan].points.map((flat) => flat.length / 2);
const finite = (values) => values.filter((value) => value !== null && Number.isFinite(value));
// Labels, units and bounds come from evaluation/metric_table.py.
const CHARTS = [
  ...data.series.map((series) => ({ ...series, digits: series.ratio || series.unit === "°" ? 2 : 3 })),
  { name: "points", short_label: "Points used", digits: 0, unit: "", bounds: [0, null] },
];
const BOUNDS = {
  nees_position: () => times.map(() => data.neesBounds),
  nis: (run) => run.nisBounds[0].map((low, k) => [low, run.nisBounds[1][k]]),
};
for (const run of runs) run.errors.points = run.used.map((used) => used.length);

const charts = CHARTS.map((chart) => {
  const card = html("div", { className: "chart" }, find("errors"));
  const head = html("h2", {}, card);
  html("span", { className: "name", textContent: chart.short_label }, head);
  for (const [r, run] of runs.entries()) {
    const text = run.badges[chart.name];
    if (!text) continue;
    // Of several runs only the factor fits next to the values.
    const badge = html("span", { className: "badge", textContent: text, title: text }, head);
    if (runs.length === 1) continue;
    badge.textContent = text.slice(Math.max(0, text.indexOf("×")));
    badge.style.borderColor = colourOf(r);
  }
  const values = runs.map((_, r) => {
    const value = html("span", { className: "value" }, head);
    value.style.color = `color-mix(in srgb, ${colourOf(r)} 60%, var(--ink))`;  // legible as text
    return value;
  });
  const plot = svg("svg", { class: "plot", role: "img", "aria-label": `${chart.short_label} over time` }, card);
  const made = { ...chart, values, plot };
  const scanAt = (event) => {
    const share = (event.offsetX - made.left) / (made.right - made.left);
    return nearest(times[0] + DURATION * Math.min(1, Math.max(0, share)));
  };
  plot.addEventListener("pointerdown", (event) => {
    pause();
    plot.setPointerCapture(event.pointerId);
    show(scanAt(event));
  });
  plot.addEventListener("pointermove", (event) => {
    if (plot.hasPointerCapture(event.pointerId)) show(scanAt(event));
    drawHover(made, scanAt(event));
  });
  plot.addEventListener("pointerleave", () => drawHover(made, null));
  new ResizeObserver(() => { drawChart(made); drawCursor(made); }).observe(plot);
  return made;
});

function nearest(time) {
  let best = 0;
  times.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(times[best] - time)) best = k; });
  return best;
}

function verticalRange(chart) {
  const series = runs.map((run) => run.errors[chart.name]);
  const all = finite(series.flat());
  if (chart.name === "points") all.push(...runs.flatMap(counts));
  if (chart.ratio) {
    const positive = all.filter((value) => value > 0);
    // Whole decades, so that both ends have a tick.
    const decade = (round, value) => 10 ** round(Math.log10(value) - (round === Math.ceil ? 1e-9 : -1e-9));
    return [Math.max(1e-3, decade(Math.floor, Math.min(0.1, ...positive))), Math.min(1e4, decade(Math.ceil, Math.max(10, ...positive)))];
  }
  const least = Math.min(0, ...all), most = Math.max(0, ...all);
  // Counts have whole ticks.
  const step = Math.max(niceStep(((most - least) || 1) / 2.2), chart.digits ? 0 : 1);
  chart.step = step;
  const low = chart.bounds[0] ?? Math.floor(least / step + 1e-9) * step;
  const high = chart.bounds[1] ?? Math.ceil(most / step - 1e-9) * step;
  return [low, high > low ? high : low + step];
}

function drawChart(chart) {
  const { plot } = chart, { width, height } = plot.getBoundingClientRect();
  if (!width) return;
  plot.setAttribute("viewBox", `0 0 ${width} ${height}`);
  Object.assign(chart, { left: 46, right: width - 8, top: 8, bottom: height - 17 });
  const [low, high] = verticalRange(chart);
  const scaled = chart.ratio ? Math.log10 : (value) => value;
  const span = scaled(high) - scaled(low);
  const limited = (value) => Math.min(high, Math.max(low, value));
  chart.x = (time) => chart.left + (time - times[0]) / DURATION * (chart.right - chart.left);
  chart.y = (value) => chart.bottom - (scaled(limited(value)) - scaled(low)) / span * (chart.bottom - chart.top);
  plot.replaceChildren();
  const bounds = BOUNDS[chart.name];
  if (bounds) for (const run of runs.slice(0, chart.name === "nees_position" ? 1 : undefined)) {
    svg("path", { class: "consistent", d: bandOverTime(chart, bounds(run)) }, plot);
  }
  const rise = chart.step;
  const ticks = chart.ratio ? [0.001, 0.01, 0.1, 1, 10, 100, 1000, 1e4].filter((v) => v >= low && v <= high)
    : linearTicks(low, high, rise);
  for (const tick of ticks) {
    const y = chart.y(tick);
    svg("line", { class: "rule", x1: chart.left, x2: chart.right, y1: y, y2: y }, plot);
    // Both ends have a label, and the ticks between them where there is space.
    const ends = [ticks[0], ticks.at(-1)];
    if (!ends.includes(tick) && Math.min(...ends.map((end) => Math.abs(chart.y(end) - y))) < 11) continue;
    const isLast = tick === ticks.at(-1) && chart.unit;
    const text = (chart.ratio ? String(tick) : tickText(tick, rise)) +
      (isLast ? (chart.unit === "°" ? "°" : ` ${chart.unit}`) : "");
    svg("text", { x: chart.left - 5, y: y + 3.5, "text-anchor": "end" }, plot).textContent = text;
  }
  const step = niceStep(DURATION / Math.max(1, (chart.right - chart.left) / 60));
  for (const tick of linearTicks(times[0], times[LAST], step)) {
    // The end has a tick of its own.
    if (chart.x(tick) > chart.right - 48) continue;
    svg("text", { x: chart.x(tick), y: height - 4, "text-anchor": "middle" }, plot).textContent = tickText(tick, step);
  }
  svg("text", { class: "end", x: chart.right, y: height - 4, "text-anchor": "end" }, plot).textContent =
    `${+times[LAST].toFixed(2)} s`;
  const dash = chart.name === "iou" ? data.lowOverlap : null;
  for (const [kind, value] of [["base", chart.consistent ?? null], ["dash", dash]]) {
    if (value === null) continue;
    svg("line", { class: kind, x1: chart.left, x2: chart.right, y1: chart.y(value), y2: chart.y(value) }, plot);
  }
  if (chart.name === "points") {
    const curve = svg("path", { class: "curve", d: curveOf(chart, counts(runs[source])) }, plot);
    curve.style.stroke = "var(--unused)";
    curve.style.strokeWidth = 3;
  }
  runs.forEach((run, r) => {
    const curve = svg("path", { class: "curve", d: curveOf(chart, run.errors[chart.name]) }, plot);
    curve.style.stroke = runs.length === 1 && chart.name === "points" ? "var(--used)" : colourOf(r);
    curve.style.strokeDasharray = dashOf(r);
  });
  chart.cursor = svg("line", { class: "cursor", y1: chart.top - 4, y2: chart.bottom }, plot);
  chart.grip = svg("path", { class: "grip" }, plot);
  chart.marks = runs.map((_, r) => {
    const mark = svg("circle", { r: 3.5 }, plot);
    mark.style.fill = colourOf(r);
    return mark;
  });
}

function linearTicks(low, high, step) {
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) ticks.push(i * step);
  return ticks;
}

function curveOf(chart, values) {
  let text = "", open = false;
  values.forEach((value, k) => {
    const there = value !== null && !(chart.ratio && value <= 0);
    if (there) text += `${open ? "L" : "M"}${chart.x(times[k]).toFixed(1)} ${chart.y(value).toFixed(1)}`;
    if (there && !open) text += "h.01";
    open = there;
  });
  return text;
}

function bandOverTime(chart, bounds) {
  let text = "";
  const width = (chart.right - chart.left) / Math.max(1, LAST);
  bounds.forEach(([low, high], k) => {
    if (low === null || high === null) return;
    const x = Math.max(chart.left, chart.x(times[k]) - width / 2 - 0.3);
    const end = Math.min(chart.right, chart.x(times[k]) + width / 2 + 0.3);
    text += `M${x.toFixed(1)} ${chart.y(high).toFixed(1)}H${end.toFixed(1)}V${chart.y(low).toFixed(1)}H${x.toFixed(1)}Z`;
  });
  return text;
}

function valueText(chart, run, k) {
  const value = run.errors[chart.name][k];
  const total = chart.name === "points" ? ` of ${counts(run)[k]}` : "";
  const small = chart.ratio && Math.abs(value) < 1 && value;
  return (small ? shownSmall(value) : shown(value, chart.digits, chart.unit === "m" ? " m" : chart.unit)) + total;
}

// The time and the values under the pointer; nothing for k = null.
function drawHover(chart, k) {
  for (const old of chart.plot.querySelectorAll(".hover, .hovered")) old.remove();
  if (k === null || !chart.x) return;
  const x = chart.x(times[k]), isRight = x > (chart.left + chart.right) / 2;
  svg("line", { class: "hover", x1: x, x2: x, y1: chart.top, y2: chart.bottom }, chart.plot);
  svg("text", { class: "hovered", x: isRight ? x - 6 : x + 6, y: chart.top + 9, "text-anchor": isRight ? "end" : "start" }, chart.plot)
    .textContent = `${times[k].toFixed(2)} s: ${runs.map((run) => valueText(chart, run, k)).join(" · ")}`;
}

function drawCursor(chart) {
  runs.forEach((run, r) => { chart.values[r].textContent = valueText(chart, run, frame); });
  if (!chart.cursor) return;
  const x = chart.x(times[frame]);
  chart.cursor.setAttribute("x1", x);
  chart.cursor.setAttribute("x2", x);
  chart.grip.setAttribute("d", `M${x - 4.5} ${chart.top - 6}h9l-4.5 6z`);
  runs.forEach((run, r) => {
    const value = run.errors[chart.name][frame], mark = chart.marks[r];
    mark.style.display = value === null || value === undefined ? "none" : "";
    mark.setAttribute("cx", x);
    if (value !== null) mark.setAttribute("cy", chart.y(value));
  });
}
