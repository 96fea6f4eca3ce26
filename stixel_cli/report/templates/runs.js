// All runs: a table with chosen columns, filtered by words, sorted and grouped, and a plot of two columns.
{
  const data = JSON.parse(document.querySelector('script[type="application/json"]').textContent);
  const { columns, rows, names, links, errors, axes, options } = data;
  const find = (id) => document.getElementById(id), most = 500;
  const add = (name, options, parent) => parent.appendChild(Object.assign(document.createElement(name), options));
  const words = rows.map((row, i) => [...row.filter((value) => typeof value !== "number" || Number.isInteger(value)), names[i], errors[i]].join(" ").toLowerCase());
  const text = (value) => value === null ? "–" : typeof value === "number" && !Number.isInteger(value) ? String(Number(value.toPrecision(4))) : String(value);
  let sorted = data.sorted ?? -1, falling = sorted >= 0;
  const missing = (value) => value === null || value === "";
  const compare = (a, b) => {
    const x = rows[a][sorted], y = rows[b][sorted];
    if (missing(x) || missing(y)) return missing(x) - missing(y);
    const order = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y), undefined, { numeric: true });
    return falling ? -order : order;
  };
  const chosen = () => {
    const asked = find("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = rows.map((_, i) => i).filter((i) => asked.every((word) => words[i].includes(word)));
    find("count").value = found.length < rows.length ? `${found.length} of ${rows.length}` : `all ${rows.length}`;
    return sorted < 0 ? found : found.sort(compare);
  };
  function table(found) {
    const shown = columns.map((_, i) => i).filter((i) => columns[i].shown), head = find("runs").tHead.rows[0];
    head.replaceChildren();
    add("th", { textContent: data.first }, head);
    for (const i of shown) {
      const cell = add("th", { className: columns[i].number ? "number" : "" }, head);
      if (i === sorted) cell.setAttribute("aria-sort", falling ? "descending" : "ascending");
      add("button", { type: "button", textContent: columns[i].title, title: columns[i].about ?? "" }, cell).onclick = () => { falling = sorted === i && !falling; sorted = i; draw(); };
    }
    for (const body of [...find("runs").tBodies]) body.remove();
    const by = find("group").value, groups = new Map();
    for (const i of found.slice(0, most)) {
      const name = by === "" ? "" : text(rows[i][by]);
      groups.set(name, [...(groups.get(name) ?? []), i]);
    }
    for (const [name, members] of groups) {
      const body = add("tbody", {}, find("runs"));
      if (by !== "") add("td", { colSpan: shown.length + 1, textContent: `${columns[by].title} = ${name} (${members.length})` }, add("tr", { className: "group" }, body));
      for (const i of members) {
        const line = add("tr", { title: errors[i] ?? "" }, body), first = add("td", {}, line);
        if (links[i]) add("a", { href: links[i], textContent: names[i] }, first); else first.textContent = names[i];
        for (const j of shown) add("td", { className: columns[j].number ? "number" : columns[j].wide ? "wide" : "", textContent: text(rows[i][j]) }, line);
      }
    }
    if (found.length > most) add("td", { colSpan: shown.length + 1, textContent: `${found.length - most} more runs: filter to see them` }, add("tr", { className: "group" }, add("tbody", {}, find("runs"))));
  }
  // Round numbers between two ends, four or so.
  function ticks(low, high) {
    const rough = (high - low) / 4, power = 10 ** Math.floor(Math.log10(rough)), step = [1, 2, 5, 10].find((one) => one * power >= rough) * power;
    return Array.from({ length: Math.floor(high / step + 1e-9) - Math.ceil(low / step - 1e-9) + 1 }, (_, i) => Number(((Math.ceil(low / step - 1e-9) + i) * step).toPrecision(6)));
  }
  function plot(found) {
    const x = Number(find("x").value), y = Number(find("y").value), width = Math.min(640, find("plot").clientWidth || 640), margin = 48;
    const known = found.filter((i) => rows[i][x] !== null && rows[i][y] !== null);
    const values = [...new Set(known.map((i) => rows[i][x]))], isNumber = values.every((value) => typeof value === "number" || (value !== "" && !isNaN(value)));
    const place = (i) => isNumber ? Number(rows[i][x]) : values.indexOf(rows[i][x]);
    // Values that are all one are in the middle, within what the metric can have.
    const ends = (values, [least, most] = [null, null]) => {
      const low = Math.min(...values), high = Math.max(...values), room = low < high ? 0.04 * (high - low) : 0.1 * Math.abs(low) || 1;
      return [Math.max(low - room, Math.min(least ?? -Infinity, low)), Math.min(high + room, Math.max(most ?? Infinity, high))];
    };
    const names = isNumber ? [] : values.slice(0, 30).map(text), longest = Math.max(0, ...names.map((name) => name.length));
    // Names that do not fit beside each other are turned.
    const turned = 7 * longest * names.length > width - 2 * margin, foot = turned ? 48 + 5 * Math.min(longest, 28) : margin, height = 252 + foot;
    const [left, right] = ends(known.map(place)), [low, high] = ends(known.map((i) => rows[i][y]), columns[y].bounds);
    const across = (value) => margin + (value - left) / (right - left) * (width - 2 * margin), up = (value) => height - foot + (value - low) / (high - low) * (margin + foot - height);
    const groups = [...new Set(options)], colour = (i) => `var(--run-${groups.length < 2 ? 0 : groups.indexOf(options[i]) % 8})`;
    const svg = (name, options, parent, inside = "") => { const one = parent.appendChild(document.createElementNS("http://www.w3.org/2000/svg", name)); for (const [key, value] of Object.entries(options)) one.setAttribute(key, value); one.textContent = inside; return one; };
    find("plot").replaceChildren();
    if (!known.length) return;
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, style: `max-width: ${width}px`, role: "img", "aria-label": `${columns[y].title} over ${columns[x].title}`, fill: "currentColor", "font-size": 12 }, find("plot"));
    for (const value of ticks(low, high)) {
      svg("line", { x1: margin, x2: width - margin, y1: up(value), y2: up(value), stroke: "var(--line)" }, picture);
      svg("text", { x: margin - 6, y: up(value) + 4, "text-anchor": "end" }, picture, text(value));
    }
    const marks = isNumber ? (left < right && values.length > 1 ? ticks(left, right) : values).map((value) => [Number(value), text(Number(value))]) : names.map((name, i) => [i, name]);
    for (const [value, name] of marks) {
      const look = turned ? { "text-anchor": "end", transform: `rotate(-40 ${across(value)} ${height - foot + 20})` } : { "text-anchor": "middle" };
      svg("text", { x: across(value), y: height - foot + 20, ...look }, picture, name.length > 28 ? `${name.slice(0, 27)}…` : name);
    }
    svg("text", { x: 8, y: 14 }, picture, columns[y].title);
    svg("text", { x: width - 8, y: height - 8, "text-anchor": "end" }, picture, columns[x].title);
    for (const i of known) {
      const parent = links[i] ? svg("a", { href: links[i] }, picture) : picture;
      svg("title", {}, svg("circle", { cx: across(place(i)), cy: up(rows[i][y]), r: 4, fill: colour(i) }, parent), `${data.names[i]}: ${axes.map((_, j) => text(rows[i][j])).join(" ")}`);
    }
    if (groups.length < 2 || groups.length > 8) return;
    const legend = add("p", { className: "note" }, find("plot"));
    for (const group of groups) {
      const mark = add("span", { textContent: "● " }, legend);
      mark.style.color = `var(--run-${groups.indexOf(group)})`;
      legend.append(`${group}   `);
    }
  }
  const draw = () => { const found = chosen(); table(found); plot(found); };
  add("option", { value: "", textContent: "nothing" }, find("group"));
  columns.forEach((column, i) => {
    if (!column.number) add("option", { value: i, textContent: column.title }, find("group"));
    for (const id of column.number ? ["x", "y"] : ["x"]) add("option", { value: i, textContent: column.title }, find(id));
    const label = add("label", {}, find("columns")), box = add("input", { type: "checkbox", checked: column.shown }, label);
    label.append(` ${column.title}${column.about && column.about !== column.title ? `: ${column.about}` : ""}`);
    box.onchange = () => { column.shown = box.checked; draw(); };
  });
  for (const id of ["filter", "group", "x", "y"]) find(id).addEventListener("input", draw);
  // A plot in a closed part has no width.
  find("plot").parentNode.addEventListener("toggle", draw);
  draw();
}
