// The camera image with the stixels.
function depthColour(depth) {
  const low = Math.log(DEPTH_TICKS[0]), high = Math.log(DEPTH_TICKS[DEPTH_TICKS.length - 1]);
  const share = Math.min(1, Math.max(0, (Math.log(Math.max(depth, 1e-3)) - low) / (high - low)));
  const at = share * (DEPTH_COLOURS.length - 1), i = Math.min(Math.floor(at), DEPTH_COLOURS.length - 2);
  return DEPTH_COLOURS[i].map((from, c) => Math.round(from + (at - i) * (DEPTH_COLOURS[i + 1][c] - from)));
}

const rectangles = [];
let imageShown = null;
function drawCamera() {
  const run = runs[source], shots = run.camera === null ? null : data.cameras[run.camera];
  find("image").hidden = find("depth-scale").hidden = shots === null;
  find("no-camera").hidden = shots !== null;
  find("stixels-choice").hidden = shots === null;
  find("stixels").style.display = shots && find("stixels-shown").checked ? "" : "none";
  if (shots === null) {
    const measurement = (run.facts.find(([name]) => name === "measurement") || ["", "of this run"])[1];
    find("no-camera").textContent = `No camera image: the measurement "${measurement}" uses no camera.`;
    find("camera-caption").textContent = "";
    imageShown = null;
    return;
  }
  const i = Math.min(Math.floor(frame / shots.every), shots.frames.length - 1), name = `${run.camera}-${i}`;
  if (imageShown === name) return;
  imageShown = name;
  find("image").src = `data:image/jpeg;base64,${shots.images[i]}`;
  find("image").alt = `Image of the left camera at k = ${shots.frames[i]}`;
  const overlay = find("stixels"), flat = shots.stixels[i], count = flat.length / 5;
  overlay.setAttribute("viewBox", `-0.5 -0.5 ${shots.width} ${shots.height}`);
  while (rectangles.length < count) rectangles.push(svg("rect", {}, overlay));
  rectangles.forEach((rectangle, j) => {
    rectangle.style.display = j < count ? "" : "none";
    if (j >= count) return;
    const [left, right, top, bottom, depth] = flat.slice(5 * j, 5 * j + 5);
    const colour = depthColour(depth / 100);
    const place = { x: left - 0.5, y: top - 0.5, width: right - left, height: bottom - top + 1,
      fill: `rgb(${colour})`, "fill-opacity": 0.55, stroke: `rgb(${colour.map((c) => Math.round(0.75 * c))})`,
      "stroke-width": 0.6, "stroke-opacity": 0.8 };
    for (const [key, value] of Object.entries(place)) rectangle.setAttribute(key, value);
  });
  find("camera-caption").textContent = `${count} stixel${count === 1 ? "" : "s"}, coloured by depth` +
    (shots.every > 1 ? `; image of k = ${shots.frames[i]}: this page shows every ${ordinal(shots.every)} image` : "");
}

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
document.querySelector("main").classList.toggle("blind", data.cameras.length === 0);
find("stixels-shown").addEventListener("change", drawCamera);
find("source").addEventListener("change", (event) => {
  source = Number(event.target.value);
  drawMap();
  drawCamera();
  const points = charts.find((chart) => chart.name === "points");
  drawChart(points);
  drawCursor(points);
});
