"use strict";
// Sorts tables, draws charts as SVG and pairs on canvas. Text reaches the page by textContent alone.

const data = JSON.parse(document.getElementById("data").textContent);
const SVG = "http://www.w3.org/2000/svg";
const dark = matchMedia("(prefers-color-scheme: dark)");

// Okabe and Ito's palette, for a light and a dark ground; dashes and marks tell methods apart in grey too.
const LIGHT = ["#0068b2", "#c25e00", "#00795a", "#b0508a", "#3a3a3a", "#2f8fc4", "#8a6d00"];
const DARK = ["#56a9ea", "#f0a030", "#35c49a", "#e08fc0", "#d8d8d8", "#9fd4f5", "#e6d35a"];
const DASHES = ["", "6 3", "2 2", "8 3 2 3"];
const MARKS = ["circle", "square", "triangle", "diamond", "cross"];
const hidden = new Set();
const redraws = [];

function styleOf(method) {
  const index = Math.max(0, data.methods.indexOf(method));
  const palette = dark.matches ? DARK : LIGHT;
  return {
    colour: palette[index % palette.length],
    dash: DASHES[index % DASHES.length],
    mark: MARKS[index % MARKS.length],
  };
}

function element(name, attributes, ...children) {
  return fill(document.createElement(name), attributes, children);
}

function svg(name, attributes, ...children) {
  return fill(document.createElementNS(SVG, name), attributes, children);
}

function fill(node, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) {
    if (key.startsWith("on")) node.addEventListener(key.slice(2), value);
    else if (value !== null && value !== undefined) node.setAttribute(key, value);
  }
  node.append(...children);
  return node;
}

const short = (value) => (value === null || value === undefined ? "-" : String(Number(value.toPrecision(4))));

/* Tables */

function sortable(table) {
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    head.querySelector("button").addEventListener("click", () => {
      const ascending = head.getAttribute("aria-sort") !== "ascending";
      for (const other of heads) other.setAttribute("aria-sort", "none");
      head.setAttribute("aria-sort", ascending ? "ascending" : "descending");
      // Methods, published figures and sentinels stay apart: each block is sorted within itself.
      for (const body of table.tBodies) sortRows(body, column, ascending);
    });
  });
}

function sortRows(body, column, ascending) {
  const keyed = [...body.rows].map((row) => {
    const cell = row.cells[column];
    const isText = cell.classList.contains("text") || cell.tagName === "TH";
    return { row, key: isText ? cell.textContent : "value" in cell.dataset ? Number(cell.dataset.value) : null };
  });
  keyed.sort((a, b) => {
    if (a.key === null || b.key === null) return (a.key === null) - (b.key === null); // what has no figure stays below
    const order = typeof a.key === "number" ? a.key - b.key : a.key.localeCompare(b.key, "en", { numeric: true });
    return ascending ? order : -order;
  });
  body.append(...keyed.map(({ row }) => row));
}

/* Charts */

const WIDTH = 380, HEIGHT = 250, LEFT = 46, RIGHT = 10, TOP = 8, BOTTOM = 38;

function linear(low, high) {
  const step = niceStep((high - low) / 5);
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-6; i++) ticks.push(i * step);
  return { at: (value) => (value - low) / (high - low), value: (share) => low + share * (high - low), ticks };
}

function niceStep(rough) {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * [1, 2, 5, 10].find((factor) => factor * power >= rough * 0.999);
}

function logarithmic(low, high) {
  const first = Math.floor(Math.log10(low) + 1e-9), last = Math.max(first + 1, Math.ceil(Math.log10(high) - 1e-9));
  const every = Math.max(1, Math.ceil((last - first) / 6));
  const ticks = [];
  for (let power = first; power <= last; power += every) ticks.push(10 ** power);
  return {
    at: (value) => (Math.log10(Math.max(value, 10 ** first)) - first) / (last - first),
    value: (share) => 10 ** (first + share * (last - first)),
    ticks,
  };
}

function frame(x, y, xName, yName, label, yTicks = true) {
  const across = (value) => LEFT + Math.min(1, Math.max(0, x.at(value))) * (WIDTH - LEFT - RIGHT);
  const down = (value) => HEIGHT - BOTTOM - Math.min(1, Math.max(0, y.at(value))) * (HEIGHT - TOP - BOTTOM);
  const picture = svg("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": label });
  for (const tick of x.ticks) {
    const place = across(tick);
    picture.append(
      svg("path", { class: "axis", d: `M${place} ${TOP}V${HEIGHT - BOTTOM}` }),
      svg("text", { x: place, y: HEIGHT - BOTTOM + 14, "text-anchor": "middle" }, tickWords(tick)),
    );
  }
  for (const tick of yTicks ? y.ticks : []) {
    const place = down(tick);
    picture.append(
      svg("path", { class: "axis", d: `M${LEFT} ${place}H${WIDTH - RIGHT}` }),
      svg("text", { x: LEFT - 5, y: place + 4, "text-anchor": "end" }, tickWords(tick)),
    );
  }
  picture.append(
    svg("text", { x: (LEFT + WIDTH - RIGHT) / 2, y: HEIGHT - 6, "text-anchor": "middle" }, xName),
    svg("text", { transform: `translate(11 ${(TOP + HEIGHT - BOTTOM) / 2}) rotate(-90)`, "text-anchor": "middle" }, yName),
  );
  return { picture, across, down, x };
}

function tickWords(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(0).replace("e+", "e");
  return short(value);
}

function mark(kind, x, y, size, attributes) {
  const s = size;
  const shapes = {
    circle: `M${x - s} ${y}a${s} ${s} 0 1 0 ${2 * s} 0a${s} ${s} 0 1 0 ${-2 * s} 0`,
    square: `M${x - s} ${y - s}h${2 * s}v${2 * s}h${-2 * s}z`,
    triangle: `M${x} ${y - s * 1.2}l${s * 1.2} ${s * 2.1}h${-s * 2.4}z`,
    diamond: `M${x} ${y - s * 1.4}l${s * 1.4} ${s * 1.4}l${-s * 1.4} ${s * 1.4}l${-s * 1.4} ${-s * 1.4}z`,
    cross: `M${x - s} ${y - s}l${2 * s} ${2 * s}M${x + s} ${y - s}l${-2 * s} ${2 * s}`,
  };
  return svg("path", { d: shapes[kind], ...attributes });
}

function curveChart(title, xName, yName, x, curves, digitsOfX) {
  // curves: [{name, xs, ys}], steps: y holds from its x on.
  const readout = element("output", { class: "readout" });
  const figure = element("figure", {}, element("figcaption", {}, title));
  const words = curves.map((curve) => `${curve.name} ${short(valueAt(curve, x.value(1 / 3)))}`).join(", ");
  const { picture, across, down } = frame(
    x, linear(0, 1), xName, yName, `${title}. At ${short(x.value(1 / 3))}: ${words}.`,
  );
  for (const curve of curves) {
    if (hidden.has(curve.name) || !curve.xs.length || curve.ys[0] === null) continue;
    const style = styleOf(curve.name);
    let path = `M${across(curve.xs[0])} ${down(curve.from0 ? 0 : curve.ys[0])}`;
    curve.xs.forEach((value, i) => (path += `H${across(value).toFixed(1)}V${down(curve.ys[i]).toFixed(1)}`));
    path += `H${WIDTH - RIGHT}`;
    picture.append(
      svg("path", { d: path, fill: "none", stroke: style.colour, "stroke-width": 2, "stroke-dasharray": style.dash },
        svg("title", {}, curve.name)),
    );
  }
  const cursor = svg("path", { class: "cursor", d: "" });
  picture.append(cursor);
  picture.addEventListener("pointermove", (event) => {
    const box = picture.getBoundingClientRect();
    const share = (((event.clientX - box.left) / box.width) * WIDTH - LEFT) / (WIDTH - LEFT - RIGHT);
    if (share < 0 || share > 1) return;
    const value = x.value(share);
    cursor.setAttribute("d", `M${across(value)} ${TOP}V${HEIGHT - BOTTOM}`);
    const parts = curves.filter((curve) => !hidden.has(curve.name));
    readout.textContent = `${short(Number(value.toPrecision(digitsOfX)))}: ` +
      parts.map((curve) => `${curve.name} ${short(valueAt(curve, value))}`).join(", ");
  });
  figure.append(picture, readout);
  return figure;
}

function valueAt(curve, x) {
  let found = curve.from0 ? 0 : curve.ys[0];
  for (let i = 0; i < curve.xs.length && curve.xs[i] <= x; i++) found = curve.ys[i];
  return found === undefined ? null : found;
}

function planeChart(plane) {
  const points = plane.points.filter((point) => !hidden.has(point.name) && point.value !== null && point.time_ms > 0);
  const title = `Accuracy against time: ${plane.name}`;
  const figure = element("figure", {}, element("figcaption", {}, title));
  if (!points.length) return fill(figure, {}, ["Nothing was timed."]);
  const times = points.map((point) => point.time_ms), values = points.map((point) => point.value);
  const least = Math.min(...values), most = Math.max(...values);
  const positive = values.filter((value) => value > 0);
  // Errors span decades: they stand on a logarithmic axis, a zero at its foot.
  const y = plane.higher_is_better ? linear(0, 1)
    : positive.length ? logarithmic(Math.max(Math.min(...positive), most * 1e-9), most) : linear(least, least + 1);
  const label = `${title}. ` + points.map((point) =>
    `${point.name}: ${short(point.time_ms)} ms, ${short(point.value)}${point.front ? ", on the front" : ""}`).join("; ");
  const { picture, across, down } = frame(
    logarithmic(Math.min(...times) / 1.3, Math.max(...times) * 1.3), y, "median time, ms", plane.name, label,
  );
  const front = points.filter((point) => point.front).sort((a, b) => a.time_ms - b.time_ms);
  if (front.length > 1) {
    let path = `M${across(front[0].time_ms)} ${down(front[0].value)}`;
    for (const point of front.slice(1)) path += `H${across(point.time_ms)}V${down(point.value)}`;
    picture.append(svg("path", { class: "cursor", d: path, fill: "none" }));
  }
  for (const point of points) {
    const style = styleOf(point.name), left = across(point.time_ms), top = down(point.value);
    const end = left > WIDTH * 0.7;
    picture.append(
      mark(style.mark, left, top, 5,
        { fill: point.front && style.mark !== "cross" ? style.colour : "none", stroke: style.colour, "stroke-width": 2 }),
      svg("text", { x: left + (end ? -9 : 9), y: Math.max(top - 5, TOP + 8), "text-anchor": end ? "end" : "start" },
        point.name.length > 28 ? point.name.slice(0, 27) + "…" : point.name),
    );
  }
  figure.append(picture, element("p", { class: "note" }, "Filled: no other is both as fast and as good."));
  return figure;
}

function timeChart(methods) {
  const timed = methods.filter((method) => method.time_ms && !hidden.has(method.name));
  const title = "Time of the trials that answered";
  const figure = element("figure", {}, element("figcaption", {}, title));
  if (!timed.length) return fill(figure, {}, ["Nothing was timed."]);
  const label = `${title}. ` + timed.map((method) =>
    `${method.name}: median ${short(method.time_ms[3])} ms, 90 % within ${short(method.time_ms[1])} to ` +
    `${short(method.time_ms[5])} ms`).join("; ");
  const least = Math.min(...timed.map((method) => method.time_ms[0])) || 1e-3;
  const x = logarithmic(least, Math.max(...timed.map((method) => method.time_ms[6])));
  const { picture, across } = frame(x, linear(0, 1), "ms (box: quartiles, line: 5 to 95 %, ends: dots)", "", label, false);
  const room = (HEIGHT - TOP - BOTTOM) / timed.length;
  timed.forEach((method, i) => {
    const style = styleOf(method.name), [low, p5, q1, median, q3, p95, high] = method.time_ms.map(across);
    const middle = TOP + room * (i + 0.62), half = Math.min(9, room * 0.25);
    const line = { stroke: style.colour, "stroke-width": 2, fill: "none" };
    picture.append(
      svg("path", { d: `M${p5} ${middle}H${q1}M${q3} ${middle}H${p95}`, ...line }),
      svg("rect", { x: q1, y: middle - half, width: Math.max(1, q3 - q1), height: 2 * half, ...line }),
      svg("path", { d: `M${median} ${middle - half}V${middle + half}`, ...line, "stroke-width": 3 }),
      mark("circle", low, middle, 1.5, { fill: style.colour }),
      mark("circle", high, middle, 1.5, { fill: style.colour }),
      svg("text", { x: LEFT + 2, y: middle - half - 3 },
        `${method.name.slice(0, 34)}: ${short(method.time_ms[3])} ms, ${method.timed} trials`),
    );
  });
  figure.append(picture);
  return figure;
}

function drawCharts(place) {
  const { charts } = data.protocols[Number(place.dataset.protocol)];
  const names = charts.methods.map((method) => method.name);
  const legend = element("div", { class: "legend", role: "group", "aria-label": "Methods in the charts" });
  for (const name of names) {
    const sample = svg("svg", { width: 30, height: 12, "aria-hidden": "true" });
    legend.append(element("button", {
      type: "button", "aria-pressed": "true", "data-method": name,
      onclick: () => {
        if (!hidden.delete(name)) hidden.add(name);
        redrawAll();
      },
    }, sample, name));
  }
  const select = element("select", { "aria-label": "Accuracy shown against time", onchange: () => redraw() });
  charts.planes.forEach((plane, i) => select.append(element("option", { value: i }, plane.name)));
  select.value = String(Math.max(0, charts.planes.findIndex((plane) => plane.key === "rre_median_deg")));
  const grid = element("div", { class: "grid" });
  place.append(legend, element("p", { class: "controls" }, element("label", {}, "Accuracy against time by ", select)), grid);

  function redraw() {
    for (const button of legend.children) {
      const style = styleOf(button.dataset.method);
      button.setAttribute("aria-pressed", String(!hidden.has(button.dataset.method)));
      button.firstChild.replaceChildren(
        svg("path", { d: "M0 6H30", stroke: style.colour, "stroke-width": 2, "stroke-dasharray": style.dash }),
        mark(style.mark, 15, 6, 3.5, { fill: style.mark === "cross" ? "none" : style.colour, stroke: style.colour }),
      );
    }
    const degrees = charts.thresholds_deg, lengths = degrees.map((value) => value / charts.deg_per_length);
    const recall = (kind, xs) => charts.methods.map((method) => ({ name: method.name, xs, ys: method.recall[kind] }));
    const ecdf = (kind) => charts.methods.map((method) =>
      ({ name: method.name, xs: method.ecdf[kind][0], ys: method.ecdf[kind][1], from0: true }));
    const last = degrees[degrees.length - 1], tied = short(1 / charts.deg_per_length);
    grid.replaceChildren(
      curveChart("Recall: both errors within", `degrees, and ${tied} of length to each`, "share of trials",
        linear(0, last), recall("both", degrees), 3),
      curveChart("Recall over rotation", "rotation error within, degrees", "share of trials",
        linear(0, last), recall("rotation", degrees), 3),
      curveChart("Recall over translation", "translation error within, clouds' length", "share of trials",
        linear(0, last / charts.deg_per_length), recall("translation", lengths), 3),
      curveChart("Rotation errors", "degrees", "share at most", logarithmic(1e-6, 180), ecdf("rotation"), 2),
      curveChart("Translation errors", "clouds' length", "share at most", logarithmic(1e-8, 10), ecdf("translation"), 2),
      planeChart(charts.planes[Number(select.value)]),
      timeChart(charts.methods),
    );
  }
  redraws.push(redraw);
  redraw();
}

function redrawAll() {
  for (const redraw of redraws) redraw();
}

/* Pairs */

function unpack(cloud, text) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  const view = new DataView(bytes.buffer);
  const points = new Float64Array(bytes.length / 2);
  for (let i = 0; i < points.length; i++) points[i] = cloud.low[i % 3] + cloud.step * view.getUint16(2 * i, true);
  return points;
}

function moved(points, T) {
  const result = new Float64Array(points.length);
  for (let i = 0; i < points.length; i += 3)
    for (let row = 0; row < 3; row++)
      result[i + row] = T[4 * row] * points[i] + T[4 * row + 1] * points[i + 1] + T[4 * row + 2] * points[i + 2] + T[4 * row + 3];
  return result;
}

function nearestDistances(from, to) {
  const distances = new Float64Array(from.length / 3);
  for (let i = 0; i < distances.length; i++) {
    let least = Infinity;
    for (let j = 0; j < to.length; j += 3) {
      const x = from[3 * i] - to[j], y = from[3 * i + 1] - to[j + 1], z = from[3 * i + 2] - to[j + 2];
      least = Math.min(least, x * x + y * y + z * z);
    }
    distances[i] = Math.sqrt(least);
  }
  return distances;
}

function box(...clouds) {
  const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
  for (const cloud of clouds)
    cloud.forEach((value, i) => {
      low[i % 3] = Math.min(low[i % 3], value);
      high[i % 3] = Math.max(high[i % 3], value);
    });
  const half = Math.hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]) / 2 || 1;
  return { centre: low.map((value, i) => (value + high[i]) / 2), half };
}

const times3 = (A, B) => Array.from({ length: 9 }, (_, i) => {
  const row = Math.floor(i / 3) * 3, column = i % 3;
  return A[row] * B[column] + A[row + 1] * B[column + 3] + A[row + 2] * B[column + 6];
});
const turnX = (angle) => [1, 0, 0, 0, Math.cos(angle), -Math.sin(angle), 0, Math.sin(angle), Math.cos(angle)];
const turnY = (angle) => [Math.cos(angle), 0, Math.sin(angle), 0, 1, 0, -Math.sin(angle), 0, Math.cos(angle)];
const startView = () => times3(turnX(0.44), turnY(-0.61));

function heat(share) {
  // Blue to yellow to red; lightness rises and falls, so that it can be read in grey beside the words.
  const s = Math.min(1, Math.max(0, share));
  return s < 0.5 ? [40 + 400 * s, 90 + 240 * s, 200 - 300 * s] : [240, 210 - 300 * (s - 0.5), 50 - 40 * (s - 0.5)];
}

function drawViews(place) {
  const { label, views } = data.protocols[Number(place.dataset.protocol)];
  const methods = [...new Set(views.pairs.map((pair) => pair.method))];
  const select = element("select", { "aria-label": "Method", onchange: () => { listPairs(); } });
  for (const method of methods) select.append(element("option", {}, method));
  const buttons = element("span", { class: "controls", role: "group", "aria-label": "Pair" });
  const byDistance = element("input", { type: "checkbox", onchange: () => render() });
  const words = element("p", { "aria-live": "polite" });
  const canvases = ["before", "after"].map((name) => element("canvas", {
    width: 760, height: 570, tabindex: 0, role: "img", "data-view": name,
    "aria-describedby": `keys-${place.dataset.protocol}`,
  }));
  const stage = element("div", { class: "stage" });
  const captions = ["Before: source and target as given", "After: the source moved by the answer"];
  canvases.forEach((canvas, i) => stage.append(element("figure", {}, element("figcaption", {}, captions[i]), canvas)));
  place.append(
    element("div", { class: "controls" },
      element("label", {}, "Method ", select), buttons,
      element("label", {}, byDistance, " colour by distance"),
      element("button", { type: "button", onclick: () => { view = startView(); zoom = 1; render(); } }, "turn back")),
    words, stage,
    element("p", { class: "note", id: `keys-${place.dataset.protocol}` },
      element("span", { class: "source" }, "● source"), " ", element("span", { class: "target" }, "● target"),
      ". Drag to turn; with the keyboard: arrows turn, + and - zoom, 0 turns back. Both views turn together."),
  );
  let view = startView(), zoom = 1, shown = null, asked = false;

  function listPairs() {
    const pairs = views.pairs.filter((pair) => pair.method === select.value);
    buttons.replaceChildren(...pairs.map((pair) => element("button", {
      type: "button", "aria-pressed": "false",
      onclick: (event) => choose(pair, event.currentTarget),
    }, pair.kind + (pairs.filter((other) => other.kind === pair.kind).length > 1 ? ` ${pair.rank}` : ""))));
    choose(pairs[0], buttons.firstChild);
  }

  function choose(pair, button) {
    for (const other of buttons.children) other.setAttribute("aria-pressed", String(other === button));
    const cloud = views.clouds[pair.problem];
    const source = unpack(cloud, cloud.source), target = unpack(cloud, cloud.target);
    const aligned = moved(source, pair.T_target_source);
    shown = {
      panels: [[source, target], [aligned, target]],
      boxes: [box(source, target), box(aligned, target)],
      distances: [nearestDistances(source, target), nearestDistances(aligned, target)],
    };
    const named = [pair.label, pair.id].filter(Boolean).join(", ");
    words.textContent = `${pair.method}, ${pair.kind}: problem ${pair.problem}${named ? ` (${named})` : ""}; off by ` +
      `${short(pair.rotation_deg)}° and ${short(pair.translation)} of length`;
    canvases.forEach((canvas, i) =>
      canvas.setAttribute("aria-label", `${captions[i]}. ${label}, ${words.textContent}. Can be turned.`));
    render();
  }

  function render() {
    if (asked) return;
    asked = true;
    requestAnimationFrame(() => {
      asked = false;
      const half = Math.max(...shown.boxes.map((each) => each.half));
      canvases.forEach((canvas, i) => drawPanel(canvas, shown.panels[i], shown.boxes[i].centre, half,
        byDistance.checked ? shown.distances[i] : null));
    });
  }

  function drawPanel(canvas, clouds, centre, half, distances) {
    const context = canvas.getContext("2d"), { width, height } = canvas;
    const scale = ((Math.min(width, height) / 2) * 1.25 * zoom) / half;
    const ground = dark.matches ? [22, 24, 27] : [255, 255, 255];
    const colours = dark.matches ? [[240, 160, 48], [86, 169, 234]] : [[230, 130, 0], [0, 104, 178]];
    const points = [];
    clouds.forEach((cloud, which) => {
      for (let i = 0; i < cloud.length; i += 3) {
        const p = [cloud[i] - centre[0], cloud[i + 1] - centre[1], cloud[i + 2] - centre[2]];
        const [x, y, z] = [0, 3, 6].map((row) => view[row] * p[0] + view[row + 1] * p[1] + view[row + 2] * p[2]);
        // The colour is full at a tenth of the clouds' half diagonal.
        const colour = which === 0 && distances ? heat(distances[i / 3] / (0.1 * half)) : colours[which];
        points.push([z / half, width / 2 + x * scale, height / 2 - y * scale, colour]);
      }
    });
    points.sort((a, b) => a[0] - b[0]); // the nearest to the eye is drawn last
    context.fillStyle = `rgb(${ground})`;
    context.fillRect(0, 0, width, height);
    const radius = Math.min(7, Math.max(2.2, 130 / Math.sqrt(points.length))) * Math.sqrt(zoom);
    for (const [depth, x, y, colour] of points) {
      const fade = 0.5 * (1 - (Math.min(1, Math.max(-1, depth)) + 1) / 2);
      context.fillStyle = `rgb(${colour.map((value, i) => Math.round(value * (1 - fade) + ground[i] * fade))})`;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.fill();
    }
  }

  function turn(right, down) {
    view = times3(times3(turnX(down), turnY(right)), view);
    render();
  }

  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1), "+": () => { zoom = Math.min(20, zoom * 1.2); render(); },
    "-": () => { zoom = Math.max(0.2, zoom / 1.2); render(); }, 0: () => { view = startView(); zoom = 1; render(); },
  };
  for (const canvas of canvases) {
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (event.buttons) turn(event.movementX * 0.01, event.movementY * 0.01);
    });
    canvas.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !Object.hasOwn(KEYS, event.key)) return;
      KEYS[event.key]();
      event.preventDefault();
    });
  }
  redraws.push(render);
  listPairs();
}

for (const table of document.querySelectorAll("table.sortable")) sortable(table);
for (const place of document.querySelectorAll(".charts")) drawCharts(place);
for (const place of document.querySelectorAll(".views")) drawViews(place);
dark.addEventListener("change", redrawAll);
