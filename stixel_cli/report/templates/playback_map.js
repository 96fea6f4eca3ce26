// The scene from above.
const map = find("map");
const extent = data.extent / 1e3;
const view = { mode: "follow", zoom: 1, x: 0, y: 0, width: 1, height: 1 };

// The true pose; the first estimate where the truth is unknown, or else the ego car's pose.
const reference = (k) => data.target[k] || runs.map((run) => run.poses[k]).find(Boolean) || data.ego[k];

const box = (() => {
  const points = data.ego.concat(times.map((_, k) => reference(k))).filter(Boolean);
  const range = (i) => [Math.min(...points.map((p) => p[i])) / 1e3, Math.max(...points.map((p) => p[i])) / 1e3];
  return { x: range(0), y: range(1) };
})();

const estimates = runs.map((run, r) => {
  const colour = colourOf(r), id = (name) => `${name}-${r}`;
  const path = (parent, name, kind, stroke = true) => {
    const element = svg("path", { id: id(name), class: kind }, find(parent));
    element.style[stroke ? "stroke" : "fill"] = colour;
    if (name === "estimate") element.style.strokeDasharray = dashOf(r);
    return element;
  };
  return {
    trail: path("trails", "trail", "trail"),
    band: path("bands", "band", "band", false),
    centre: path("estimates", "centre", "centre"),
    contour: path("estimates", "estimate", "line"),
    heading: path("estimates", "heading", "line"),
    head: path("estimates", "head", "fill", false),
    outside: svg("path", { id: id("outside"), d: "M9 0L-6 7V-7Z" }, find("outside")),
    far: svg("text", { id: id("far") }, find("outside")),
  };
});
const labelBoxes = svg("path", { id: "label-boxes", class: "truth line" }, find("estimates"));
const truthTrail = svg("path", { id: "truth-trail", class: "trail truth" }, find("trails"));
svg("path", { class: "path truth", d: polyline(data.target, LAST) }, find("whole-paths"));

function base() {
  if (view.mode === "follow") {
    const pose = reference(frame) || [0, 0, 0];
    const half = 2.1 * extent + 0.4;
    return { x: pose[0] / 1e3, y: pose[1] / 1e3, scale: Math.min(view.width, view.height) / 2 / half };
  }
  const margin = extent + 1.5, spanX = box.x[1] - box.x[0] + 2 * margin, spanY = box.y[1] - box.y[0] + 2 * margin;
  return {
    x: (box.x[0] + box.x[1]) / 2, y: (box.y[0] + box.y[1]) / 2,
    scale: Math.min(view.width / spanX, view.height / spanY),
  };
}

function camera() {
  const b = base();
  return { x: b.x + view.x, y: b.y + view.y, scale: b.scale * view.zoom };
}

function drawMap() {
  const { x, y, scale } = camera(), k = frame, run = runs[source], scan = data.scans[run.scan];
  const toX = view.width / 2 - x * scale, toY = view.height / 2 + y * scale;
  find("world").setAttribute("transform", `matrix(${scale} 0 0 ${-scale} ${toX} ${toY})`);
  drawGrid(x, y, scale);
  const ego = data.ego[k];
  if (ego) drawEgo(ego, run.fieldOfView, scale, x, y);
  const target = data.target[k];
  const truth = target ? polygon(placed(data.contours[data.limbPoses[k]], target)) : "";
  find("truth").setAttribute("d", truth);
  find("truth-halo").setAttribute("d", truth);
  arrow(find("truth-heading"), find("truth-head"), target, 0.75 * extent, scale);
  truthTrail.setAttribute("d", polyline(data.target, k));
  runs.forEach((one, r) => {
    const parts = estimates[r], pose = one.poses[k], centre = one.centre;
    parts.contour.setAttribute("d", polygon(one.contours[k]));
    parts.band.setAttribute("d", band(one.contours[k], one.std[k], pose));
    parts.trail.setAttribute("d", polyline(one.poses, k));
    const [major, minor, angle] = centre.slice(3 * k, 3 * k + 3);
    parts.centre.setAttribute("d", pose && major !== null
      ? ellipse(pose[0] / 1e3, pose[1] / 1e3, 2 * major, 2 * minor, angle / 1e3) : "");
    arrow(parts.heading, parts.head, pose, 0.75 * extent, scale);
  });
  labelBoxes.setAttribute("d", data.truths.map((one) => polygon(one.boxes[k])).join(""));
  if (severalTracks) drawNames(k, toX, toY, scale);
  drawScan(scan, severalTracks ? runs.flatMap((one) => one.used[k]) : run.used[k], k, run.noise);
  drawOutside(x, y, scale);
}

// The number of each track, and the name of each label, beside it.
function drawNames(k, toX, toY, scale) {
  const name = (x, y, text, colour) => {
    const [u, v] = [toX + x / 1e3 * scale + 8, toY - y / 1e3 * scale - 8];
    if (u > 0 && u < view.width && v > 0 && v < view.height) label(u, v, "start", text).style.fill = colour;
  };
  for (const one of data.truths) if (one.boxes[k]) name(...one.boxes[k].slice(4, 6), `label ${one.name}`, "var(--truth)");
  runs.forEach((run, r) => { if (run.poses[k]) name(...run.poses[k].slice(0, 2), run.name, colourOf(r)); });
}

// For each estimate outside the map: a mark at the edge, and its distance from the target.
function drawOutside(x, y, scale) {
  const target = data.target[frame], halfX = view.width / 2, halfY = view.height / 2;
  runs.forEach((run, r) => {
    const { outside, far } = estimates[r], pose = run.poses[frame];
    const dx = pose ? (pose[0] / 1e3 - x) * scale : 0, dy = pose ? (y - pose[1] / 1e3) * scale : 0;
    const shown = Math.abs(dx) > halfX || Math.abs(dy) > halfY;
    outside.style.display = far.style.display = shown ? "" : "none";
    if (!shown) return;
    // Keep clear of the buttons on the right and of the tick labels.
    const share = Math.min((halfX - 56) / Math.abs(dx), (halfY - 30) / Math.abs(dy));
    const atX = halfX + share * dx, atY = halfY + share * dy;
    const turn = Math.atan2(dy, dx) * 180 / Math.PI;
    outside.setAttribute("transform", `translate(${atX} ${atY}) rotate(${turn})`);
    outside.style.fill = far.style.fill = colourOf(r);
    far.textContent = target
      ? `${(Math.hypot(pose[0] - target[0], pose[1] - target[1]) / 1e3).toFixed(1)} m off` : "";
    // Several marks in one direction are stacked.
    const attributes = { x: atX, y: atY + (dy > 0 ? -12 - 14 * r : 20 + 14 * r), "text-anchor": "middle" };
    for (const [key, value] of Object.entries(attributes)) far.setAttribute(key, value);
  });
}

function drawGrid(x, y, scale) {
  const step = niceStep(70 / scale), labels = find("labels");
  const halfX = view.width / 2 / scale, halfY = view.height / 2 / scale;
  const left = x - halfX, right = x + halfX, low = y - halfY, high = y + halfY;
  let lines = "";
  labels.replaceChildren();
  for (let i = Math.ceil(left / step); i * step <= right; i++) {
    lines += `M${i * step} ${low}V${high}`;
    const at = (i * step - left) * scale;
    if (at > 46 && at < view.width - 54) label(at, view.height - 6, "middle", tickText(i * step, step));
  }
  for (let i = Math.ceil(low / step); i * step <= high; i++) {
    lines += `M${left} ${i * step}H${right}`;
    const at = (high - i * step) * scale;
    if (at > 24 && at < view.height - 20) label(6, at + 4, "start", tickText(i * step, step));
  }
  label(view.width - 6, view.height - 6, "end", "x (m)");
  label(6, 15, "start", "y (m)");
  find("grid").setAttribute("d", lines);
  find("axes").setAttribute("d", `M0 ${low}V${high}M${left} 0H${right}`);
}

function label(x, y, anchor, text) {
  const element = svg("text", { x, y, "text-anchor": anchor }, find("labels"));
  element.textContent = text;
  return element;
}

function drawEgo(ego, fieldOfView, scale, viewX, viewY) {
  const x = ego[0] / 1e3, y = ego[1] / 1e3, angle = ego[2] / 1e4;
  const reach = Math.hypot(viewX - x, viewY - y) + Math.hypot(view.width, view.height) / scale;
  const at = (turn) => `${x + reach * Math.cos(angle + turn)} ${y + reach * Math.sin(angle + turn)}`;
  if (fieldOfView) {
    const [right, left] = fieldOfView;
    let wedge = `M${x} ${y}`;
    for (let i = 0; i <= 16; i++) wedge += `L${at(right + (left - right) * i / 16)}`;
    find("view").setAttribute("d", wedge + "Z");
    find("view-edge").setAttribute("d", `M${at(right)}L${x} ${y}L${at(left)}`);
  }
  const c = Math.cos(angle) * 11 / scale, s = Math.sin(angle) * 11 / scale;
  find("ego").setAttribute("d",
    `M${x + c} ${y + s}L${x - c - 0.7 * s} ${y - s + 0.7 * c}L${x - c + 0.7 * s} ${y - s - 0.7 * c}Z`);
}

// Used points have the R of the tracker, others the covariance that the scan states.
function drawScan(scan, used, k, noise) {
  const points = scan.points[k], ellipses = scan.ellipses && scan.ellipses[k], chosen = new Set(used);
  const own = noise.ellipses && noise.ellipses[k];
  const dots = ["", ""], rings = ["", ""];
  for (let i = 0; 2 * i < points.length; i++) {
    const kind = chosen.has(i) ? 1 : 0, x = points[2 * i] / 1e3, y = points[2 * i + 1] / 1e3;
    dots[kind] += `M${x} ${y}h0`;
    if (kind && (noise.std !== null || own)) {
      const at = 3 * used.indexOf(i);
      rings[1] += own ? ellipse(x, y, own[at], own[at + 1], own[at + 2] === null ? null : own[at + 2] / 1e3)
        : ellipse(x, y, noise.std, noise.std, 0);
    } else if (ellipses) rings[kind] += ellipse(x, y, ellipses[3 * i], ellipses[3 * i + 1],
      ellipses[3 * i + 2] === null ? null : ellipses[3 * i + 2] / 1e3);
  }
  find("points-unused").setAttribute("d", dots[0]);
  find("points-used").setAttribute("d", dots[1]);
  find("ellipses-unused").setAttribute("d", rings[0]);
  find("ellipses-used").setAttribute("d", rings[1]);
  const count = points.length / 2;
  const of = `${count} point${count === 1 ? "" : "s"} in the scan, `;
  find("scan-caption").textContent = (count === 0 ? "Empty scan: the track is a prediction."
    : used.length === 0 ? `${of}0 used: the track is a prediction`
      : `${of}${noise.used ? `${used.length} used by the tracker, ` : ""}drawn with ${noise.text}`) +
    (scan.ellipses ? "" : "; the run has too many points to show their σ");
}

// Zoom by a factor about a fixed point of the map, px.
function zoomAbout(factor, px, py) {
  const before = camera(), zoom = Math.min(60, Math.max(0.02, view.zoom * factor));
  const dx = px - view.width / 2, dy = view.height / 2 - py;
  const after = before.scale * zoom / view.zoom;
  view.x += dx / before.scale - dx / after;
  view.y += dy / before.scale - dy / after;
  view.zoom = zoom;
  drawMap();
}

function resetView(mode = view.mode) {
  Object.assign(view, { mode, zoom: 1, x: 0, y: 0 });
  find("follow").setAttribute("aria-pressed", mode === "follow");
  find("whole").setAttribute("aria-pressed", mode === "whole");
  drawMap();
}

const fingers = new Map();
map.addEventListener("pointerdown", (event) => {
  fingers.set(event.pointerId, [event.offsetX, event.offsetY]);
  map.setPointerCapture(event.pointerId);
  map.classList.add("dragged");
});
map.addEventListener("pointermove", (event) => {
  const before = fingers.get(event.pointerId);
  if (!before) return;
  const now = [event.offsetX, event.offsetY];
  const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
  fingers.set(event.pointerId, now);
  const { scale } = camera();
  if (others.length === 0) {
    view.x -= (now[0] - before[0]) / scale;
    view.y += (now[1] - before[1]) / scale;
    drawMap();
  } else {
    const [other] = others, apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
    zoomAbout(apart(now) / apart(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
  }
});
for (const kind of ["pointerup", "pointercancel"]) {
  map.addEventListener(kind, (event) => {
    fingers.delete(event.pointerId);
    if (!fingers.size) map.classList.remove("dragged");
  });
}
map.addEventListener("wheel", (event) => {
  event.preventDefault();
  zoomAbout(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0016)), event.offsetX, event.offsetY);
}, { passive: false });
map.addEventListener("dblclick", () => resetView());
find("zoom-in").addEventListener("click", () => zoomAbout(1.5, view.width / 2, view.height / 2));
find("zoom-out").addEventListener("click", () => zoomAbout(1 / 1.5, view.width / 2, view.height / 2));
find("zoom-reset").addEventListener("click", () => resetView());
find("follow").addEventListener("click", () => resetView("follow"));
find("whole").addEventListener("click", () => resetView("whole"));
new ResizeObserver(() => {
  ({ width: view.width, height: view.height } = map.getBoundingClientRect());
  // On paper the map has another size, and is scaled.
  map.setAttribute("viewBox", `0 0 ${view.width} ${view.height}`);
  find("frame").setAttribute("width", view.width);
  find("frame").setAttribute("height", view.height);
  drawMap();
}).observe(map);
