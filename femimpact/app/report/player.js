// The player: the beam swings, balls meet their walls, and impacts flash.
"use strict";
document.querySelectorAll(".player").forEach(function (root) {
  const data = JSON.parse(root.querySelector("script").textContent);
  const FLASH = 260; // milliseconds of the screen for which an impact is shown
  const frames = data.time.length;
  const stations = data.stations.length;
  const balls = data.contacts.filter((contact) => !contact.stop).length;
  const still = window.matchMedia("(prefers-reduced-motion: reduce)");

  function unpacked(text, unit) {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    const found = new Float64Array(bytes.length / 2);
    for (let i = 0; i < found.length; i += 1) found[i] = unit * view.getInt16(2 * i, true);
    return found;
  }

  const deflection = unpacked(data.deflection, data.unit);
  const slope = unpacked(data.slope, data.slopeUnit);
  const flight = unpacked(data.balls, data.unit);
  const space = unpacked(data.space, data.unit);
  const first = data.time[0];
  const last = data.time[frames - 1];

  const state = { time: first, playing: false, speed: data.speed, scale: data.larger, before: null, flashes: [] };
  const canvases = Array.from(root.querySelectorAll("canvas"));
  const slider = root.querySelector("input[type=range]");
  const output = root.querySelector("output");
  const play = root.querySelector("[data-do=play]");
  const plot = root.querySelector(".timeline .plot");
  const now = document.createElement("div");
  now.className = "now";
  plot.append(now);

  // ---- the state at a time -------------------------------------------------------------------------

  function frameAt(time) {
    let low = 0;
    let high = frames - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (data.time[middle] <= time) low = middle; else high = middle;
    }
    return time >= data.time[high] ? high : low;
  }

  function mixed(values, width, column, at) {
    const one = values[at.frame * width + column];
    return at.share === 0 ? one : one + at.share * (values[(at.frame + 1) * width + column] - one);
  }

  function place(time) {
    const frame = frameAt(time);
    const next = Math.min(frame + 1, frames - 1);
    const span = data.time[next] - data.time[frame];
    return { frame, share: span > 0 ? (time - data.time[frame]) / span : 0 };
  }

  function beamAt(x, at) {
    let k = 0;
    while (k < stations - 2 && data.stations[k + 1] < x) k += 1;
    const h = data.stations[k + 1] - data.stations[k];
    const s = Math.min(Math.max((x - data.stations[k]) / h, 0), 1);
    const w = [0, 1].map((i) => mixed(deflection, stations, k + i, at));
    const d = [0, 1].map((i) => mixed(slope, stations, k + i, at));
    return {
      w: (1 - 3 * s * s + 2 * s ** 3) * w[0] + (s - 2 * s * s + s ** 3) * h * d[0] + (3 * s * s - 2 * s ** 3) * w[1] + (s ** 3 - s * s) * h * d[1],
      slope: ((6 * s * s - 6 * s) / h) * w[0] + (1 - 4 * s + 3 * s * s) * d[0] + ((6 * s - 6 * s * s) / h) * w[1] + (3 * s * s - 2 * s) * d[1],
    };
  }

  function flash(contact, side) {
    const hit = state.flashes.find((one) => one.contact === contact && one.side === side);
    return hit ? (still.matches ? 1 : Math.max(0, 1 - hit.age / FLASH)) : 0;
  }

  // ---- drawing -------------------------------------------------------------------------------------

  function colours() {
    const style = getComputedStyle(document.documentElement);
    const named = {};
    for (const name of ["card", "beam", "box", "floor", "ball", "hit", "solid", "faint", "quiet"]) {
      named[name] = style.getPropertyValue("--" + name).trim();
    }
    return named;
  }

  const reach = (function () {
    let largest = 0;
    for (const w of deflection) largest = Math.max(largest, Math.abs(w));
    return largest;
  })();

  const MARGIN = 0.08;

  // height of the middle of what is shown above the beam's axis, and half of the height that is shown, in metres
  const rise = 0.5 * Math.max(0, ...data.contacts.map((contact) => (contact.stop ? 0 : lift(contact))));
  const high = (function () {
    let most = 1.15 * data.larger * reach + 0.05 * data.length;
    for (const contact of data.contacts) if (!contact.stop) most = Math.max(most, data.larger * (reach + contact.room) + 2.4 * contact.radius + Math.abs(contact.beside[0]));
    for (const block of data.blocks) {
      const top = Math.max(...block.corners[0].map(([, y]) => Math.abs(y)));
      most = Math.max(most, block.x === null ? Math.min(top, 0.25 * data.length) : top + data.larger * reach);
    }
    return 1.05 * most + rise;
  })();

  // ends of what is shown along the beam, in metres
  const [low, far] = (function () {
    const ends = [-MARGIN * data.length, (1 + MARGIN) * data.length];
    for (const block of data.blocks) {
      for (const [x] of block.corners[0]) {
        ends[0] = Math.min(ends[0], (block.x || 0) + x - 0.02 * data.length);
        ends[1] = Math.max(ends[1], (block.x || 0) + x + 0.02 * data.length);
      }
    }
    return ends;
  })();

  function shape() {
    return (2 * high) / (far - low);
  }

  function sizes(canvas) {
    const width = canvas.clientWidth;
    const height = canvas.dataset.view === "beam" ? Math.round(Math.min(Math.max(width * shape(), 150), 400)) : Math.round(Math.min(width, 210));
    const ratio = window.devicePixelRatio || 1;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      canvas.style.height = height + "px";
    }
    return { width, height, ratio };
  }

  function drawBeamView(canvas, at, paint) {
    const { width, height, ratio } = sizes(canvas);
    const pen = canvas.getContext("2d");
    const scale = Math.min(width / (far - low), height / (2 * high));
    const X = (x) => 0.5 * width + scale * (x - 0.5 * (low + far));
    const Y = (y) => 0.5 * height - scale * (y - rise);
    const s = state.scale;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.lineWidth = 1;
    pen.strokeStyle = paint.faint;
    pen.beginPath();
    pen.moveTo(X(0), Y(0));
    pen.lineTo(X(data.length), Y(0));
    pen.stroke();

    for (const block of data.blocks) {
      if (block.x === null) carried(pen, X(0), Y(block.space ? s * mixed(space, 1, 0, at) : 0), 0);
      else onBeam(pen, block.x, at, X, Y);
      drawBlock(pen, block, scale, paint);
      pen.restore();
    }

    // the curve between two stations is the cubic of the finite element
    pen.strokeStyle = paint.beam;
    pen.lineCap = "butt";
    for (let k = 0; k + 1 < stations; k += 1) {
      const [a, b] = [data.stations[k], data.stations[k + 1]];
      const [wa, wb] = [0, 1].map((i) => s * mixed(deflection, stations, k + i, at));
      const [da, db] = [0, 1].map((i) => s * mixed(slope, stations, k + i, at));
      const third = (b - a) / 3;
      pen.lineWidth = Math.max(scale * data.thickness[k], 2.2);
      pen.beginPath();
      pen.moveTo(X(a) - 0.3, Y(wa));
      pen.bezierCurveTo(X(a + third), Y(wa + third * da), X(b - third), Y(wb - third * db), X(b) + 0.3, Y(wb));
      pen.stroke();
    }

    pen.fillStyle = paint.quiet;
    pen.font = "12px system-ui, sans-serif";
    pen.fillText(s === 1 ? "true scale" : "motion and gaps \u00d7 " + s, 10, height - 10);
    let ball = 0;
    data.contacts.forEach((contact, j) => {
      if (contact.stop) return;
      const there = onBeam(pen, contact.x, at, X, Y);
      drawBall(pen, contact, j, s * (mixed(flight, balls, ball, at) - there.w), scale, paint);
      pen.restore();
      ball += 1;
    });
  }

  // until restore() the pen draws from here on, turned by an angle
  function carried(pen, x, y, angle) {
    pen.save();
    pen.translate(x, y);
    pen.rotate(-angle);
  }

  // the same, from a place of the beam on, which it returns
  function onBeam(pen, x, at, X, Y) {
    const there = beamAt(x, at);
    carried(pen, X(x), Y(state.scale * there.w), Math.atan(state.scale * there.slope));
    return there;
  }

  function drawBlock(pen, block, scale, paint) {
    const floor = block.part === "box" && block.side === 0;
    const plain = { support: paint.solid, body: paint.box, box: floor ? paint.floor : paint.box, stop: paint.solid };
    pen.globalAlpha = block.part === "body" ? 0.5 : 1;
    pen.fillStyle = pen.strokeStyle = blend(plain[block.part], paint.hit, block.side ? flash(block.pair, block.side) : 0);
    pen.beginPath();
    for (const [x, y] of block.corners[state.scale === 1 ? 1 : 0]) pen.lineTo(scale * x, -scale * y);
    pen.closePath();
    pen.fill();
    // what is thinner than a pixel is seen
    pen.lineWidth = 1;
    if (block.part !== "body" && !floor) pen.stroke();
    pen.globalAlpha = 1;
  }

  // height above the beam's axis at which an absorber's body rests, so that its spring never closes; 0 of a ball
  function lift(contact) {
    return contact.hung ? contact.foot + data.larger * contact.room + 2 * contact.radius : 0;
  }

  // distance from the axis at which a ball stands that meets others, at the scale that is shown
  function beside(contact) {
    return contact.beside[state.scale === 1 ? 1 : 0];
  }

  function drawBall(pen, contact, j, moved, scale, paint) {
    const lit = Math.max(flash(j, 1), flash(j, -1), flash(j, 0));
    const offset = lift(contact) + beside(contact) + moved;
    if (contact.hung) {
      const turns = 8;
      const end = offset - contact.radius;
      pen.strokeStyle = paint.solid;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.moveTo(0, -scale * contact.foot);
      for (let i = 1; i < turns; i += 1) {
        pen.lineTo((i % 2 ? 0.5 : -0.5) * scale * contact.radius, -scale * (contact.foot + ((i - 0.5) / (turns - 1)) * (end - contact.foot)));
      }
      pen.lineTo(0, -scale * end);
      pen.stroke();
    }
    if (lit > 0 && !still.matches) {
      pen.globalAlpha = 0.35 * lit;
      pen.fillStyle = paint.hit;
      pen.beginPath();
      pen.arc(0, -scale * offset, scale * contact.radius * (1.3 + 0.6 * (1 - lit)), 0, 2 * Math.PI);
      pen.fill();
      pen.globalAlpha = 1;
    }
    pen.fillStyle = blend(paint.ball, paint.hit, lit);
    pen.beginPath();
    pen.arc(0, -scale * offset, Math.max(scale * contact.radius, 2), 0, 2 * Math.PI);
    pen.fill();
  }

  function blend(one, other, share) {
    if (share <= 0) return one;
    if (share >= 1) return other;
    const parts = (colour) => [1, 3, 5].map((i) => parseInt(colour.slice(i, i + 2), 16));
    const [a, b] = [parts(one), parts(other)];
    return "rgb(" + a.map((value, i) => Math.round(value + share * (b[i] - value))).join(",") + ")";
  }

  function drawClose(canvas, number, at, paint) {
    const { width, height, ratio } = sizes(canvas);
    const pen = canvas.getContext("2d");
    let j = -1;
    for (let seen = -1; seen < number; ) {
      j += 1;
      if (!data.contacts[j].stop) seen += 1;
    }
    const contact = data.contacts[j];
    const s = state.scale;
    const hung = contact.hung;
    const high = hung ? 0.5 * (contact.foot + lift(contact) + data.larger * contact.room + 2 * contact.radius) : s * contact.room + 1.55 * contact.radius;
    const scale = Math.min(height / (2 * high), width / (3.4 * contact.radius));
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.translate(0.5 * width, hung ? height - 4 - scale * contact.foot : 0.5 * height + scale * beside(contact));
    if (hung) {
      const there = (block) => block.part === "body" && Math.abs(block.x - contact.x) < 1e-9 * data.length;
      for (const block of data.blocks.filter(there)) drawBlock(pen, block, scale, paint);
      pen.fillStyle = paint.beam;
      const ends = [-contact.x, data.length - contact.x].map((x) => Math.min(Math.max(scale * x, -0.5 * width), 0.5 * width));
      pen.fillRect(ends[0], -1.5, ends[1] - ends[0], 3);
    }
    const place = beamAt(contact.x, at).w;
    // those that it meets are drawn beside it
    const shown = data.contacts.map((one, k) => k).filter((k) => k === j || contact.met.includes(k));
    for (const block of data.blocks) if (shown.includes(block.pair)) drawBlock(pen, block, scale, paint);
    for (const k of shown) drawBall(pen, data.contacts[k], k, s * (mixed(flight, balls, k, at) - place), scale, paint);
  }

  function draw() {
    const at = place(state.time);
    const paint = colours();
    for (const canvas of canvases) {
      if (!canvas.clientWidth) continue;
      if (canvas.dataset.view === "beam") drawBeamView(canvas, at, paint);
      else drawClose(canvas, Number(canvas.dataset.view), at, paint);
    }
    const share = last > first ? (state.time - first) / (last - first) : 0;
    now.style.left = 100 * share + "%";
    const words = "t = " + state.time.toFixed(4) + " s";
    output.textContent = words;
    slider.value = String(at.frame);
    slider.setAttribute("aria-valuetext", words);
  }

  // ---- time ----------------------------------------------------------------------------------------

  function meet(from, to) {
    for (const [frame, contact, side] of data.impacts) {
      const time = data.time[frame];
      const met = from <= to ? time > from && time <= to : time > from || time <= to;
      if (!met) continue;
      state.flashes = state.flashes.filter((one) => one.contact !== contact || one.side !== side);
      state.flashes.push({ contact, side, age: 0 });
    }
  }

  function show(time) {
    state.time = Math.min(Math.max(time, first), last);
    const frame = frameAt(state.time);
    state.flashes = data.impacts.filter((one) => one[0] === frame).map(([, contact, side]) => ({ contact, side, age: 0 }));
    draw();
  }

  function tick(stamp) {
    if (!state.playing) return;
    const passed = state.before === null ? 0 : Math.min(stamp - state.before, 200);
    state.before = stamp;
    for (const one of state.flashes) one.age += passed;
    state.flashes = state.flashes.filter((one) => one.age < FLASH);
    let time = state.time + (passed / 1000) * state.speed;
    if (time > last) time = first + ((time - first) % Math.max(last - first, 1e-12));
    meet(state.time, time);
    state.time = time;
    draw();
    window.requestAnimationFrame(tick);
  }

  function setPlaying(playing) {
    if (playing === state.playing) return;
    state.playing = playing;
    state.before = null;
    play.textContent = playing ? "Pause" : "Play";
    if (playing) window.requestAnimationFrame(tick);
  }

  function step(frame) {
    setPlaying(false);
    show(data.time[Math.min(Math.max(frame, 0), frames - 1)]);
  }

  function impact(direction) {
    const at = frameAt(state.time);
    const others = data.impacts.map((one) => one[0]).filter((frame) => (direction > 0 ? frame > at : frame < at));
    if (others.length) step(direction > 0 ? Math.min(...others) : Math.max(...others));
  }

  // ---- what the reader does ------------------------------------------------------------------------

  let chosen = false;
  const doing = {
    play: () => { chosen = true; setPlaying(!state.playing); },
    before: () => { chosen = true; impact(-1); },
    after: () => { chosen = true; impact(1); },
  };
  root.querySelectorAll("button[data-do]").forEach((button) => button.addEventListener("click", doing[button.dataset.do]));
  slider.addEventListener("input", () => { chosen = true; step(Number(slider.value)); });
  root.querySelector("[data-do=speed]").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
  root.querySelector("[data-do=scale]").addEventListener("change", (event) => { state.scale = Number(event.target.value); draw(); });
  plot.addEventListener("click", (event) => {
    const area = plot.getBoundingClientRect();
    chosen = true;
    setPlaying(false);
    show(first + ((event.clientX - area.left) / area.width) * (last - first));
  });
  // wherever the focus is on the page, while most of the player is in view: keys that a page scrolls with stay
  let inView = false;
  document.addEventListener("keydown", (event) => {
    const focused = event.target instanceof Element ? event.target : document.body;
    // or that has the key for itself: text, and tables that scroll sideways
    const takes = focused.matches("select, textarea, input:not([type=range]), [contenteditable], [tabindex]");
    if ((takes && focused !== root) || event.ctrlKey || event.altKey || event.metaKey || !(inView || root.contains(focused))) return;
    const at = frameAt(state.time);
    const keys = {
      ArrowLeft: () => (event.shiftKey ? impact(-1) : step(at - 1)),
      ArrowRight: () => (event.shiftKey ? impact(1) : step(at + 1)),
      " ": doing.play,
    };
    if (!(event.key in keys) || (event.key === " " && focused.matches("button, a, summary"))) return;
    chosen = true;
    event.preventDefault();
    keys[event.key]();
  });

  if ("IntersectionObserver" in window) {
    // it begins when it is seen, unless the reader wants no motion or has chosen something
    new IntersectionObserver((seen) => {
      const visible = seen.some((entry) => entry.isIntersecting);
      inView = visible;
      if (!chosen && !still.matches) setPlaying(visible);
    }, { threshold: 0.4 }).observe(root.querySelector(".stage"));
  }
  window.addEventListener("resize", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  show(first);
});
