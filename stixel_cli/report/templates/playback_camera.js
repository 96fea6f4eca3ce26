// The camera image with the stixels, and the footprints on the road.
// Corners [across m, down m, ahead m] in the camera's frame of points on the road, flat in mm.
function inCamera(flat, ego, rig) {
  const angle = ego[2] / 1e4, c = Math.cos(angle), s = Math.sin(angle), found = [];
  const cosine = Math.cos(rig.pitch), sine = Math.sin(rig.pitch);
  for (let i = 0; i < flat.length; i += 2) {
    const dx = (flat[i] - ego[0]) / 1e3, dy = (flat[i + 1] - ego[1]) / 1e3, ahead = c * dx + s * dy;
    found.push([s * dx - c * dy, cosine * rig.height - sine * ahead, sine * rig.height + cosine * ahead]);
  }
  return found;
}

// The path of an area on the road in the image, without the part nearer than NEAREST.
const NEAREST = 0.3;
function onRoad(flat, ego, rig) {
  if (!flat || !flat.length || !ego) return "";
  const corners = inCamera(flat, ego, rig), kept = [];
  corners.forEach((corner, i) => {
    const last = corners[(i || corners.length) - 1], enters = corner[2] >= NEAREST;
    if (enters !== last[2] >= NEAREST) {
      const share = (NEAREST - last[2]) / (corner[2] - last[2]);
      kept.push(last.map((from, axis) => from + share * (corner[axis] - from)));
    }
    if (enters) kept.push(corner);
  });
  if (!kept.length) return "";
  return `M${kept.map(([x, y, z]) => `${(rig.u0 + rig.focal * x / z).toFixed(1)} ${(rig.v0 + rig.focalV * y / z).toFixed(1)}`).join("L")}Z`;
}

// Whether a point is inside a polygon or nearer to it than `reach`; flat in mm.
function isNear(flat, x, y, reach) {
  let inside = false, least = Infinity;
  for (let i = 0, j = flat.length - 2; i < flat.length; j = i, i += 2) {
    const [ax, ay, bx, by] = [flat[i], flat[i + 1], flat[j], flat[j + 1]], dx = bx - ax, dy = by - ay;
    if (ay > y !== by > y && x < ax + dx * (y - ay) / dy) inside = !inside;
    const share = Math.min(1, Math.max(0, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
    least = Math.min(least, Math.hypot(x - ax - share * dx, y - ay - share * dy));
  }
  return inside || least < reach;
}

// The true contour in the world at scan k, or the first estimate without a truth; flat in mm.
const outline = (k) => data.target[k]
  ? placed(data.contours[data.limbPoses[k]], data.target[k]) : data.known ? null : runs[0].contours[k];

// The place of a stixel on the ground is on the target, or nearer to it than 0.3 m and 3 % of its depth.
function isOnTarget(area, ego, rig, left, right, depth) {
  if (!area || !ego) return false;
  const across = ((left + right - 1) / 2 - rig.u0) / rig.focal * depth, angle = ego[2] / 1e4;
  const c = Math.cos(angle), s = Math.sin(angle);
  return isNear(area, ego[0] + 1e3 * (c * depth + s * across), ego[1] + 1e3 * (s * depth - c * across), 300 + 30 * depth);
}

const halo = svg("path", { class: "foot halo" }, find("footprints"));
const trueFoot = svg("path", { id: "foot-truth", class: "foot truth" }, find("footprints"));
const feet = runs.map((_, r) => {
  const foot = svg("path", { id: `foot-${r}`, class: "foot" }, find("footprints"));
  Object.assign(foot.style, { stroke: colourOf(r), strokeDasharray: dashOf(r) });
  return foot;
});

function depthColour(depth) {
  const low = Math.log(DEPTH_TICKS[0]), high = Math.log(DEPTH_TICKS[DEPTH_TICKS.length - 1]);
  const share = Math.min(1, Math.max(0, (Math.log(Math.max(depth, 1e-3)) - low) / (high - low)));
  const at = share * (DEPTH_COLOURS.length - 1), i = Math.min(Math.floor(at), DEPTH_COLOURS.length - 2);
  return DEPTH_COLOURS[i].map((from, c) => Math.round(from + (at - i) * (DEPTH_COLOURS[i + 1][c] - from)));
}

// Outlines of stixels [left, right, top, base] that are next to each other, as one path.
function outlineOf(stixels) {
  const groups = [];
  for (const stixel of [...stixels].sort((a, b) => a[0] - b[0])) {
    const last = groups.at(-1);
    if (last && stixel[0] <= last.at(-1)[1] + 1) last.push(stixel);
    else groups.push([stixel]);
  }
  return groups.map((group) => {
    const above = group.map(([left, right, top]) => `${left - 0.5} ${top - 0.5}L${right - 0.5} ${top - 0.5}`);
    const below = group.reverse().map(([left, right, , base]) => `${right - 0.5} ${base + 0.5}L${left - 0.5} ${base + 0.5}`);
    return `M${[...above, ...below].join("L")}Z`;
  }).join("");
}

const rectangles = [];
// The outlines of boxes, flat [left, right, top, base].
function boxOutlines(flat) {
  let found = "";
  for (let i = 0; i < flat.length; i += 4)
    found += `M${flat[i] - 0.5} ${flat[i + 2] - 0.5}H${flat[i + 1] - 0.5}V${flat[i + 3] + 0.5}H${flat[i] - 0.5}Z`;
  return found;
}

const objectOutlines = svg("path", { id: "object-outlines" });
const targetOutline = svg("path", { id: "target-outline" });
let imageShown = null;
// What is in place of the image, and what its colours mean.
const VIEWS = {
  grey: ["Image of the left camera", ""],
  disparity: ["Disparity", "disparity, in the colour of the depth that it means; grey: none"],
  grid: ["Occupancy grid", "occupancy grid over columns and depth, near below: dark is occupied, green the end of the free space"],
  free_space: ["Free space", "free space green, unknown violet"],
};
function drawCamera() {
  const run = runs[source], shots = run.camera === null ? null : data.cameras[run.camera];
  find("image").hidden = find("depth-scale").hidden = shots === null;
  find("no-camera").hidden = shots !== null;
  find("view-choice").hidden = find("stixels-choice").hidden = shots === null;
  find("stixels").style.display = shots && find("stixels-shown").checked ? "" : "none";
  find("footprints").style.display = shots ? "" : "none";
  if (shots === null) {
    const measurement = (run.facts.find(([name]) => name === "measurement") || ["", "of this run"])[1];
    find("no-camera").textContent = `No camera image: the measurement "${measurement}" uses no camera.`;
    find("camera-caption").textContent = "";
    imageShown = null;
    return;
  }
  const view = find("camera-view").value, [title, meaning] = VIEWS[view], isGrid = view === "grid";
  const i = Math.min(Math.floor(frame / shots.every), shots.frames.length - 1), name = `${run.camera}-${i}-${view}`;
  if (imageShown === name) return;
  imageShown = name;
  find("image").src = `data:image/jpeg;base64,${shots.images[view][i]}`;
  find("image").alt = `${title} at k = ${shots.frames[i]}`;
  // The grid is no image of the camera: nothing lies over it.
  find("image").style.aspectRatio = `${shots.width} / ${shots.height}`;
  find("stixels").style.visibility = find("footprints").style.visibility = isGrid ? "hidden" : "";
  const overlay = find("stixels"), flat = shots.stixels[i], count = flat.length / 5;
  const k = shots.frames[i], ego = data.ego[k], area = outline(k), rig = run.rig;
  for (const one of [overlay, find("footprints")]) one.setAttribute("viewBox", `-0.5 -0.5 ${shots.width} ${shots.height}`);
  for (const one of [halo, trueFoot]) one.setAttribute("d", (data.target[k] ? onRoad(area, ego, rig) : "") +
    data.truths.map((label) => onRoad(label.boxes[k], ego, rig)).join(""));
  runs.forEach((other, r) => feet[r].setAttribute("d", onRoad(other.contours[k], ego, rig)));
  const onTarget = [], areas = severalTracks ? runs.map((one) => one.contours[k]) : [area];
  while (rectangles.length < count) rectangles.push(svg("rect", {}, overlay));
  rectangles.forEach((rectangle, j) => {
    rectangle.style.display = j < count ? "" : "none";
    if (j >= count) return;
    const [left, right, top, bottom, depth] = flat.slice(5 * j, 5 * j + 5);
    const colour = depthColour(depth / 100), on = areas.some((one) => isOnTarget(one, ego, rig, left, right, depth / 100));
    if (on) onTarget.push([left, right, top, bottom]);
    const place = { x: left - 0.5, y: top - 0.5, width: right - left, height: bottom - top + 1,
      fill: `rgb(${colour})`, "fill-opacity": on ? 0.5 : 0.14 };
    for (const [key, value] of Object.entries(place)) rectangle.setAttribute(key, value);
  });
  overlay.append(objectOutlines, targetOutline);
  objectOutlines.setAttribute("d", run.boxes ? boxOutlines(run.boxes[k]) : "");
  targetOutline.setAttribute("d", outlineOf(onTarget));
  zoomImage(shots, onTarget, area, ego, rig);
  const ofStixels = `${count} stixel${count === 1 ? "" : "s"}, coloured by depth; ${onTarget.length} on the target, outlined`;
  find("camera-caption").textContent = (isGrid ? meaning : meaning ? `${meaning}; ${ofStixels}` : ofStixels) +
    (shots.every > 1 ? `; image of k = ${shots.frames[i]}: this page shows every ${ordinal(shots.every)} image` : "");
}

// Show the whole image, or the target over half of it: its stixels, or else its place on the road.
let isZoomed = false;
function zoomImage(shots, onTarget, area, ego, rig) {
  const seen = area && ego ? inCamera(area, ego, rig).filter((corner) => corner[2] >= NEAREST) : [];
  const places = onTarget.length ? onTarget.flatMap(([left, right, top, base]) => [[left, top], [right, base]])
    : seen.map(([x, y, z]) => [rig.u0 + rig.focal * x / z, rig.v0 + rig.focalV * y / z]);
  find("lens").style.cssText = "";
  if (!isZoomed || !places.length || find("camera-view").value === "grid") return;
  const { width, height } = shots, ends = (axis, side) => Math[side](...places.map((place) => place[axis]));
  const [left, right, top, base] = [ends(0, "min"), ends(0, "max"), ends(1, "min"), ends(1, "max")];
  const scale = Math.min(8, Math.max(1, Math.min(width / (right - left + 1) / 2, height / (base - top + 1) / 2)));
  // The image fills its frame at any zoom.
  const shift = (middle, size) => Math.min(0, Math.max(1 - scale, 0.5 - scale * middle / size)) * 100;
  find("lens").style.setProperty("--zoom", scale);  // lines keep their width
  find("lens").style.transform = `translate(${shift((left + right) / 2, width)}%, ${shift((top + base) / 2, height)}%) scale(${scale})`;
}

find("image-zoom").addEventListener("click", () => {
  isZoomed = !isZoomed;
  find("image-zoom").setAttribute("aria-pressed", isZoomed);
  imageShown = null;
  drawCamera();
});

function ordinal(n) {
  return n % 100 > 10 && n % 100 < 14 ? `${n}th` : `${n}${["th", "st", "nd", "rd"][n % 10] || "th"}`;
}

find("depth-scale").style.background =
  `linear-gradient(to right, ${DEPTH_COLOURS.map((c) => `rgb(${c})`).join(",")})`;
DEPTH_TICKS.forEach((depth, i) => {
  const share = Math.log(depth / DEPTH_TICKS[0]) / Math.log(DEPTH_TICKS.at(-1) / DEPTH_TICKS[0]);
  const sign = i === 0 ? "≤ " : i === DEPTH_TICKS.length - 1 ? "≥ " : "";
  html("span", { textContent: `${sign}${depth} m` }, find("depth-scale")).style.left = `${100 * share}%`;
});
// Images of a road scene are wide, and get the whole width.
function setWide(isWide) {
  document.querySelector("main").classList.toggle("wide", isWide);
  find("image-wide").setAttribute("aria-pressed", isWide);
}
setWide(data.cameras.some(({ width, height }) => width > 2 * height));
find("image-wide").addEventListener("click", () => setWide(find("image-wide").getAttribute("aria-pressed") === "false"));
document.querySelector("main").classList.toggle("blind", data.cameras.length === 0);
// A run from a file has no measurement by a sensor of stixel: nothing is said of cameras.
const isOfSensor = runs.some((run) => run.facts.some(([name]) => name === "measurement"));
if (!data.cameras.length && isOfSensor) {
  find("no-camera").className = "note";
  find("notes").append(find("no-camera"));
}
find("stixels-shown").addEventListener("change", drawCamera);
find("camera-view").addEventListener("change", drawCamera);
find("source").addEventListener("change", (event) => {
  source = Number(event.target.value);
  drawMap();
  drawCamera();
  const points = charts.find((chart) => chart.name === "points");
  drawChart(points);
  drawCursor(points);
});
