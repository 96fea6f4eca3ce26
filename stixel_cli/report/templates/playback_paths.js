// The data of the page, and SVG paths on the ground in metres.
// report/playback.py joins the files playback_*.js into one function, in the order of SCRIPTS.
const data = JSON.parse(document.getElementById("data").textContent);
const { times } = data;
const LAST = times.length - 1;
const DEPTH_TICKS = [2, 5, 10, 20, 50, 100];
// Reversed viridis in 16 even steps of log(depth), as in pictures/style.py.
const DEPTH_COLOURS = ["fde725", "d8e219", "addc30", "84d44b", "5ec962", "3fbc73", "28ae80",
  "1fa088", "21918c", "26828e", "2c728e", "33638d", "3b528b", "424086", "472d7b", "48186a",
  "440154"].map((hex) => [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16)));
const RUN_COLOURS = 4;
const DASHES = ["", "8 4", "2 3", "9 3 2 3"];

const find = (id) => document.getElementById(id);
const colourOf = (run) => runs.length === 1 ? "var(--estimate)" : `var(--run-${run % RUN_COLOURS})`;
const dashOf = (run) => DASHES[(run + Math.floor(run / RUN_COLOURS)) % DASHES.length];

// A run with several tracks is shown as a run for each of them.
const severalTracks = !data.runs[0].poses;
const runs = data.runs.flatMap((run) => run.poses ? [run] : run.tracks.map((track, number) => {
  const over = (values, missing = null) => times.map((_, k) => values[k - track.first] ?? missing);
  const ordered = Object.entries(track.classes).sort((a, b) => b[1] - a[1]);
  const certain = ordered.length && ordered.slice(1).every(([, p]) => ordered[0][1] >= data.leastOdds * p);
  const nothing = Object.fromEntries(Object.keys(run.errors).map((name) => [name, times.map(() => null)]));
  return {
    ...run, badges: {},
    label: `${data.runs.length > 1 ? `${run.label}: ` : ""}track ${number}, class ${certain ? ordered[0][0] : "unknown"}`,
    name: `track ${number}`,
    poses: over(track.poses), contours: over(track.contours), std: over(track.std),
    used: over(track.used, []),
    centre: times.flatMap((_, k) => [0, 1, 2].map((i) => track.centre[3 * (k - track.first) + i] ?? null)),
    errors: { ...nothing, nis: over(track.nis) },
    nisBounds: track.nisBounds.map((bounds) => over(bounds)),
  };
}));

function svg(name, attributes = {}, parent = null) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (parent) parent.append(element);
  return element;
}

function html(name, options = {}, parent = null) {
  const element = Object.assign(document.createElement(name), options);
  if (parent) parent.append(element);
  return element;
}

function niceStep(least) {
  const power = 10 ** Math.floor(Math.log10(least));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= least * 0.999);
}

function tickText(value, step) {
  return value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
}

function shown(value, digits, unit) {
  if (value === null || value === undefined) return "–";
  const text = Math.abs(value) >= 1e4 ? value.toExponential(1) : value.toFixed(digits);
  return text + unit;
}

// Two significant digits for values far below 1: the NIS of many points would show as 0.00.
function shownSmall(value) {
  return value < 1e-4 ? value.toExponential(0) : value.toPrecision(2);
}

function polygon(flat, close = true) {
  if (!flat || !flat.length) return "";
  let text = "M";
  for (let i = 0; i < flat.length; i += 2) text += `${i ? "L" : ""}${flat[i] / 1e3} ${flat[i + 1] / 1e3}`;
  return text + (close ? "Z" : "");
}

function polyline(poses, stop) {
  let text = "", open = false;
  for (let k = 0; k <= stop; k++) {
    const pose = poses[k];
    if (pose) text += `${open ? "L" : "M"}${pose[0] / 1e3} ${pose[1] / 1e3}`;
    open = Boolean(pose);
  }
  return text;
}

function placed(contour, pose) {
  const angle = pose[2] / 1e4, c = Math.cos(angle), s = Math.sin(angle), flat = [];
  for (let i = 0; i < contour.length; i += 2) {
    flat.push(pose[0] + c * contour[i] - s * contour[i + 1], pose[1] + s * contour[i] + c * contour[i + 1]);
  }
  return flat;
}

// The band of ± 2 standard deviations across the outline, as one area per edge. `std` is along the rays
// from the centre: a normal that is askew to its ray has the smaller share of it. Width and direction are
// those of a longer piece of the outline, so that a mirror does not spread it.
const BAND_REACH = 4;  // points of the outline to both sides, as in pictures/ground.py
function band(contour, std, pose) {
  if (!contour || !std || !pose) return "";
  const count = std.length, side = Math.min(BAND_REACH, Math.floor((count - 1) / 2)), wrapped = (i) => (i + count) % count;
  const at = (i) => contour.slice(2 * wrapped(i), 2 * wrapped(i) + 2);
  const normal = (i, reach) => {
    const [from, to] = [at(i - reach), at(i + reach)], x = to[1] - from[1], y = from[0] - to[0];
    const length = Math.hypot(x, y) || 1e-9;
    return [x / length, y / length];
  };
  const rays = std.map((_, i) => [at(i)[0] - pose[0], at(i)[1] - pose[1]]);
  const widths = std.map((value, i) => {
    const [x, y] = normal(i, 1), radius = Math.hypot(...rays[i]) || 1e-9;
    return 2 * value * Math.max((x * rays[i][0] + y * rays[i][1]) / radius, 0.2);
  });
  const edges = std.map((_, i) => {
    const beside = Array.from({ length: 2 * side + 1 }, (_, j) => widths[wrapped(i + j - side)]);
    const out = beside.sort((a, b) => a - b)[side], inside = Math.min(out, Math.hypot(...rays[i]));
    const [[x, y], [acrossX, acrossY]] = [at(i), normal(i, side)];
    return [[x + out * acrossX, y + out * acrossY], [x - inside * acrossX, y - inside * acrossY]];
  });
  return edges.map(([outer, inner], i) => {
    const [nextOuter, nextInner] = edges[wrapped(i + 1)], corners = [outer, nextOuter, nextInner, inner];
    const area = corners.reduce((sum, [x, y], j) => sum + x * corners[(j + 1) % 4][1] - y * corners[(j + 1) % 4][0], 0);
    // All have one orientation: where they overlap, nothing is left out.
    return polygon((area < 0 ? corners.reverse() : corners).flat());
  }).join("");
}

function ellipse(x, y, major, minor, angle) {
  if (major === null || minor === null || angle === null) return "";
  const a = Math.max(major, 1) / 1e3, b = Math.max(minor, 1) / 1e3;
  const dx = a * Math.cos(angle), dy = a * Math.sin(angle), turn = angle * 180 / Math.PI;
  return `M${x + dx} ${y + dy}A${a} ${b} ${turn} 0 1 ${x - dx} ${y - dy}A${a} ${b} ${turn} 0 1 ${x + dx} ${y + dy}`;
}

function arrow(line, head, pose, reach, scale) {
  if (!pose) { line.setAttribute("d", ""); head.setAttribute("d", ""); return; }
  const x = pose[0] / 1e3, y = pose[1] / 1e3, angle = pose[2] / 1e4;
  const c = Math.cos(angle), s = Math.sin(angle), size = 10 / scale, half = 4 / scale;
  const tipX = x + reach * c, tipY = y + reach * s;
  line.setAttribute("d", `M${x} ${y}L${tipX - size * c} ${tipY - size * s}`);
  head.setAttribute("d", `M${tipX} ${tipY}L${tipX - size * c - half * s} ${tipY - size * s + half * c}` +
    `L${tipX - size * c + half * s} ${tipY - size * s - half * c}Z`);
}
