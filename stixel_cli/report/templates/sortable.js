// Tables that are sorted by a click on a head, filtered by words, and grouped by a column.
for (const table of document.querySelectorAll("table")) {
  const input = document.querySelector(`input[data-table="${table.id}"]`);
  if (!input) continue;
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  for (const head of heads) head.innerHTML = `<button type="button">${head.innerHTML}</button>`;
  const rows = [...body.rows], value = (row, column) => row.cells[column].dataset.value;
  const group = document.querySelector(`select[data-group="${table.id}"]`);
  let sorted = -1, falling = false;
  const compare = (a, b, column) => {
    const x = value(a, column), y = value(b, column);
    // A missing value is last in both directions.
    if (x === "" || y === "") return (x === "") - (y === "");
    const both = isNaN(x) || isNaN(y) ? x.localeCompare(y) : x - y;
    return falling ? -both : both;
  };
  const update = () => {
    const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
    const by = group ? group.value : "", names = [...new Set(by && rows.map((row) => value(row, by)))];
    const order = sorted < 0 ? rows : [...rows].sort((a, b) => compare(a, b, sorted));
    for (const row of rows) {
      const text = [...row.querySelectorAll("td:not(.number)")].map((cell) => cell.textContent).join(" ").toLowerCase();
      row.hidden = !words.every((word) => text.includes(word));
    }
    body.replaceChildren(...(by ? names.flatMap((name) => {
      const own = order.filter((row) => value(row, by) === name);
      const head = document.createElement("tr"), cell = head.insertCell();
      head.className = "group";
      cell.colSpan = heads.length;
      cell.textContent = `${heads[by].innerText.trim()} = ${name}`;
      head.hidden = own.every((row) => row.hidden);
      return [head, ...own];
    }) : order));
    const shown = rows.filter((row) => !row.hidden).length;
    input.nextElementSibling.value = words.length ? `${shown} of ${rows.length} rows` : "";
  };
  heads.forEach((head, column) => head.firstElementChild.addEventListener("click", () => {
    falling = sorted === column && !falling;
    sorted = column;
    heads.forEach((other) => other.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", falling ? "descending" : "ascending");
    update();
  }));
  input.addEventListener("input", update);
  if (group) group.addEventListener("change", update);
}
