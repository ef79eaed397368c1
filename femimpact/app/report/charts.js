// Values under the pointer: they are read back from the lines that are drawn.
"use strict";
(function () {
  const GRID = 10000;

  function axis(words) {
    const [low, high, kind] = words.split(" ");
    const ends = [Number(low), Number(high)];
    return kind === "log"
      ? (share) => Math.pow(10, Math.log10(ends[0]) + share * (Math.log10(ends[1]) - Math.log10(ends[0])))
      : (share) => ends[0] + share * (ends[1] - ends[0]);
  }

  function points(path) {
    const found = [];
    for (const [, across, down] of path.getAttribute("d").matchAll(/[ML](-?\d+) (-?\d+)/g)) {
      found.push([Number(across), Number(down)]);
    }
    return found;
  }

  function shown(value) {
    if (value === 0) return "0";
    const size = Math.abs(value);
    return (size >= 1e-3 && size < 1e6 ? Number(value.toPrecision(4)).toString() : value.toExponential(3)).replace("-", "\u2212");
  }

  function nearest(line, at) {
    let best = null;
    let distance = Infinity;
    for (const point of line) {
      const away = Math.abs(point[0] - at);
      if (away < distance) { distance = away; best = point; }
    }
    return best;
  }

  function watch(figure) {
    const plot = figure.querySelector(".fi-plot");
    const toX = axis(figure.dataset.x);
    const toY = axis(figure.dataset.y);
    let lines = null;
    let cursor = null;
    let box = null;

    function end() {
      if (cursor) { cursor.remove(); box.remove(); cursor = box = null; }
    }

    function show(event) {
      const area = plot.getBoundingClientRect();
      const share = (event.clientX - area.left) / area.width;
      if (share < 0 || share > 1) { end(); return; }
      if (!lines) {
        lines = Array.from(plot.querySelectorAll("path[data-name]"), (path) => [path.dataset.name, points(path)]);
        lines = lines.filter(([, line]) => line.length > 0);
      }
      if (!lines.length) return;
      let first = null;
      for (const [, line] of lines) {
        const near = nearest(line, share * GRID);
        if (first === null || Math.abs(near[0] - share * GRID) < Math.abs(first - share * GRID)) first = near[0];
      }
      if (!cursor) {
        cursor = document.createElement("div");
        cursor.className = "fi-cursor";
        box = document.createElement("div");
        box.className = "fi-value";
        plot.append(cursor, box);
      }
      const at = first / GRID;
      cursor.style.left = 100 * at + "%";
      const words = [shown(toX(at))];
      for (const [name, line] of lines) {
        const near = nearest(line, first);
        if (Math.abs(near[0] - first) <= GRID / 50) words.push(name + ": " + shown(toY(1 - near[1] / GRID)));
      }
      box.replaceChildren(...words.slice(0, 9).map((text) => {
        const row = document.createElement("div");
        row.textContent = text;
        return row;
      }));
      box.style.left = at < 0.6 ? "calc(" + 100 * at + "% + .5rem)" : "auto";
      box.style.right = at < 0.6 ? "auto" : "calc(" + 100 * (1 - at) + "% + .5rem)";
    }

    plot.addEventListener("pointermove", show);
    plot.addEventListener("pointerdown", show);
    plot.addEventListener("pointerleave", end);
  }

  document.querySelectorAll("figure.fi-chart").forEach(watch);
})();
