// Tables sort by a column, and are copied as CSV with all digits.
"use strict";
(function () {
  function value(cell) {
    const given = cell.dataset.value;
    return given === undefined ? cell.textContent : given;
  }

  function sort(table, column, heading) {
    const descending = heading.getAttribute("aria-sort") === "ascending";
    table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
    heading.setAttribute("aria-sort", descending ? "descending" : "ascending");
    const body = table.tBodies[0];
    const rows = Array.from(body.rows, (row) => [value(row.cells[column]), row]);
    const numeric = rows.every(([cell]) => cell === "" || !Number.isNaN(Number(cell)));
    rows.sort(([a], [b]) => {
      if (a === "" || b === "") return (a === "") - (b === "");
      const order = numeric ? Number(a) - Number(b) : a < b ? -1 : a > b ? 1 : 0;
      return descending ? -order : order;
    });
    body.append(...rows.map(([, row]) => row));
  }

  function quoted(text) {
    return /[",\n]/.test(text) ? '"' + text.replaceAll('"', '""') + '"' : text;
  }

  function csv(table) {
    const head = Array.from(table.tHead.rows[0].cells, (cell) => quoted(cell.textContent));
    const rows = Array.from(table.tBodies[0].rows, (row) => Array.from(row.cells, (cell) => quoted(value(cell))));
    return [head, ...rows].map((row) => row.join(",")).join("\n") + "\n";
  }

  function copyBySelection(text) {
    const field = document.createElement("textarea");
    field.value = text;
    field.style.position = "fixed";
    field.style.top = "0";
    document.body.append(field);
    field.select();
    const done = document.execCommand("copy");
    field.remove();
    return done;
  }

  async function copy(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch (_) {
      return copyBySelection(text);
    }
  }

  document.querySelectorAll("div.table").forEach((holder) => {
    const table = holder.querySelector("table");
    Array.from(table.tHead.rows[0].cells).forEach((heading, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = heading.textContent;
      button.addEventListener("click", () => sort(table, column, heading));
      heading.replaceChildren(button);
    });
    let below = holder.querySelector(".below");
    if (!below) {
      below = document.createElement("p");
      below.className = "below";
      holder.append(below);
    }
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = "Copy as CSV";
    const said = document.createElement("span");
    said.setAttribute("role", "status");
    button.addEventListener("click", async () => {
      said.textContent = (await copy(csv(table))) ? "copied" : "the browser does not allow it";
    });
    below.append(button, said);
  });
})();
