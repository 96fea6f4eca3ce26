// The description of the runs, and the legend.
function swatch(parent, draw) {
  const picture = svg("svg", { class: "swatch", viewBox: "0 0 32 12", "aria-hidden": "true" }, parent);
  draw(picture);
}

function lineSwatch(colour, dash = "", width = 2.5) {
  return (picture) => {
    const line = svg("line", { x1: 0, x2: 32, y1: 6, y2: 6 }, picture);
    Object.assign(line.style, { stroke: colour, strokeWidth: width, strokeDasharray: dash });
  };
}

function describe() {
  for (const note of data.notes) html("p", { className: "note", textContent: note }, find("notes"));
  const whole = severalTracks ? data.runs : runs;
  const inAll = ([name, value]) => whole.every((run) => run.facts.some((f) => f[0] === name && f[1] === value));
  const facts = (line, pairs) => {
    for (const [name, value] of pairs) {
      html("strong", { textContent: value }, html("span", { textContent: `${name} ` }, line));
    }
  };
  if (whole.length > 1) facts(html("div", { className: "run" }, find("runs")), runs[0].facts.filter(inAll));
  if (whole.length === 1) describeOne(whole[0], facts);
  else whole.forEach((run, r) => {
    const line = html("div", { className: "run" }, find("runs"));
    const name = html("span", { className: "name" }, line);
    if (!severalTracks) swatch(name, lineSwatch(colourOf(r), dashOf(r)));
    name.append(run.label);
    const shownAbove = ([name, value]) => inAll([name, value]) || name === "folder" && value === run.label;
    facts(line, run.facts.filter((fact) => !shownAbove(fact)));
    facts(line, run.summary.slice(0, 4));
    html("span", { textContent: run.verdict.join(" ") }, line);
    describeLabels(run.labels);
    html("option", { value: r, textContent: run.label }, find("source"));
  });
  find("source-choice").hidden = whole.length === 1;
  const area = (colour, opacity) => (picture) => {
    const place = svg("rect", { x: 0, y: 0, width: 32, height: 12, rx: 2 }, picture);
    Object.assign(place.style, { fill: colour, fillOpacity: opacity });
  };
  const dot = (colour) => (picture) => {
    svg("circle", { cx: 16, cy: 6, r: 4 }, picture).style.fill = colour;
    const ring = svg("ellipse", { cx: 16, cy: 6, rx: 14, ry: 5.5, fill: "none" }, picture);
    Object.assign(ring.style, { stroke: colour, strokeOpacity: 0.5 });
  };
  const entries = data.known ? [[lineSwatch("var(--truth)"), "truth: contour, heading, path"]] : [];
  runs.forEach((run, r) => entries.push(
    [lineSwatch(colourOf(r), dashOf(r)), runs.length === 1 && !severalTracks ? "estimate: contour, heading, path" : run.label]));
  entries.push(
    [area(runs.length === 1 ? "var(--estimate)" : "var(--faint)", 0.25), "± 2σ of the contour"],
    [lineSwatch(runs.length === 1 ? "var(--estimate)" : "var(--faint)", "4 3", 1.5), "2σ ellipse of the centre"],
    [dot("var(--used)"), runs.every((run) => run.noise.known) ? "used point; ring: the noise R that the tracker assumes, 1σ" : runs.some((run) => run.noise.used) ? "used point; ring: 1σ" : "point; ring: the scan's 1σ"],
    ...(runs.some((run) => run.noise.used) ? [[dot("var(--unused)"), "unused point; ring: the scan's 1σ"]] : []),
    [(picture) => { svg("path", { d: "M16 0 22 12H10Z" }, picture).style.fill = "var(--ego)"; }, "ego car's sensor"],
    ...(runs.some((run) => run.fieldOfView) ? [[area("var(--field-of-view)", 0.35), "field of view"]] : []),
    [area("var(--consistent)", 1), `${data.series.filter((one) => BOUNDS[one.name]).map((one) => one.name === "nis" ? "NIS" : "NEES").join(", ")}: 95 % interval of a consistent filter`],
    ...(data.known ? [[lineSwatch("var(--unused)", "4 3", 1.5), `low overlap: IoU < ${data.lowOverlap}`]] : []),
    [lineSwatch("var(--unused)", "", 3), data.scans.length === 1 ? "points in the scan" : "points in the scan of the chosen run"]);
  if (data.cameras.length) entries.push(
    [(picture) => { svg("rect", { x: 11, y: 1, width: 10, height: 10, class: "outlined" }, picture); }, "stixel on the target"]);
  if (data.truths.length) entries.push([lineSwatch("var(--truth)"), "label of the recording"]);
  if (runs.some((run) => run.boxes)) entries.push(
    [(picture) => { svg("rect", { x: 6, y: 1, width: 20, height: 10, class: "object" }, picture); }, "object: stixels near each other"]);
  for (const [draw, text] of entries) {
    const item = html("li", {}, find("legend"));
    swatch(item, draw);
    item.append(text);
  }
}

// The header of one run: its verdict, its main numbers beside their references, and the rest folded.
function describeOne(run, facts) {
  const [first, ...others] = run.verdict;
  // A verdict that begins with its word has that word's colour.
  html("p", { className: `verdict ${first.split(/\W/)[0].toLowerCase()}`, textContent: first }, find("runs"));
  if (others.length) html("p", { className: "note", textContent: others.join(" ") }, find("runs"));
  const tiles = html("div", { className: "tiles" }, find("runs"));
  for (const [name, value, reference] of run.headline) {
    const tile = html("div", { className: "tile" }, tiles);
    html("span", { textContent: name }, tile);
    html("strong", { textContent: value }, tile);
    html("span", { textContent: reference }, tile);
  }
  describeLabels(run.labels);
  const part = html("details", { className: "folded" }, find("runs"));
  html("summary", { textContent: "Settings and other scores" }, part);
  facts(html("div", { className: "run" }, part), run.facts);
  facts(html("div", { className: "run" }, part), run.summary);
}

// The scores of the tracks of moving objects, one row per label.
function describeLabels([columns, ...rows]) {
  if (!rows.length) return;
  const part = html("details", { className: "labels", open: true }, find("runs"));
  html("summary", { textContent: "Labels that move or are tracked" }, part);
  const table = html("table", {}, html("div", { className: "wide" }, part));
  const head = html("tr", {}, table);
  for (const name of columns) html("th", { textContent: name }, head);
  for (const row of rows) {
    const line = html("tr", {}, table);
    for (const cell of row) html("td", { textContent: cell }, line);
  }
}

// Where the page comes from: command, revision, key numbers, and links to the files of the run.
function describeOrigin() {
  data.runs.forEach((run) => {
    const { origin } = run;
    if (!origin) return;
    const part = html("div", { className: "origin" }, find("origin"));
    const line = html("p", {}, part);
    if (data.runs.length > 1) html("strong", { textContent: `${run.label}: ` }, line);
    html("code", { textContent: origin.command }, line);
    html("p", { textContent: origin.made.join(" · ") }, part);
    if (origin.correction) html("p", { textContent: origin.correction }, part);
    if (origin.rigError) {
      const alt = "Disparity error of the rig, and of depths";
      html("img", { src: `data:image/png;base64,${origin.rigError}`, alt }, html("p", {}, part));
    }
    const links = html("p", {}, part);
    for (const [name, place] of origin.links) html("a", { href: place, textContent: name }, links);
  });
}
