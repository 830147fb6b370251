// The page of a report: error against cost of all cells, with filters, a table, and two cells side by side.
//
// It reads one JSON object (the script element "data"), in which all tables are columns: `values[i]` belongs to cell i.
// A cell is always its index. What a person has chosen is in `state`; `update` computes what follows from it and draws all anew.
(() => {
"use strict";

// ---------------------------------------------------------------------------------------------------------------------
// Data

const data = JSON.parse(document.getElementById("data").textContent);
const columns = new Map(data.columns.map((column) => [column.name, column]));
const cellCount = data.columns.length > 0 ? data.columns[0].values.length : 0;
const everyCell = Array.from({ length: cellCount }, (_, cell) => cell);

const raw = (name, cell) => columns.get(name)?.values[cell] ?? null;
const text = (name, cell) => String(raw(name, cell) ?? "");
const withRole = (role) => data.columns.filter((column) => column.role === role);
const isNumeric = (column) => column.kind === "number" || column.kind === "integer";
const isMore = (column) => column?.better === "more";

/** A number of a column, `null` if it was not measured. JSON has no infinity, so it is written as text. */
function number(column, cell) {
  const value = column ? column.values[cell] : null;
  if (value === "inf") return Infinity;
  if (value === "-inf") return -Infinity;
  return typeof value === "number" ? value : null;
}

/** Median and quartiles of a column; the quartiles are `null` where there are none. */
function spread(column, cell) {
  const quartile = (end) => number(columns.get(column.name + end), cell);
  return { median: number(column, cell), lower: quartile("_q1"), upper: quartile("_q3") };
}

/** Times that are spent once a cell; all other costs are of each frame. */
const COLD = new Set(["once_ms", "prepare_ms"]);

/** Different values of a column, in order, and for each cell which of them it has. */
function levelsOf(column) {
  const rank = (value) => (column.name === "status" ? ["ok", "faulty", "failed"].indexOf(value) : 0);
  const values = [...new Set(column.values)].sort((a, b) => rank(a) - rank(b) || compareValues(a, b));
  const level = new Map(values.map((value, index) => [value, index]));
  return { values, of: Int32Array.from(column.values, (value) => level.get(value)) };
}

const collator = new Intl.Collator("en", { numeric: true });

/** Order of two raw values: numbers by size, texts with the numbers in them by size, "not measured" last. */
function compareValues(a, b) {
  if (a === null || b === null) return (a === null) - (b === null);
  const [x, y] = [sortable(a), sortable(b)];
  if (typeof x === "number" && typeof y === "number") return x - y;
  return collator.compare(String(a), String(b));
}

function sortable(value) {
  if (value === "inf") return Infinity;
  if (value === "-inf") return -Infinity;
  return typeof value === "boolean" ? Number(value) : value;
}

// ---------------------------------------------------------------------------------------------------------------------
// What a person has chosen

const state = {
  /** Names of the columns that are plotted. */
  error: defaultName("error", "error_rms"),
  cost: defaultName("cost", "method_ms"),
  /** Axis that lines are drawn along: "every", "none", or its name. */
  along: "every",
  /** Filters: for each column the levels that are switched off. */
  off: new Map(),
  /** The part of the plot that is seen, as `{ x: [min, max], y: [min, max] }`, or `null` for all of it. */
  zoom: null,
  /** Up to two cells. */
  pinned: [],
  hovered: null,
  /** Of two pictures: how much of the first is seen, and which kind. */
  wipe: 50,
  picture: null,
  sort: { column: null, descending: false },
  page: 0,
  /** Names of the table's columns. */
  tableColumns: null,
  /** Cells that pass the filters, and those of them on a front: computed by `update`. */
  shown: [],
  front: [],
};

function defaultName(role, name) {
  const known = withRole(role);
  return (known.find((column) => column.name === name) ?? known[0])?.name ?? null;
}

// ---------------------------------------------------------------------------------------------------------------------
// Small helpers for elements and numbers

/** Makes an element: `make("p", { className: "x" }, "text", child)`. Texts are never read as HTML. */
function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

const byId = (id) => document.getElementById(id);

/** A number with three significant digits, as long as that is no exponent of everyday sizes. */
function digits(value) {
  if (value === null) return "–";
  if (value === Infinity) return "∞";
  if (value === -Infinity) return "−∞";
  const size = Math.abs(value);
  if (size === 0) return "0";
  if (size >= 1e9 || size < 9.995e-4) return value.toExponential(2).replace("e+", "e");
  if (size >= 99.95) return grouped(Math.round(value));
  return value.toPrecision(3);
}

/** An integer with a thin space between thousands. */
function grouped(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u202f");
}

/** A value of a column as the page shows it. */
function shownValue(column, value) {
  if (value === null || value === undefined) return "–";
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (value === "inf" || value === "-inf") return digits(sortable(value));
  if (typeof value !== "number") return String(value);
  if (Number.isInteger(value) && column.kind === "integer") return column.role === "axis" ? String(value) : grouped(value);
  // a setting is what somebody wrote, and nothing of it is left out
  if (column.role === "axis") return String(Number(value.toPrecision(9)));
  return digits(value);
}

/** A value with all of its digits, for who stays on it with the pointer. */
function fullText(column, value) {
  if (value === null) return column.role === "axis" ? "its chain has none" : "not measured";
  return String(value);
}

/** Title with the unit, for instance "method, ms". */
function titled(column) {
  return column.unit ? `${column.title}, ${column.unit}` : column.title;
}

function withUnit(column, value) {
  return column.unit && value !== null ? `${digits(value)} ${column.unit}` : digits(value);
}

/** "(4.1 … 4.7)", or nothing. */
function quartileText({ lower, upper }) {
  return lower === null || upper === null ? "" : `(${digits(lower)} … ${digits(upper)})`;
}

/** A long name, such as bounded.GridError.threshold_px, as parts between which a line may be broken: after a dot, or before a large letter. */
function breakable(name) {
  return name.split(/(?<=\w[.])|(?<=[a-z])(?=[A-Z])/).flatMap((part) => [part, make("wbr")]);
}

const plural = (count, one, many) => `${grouped(count)} ${count === 1 ? one : many}`;

// ---------------------------------------------------------------------------------------------------------------------
// Colours of chains, shapes of adapters

/** The first ten are those of pareto.svg, in the same order. */
const COLOURS = ["#1f77b4", "#d66314", "#2c8c2c", "#9449b3", "#aa2832", "#5a5a5a", "#1496a0", "#785032", "#dc5aa0", "#828c14"];
/** Fronts: one colour an adapter. */
const FRONT_COLOURS = ["#facd5a", "#a5d3f0", "#bfe5ab", "#ecc0dd"];
const SHAPES = ["circle", "square", "triangle", "diamond", "drop", "hexagon"];

const chains = levelsOf(columns.get("chain"));
const adapters = levelsOf(columns.get("adapter"));
const scenes = levelsOf(columns.get("scene"));

function chainColour(level) {
  // beyond the tenth chain, hues a golden angle apart never come close to their neighbours
  return COLOURS[level] ?? `hsl(${Math.round((level * 137.5) % 360)} 65% 40%)`;
}
const colourOf = (cell) => chainColour(chains.of[cell]);
const shapeOfAdapter = (level) => SHAPES[level % SHAPES.length];
const frontColour = (level) => FRONT_COLOURS[level % FRONT_COLOURS.length];

/** Adds a marker to a path, of about the same area for all shapes. */
function addMarker(path, shape, x, y, radius) {
  if (shape === "circle") {
    path.moveTo(x + radius, y);
    path.arc(x, y, radius, 0, 2 * Math.PI);
    return;
  }
  const corners = { square: [4, 45], triangle: [3, -90], diamond: [4, 0], drop: [3, 90], hexagon: [6, 0] }[shape];
  const [count, first] = corners;
  const reach = radius * (count === 3 ? 1.45 : count === 4 ? 1.25 : 1.1);
  for (let corner = 0; corner < count; corner++) {
    const angle = ((first + (corner * 360) / count) * Math.PI) / 180;
    const [px, py] = [x + reach * Math.cos(angle), y + reach * Math.sin(angle)];
    if (corner === 0) path.moveTo(px, py);
    else path.lineTo(px, py);
  }
  path.closePath();
}

function addCross(path, x, y, radius) {
  const arm = radius * 0.72;
  path.moveTo(x - arm, y - arm);
  path.lineTo(x + arm, y + arm);
  path.moveTo(x - arm, y + arm);
  path.lineTo(x + arm, y - arm);
}

/** A small picture of a marker, for legends. It is drawn like the real ones, on a canvas of its own. */
function markerIcon(shape, colour, isFaulty = false) {
  const [size, ratio] = [14, window.devicePixelRatio || 1];
  const canvas = make("canvas", { className: "icon", width: size * ratio, height: size * ratio });
  canvas.style.cssText = `width:${size}px;height:${size}px`;
  const context = canvas.getContext("2d");
  context.scale(ratio, ratio);
  const path = new Path2D();
  addMarker(path, shape, 7, 7, 4.5);
  if (isFaulty) addCross(path, 7, 7, 4.5);
  context.fillStyle = context.strokeStyle = colour;
  if (isFaulty) context.stroke(path);
  else context.fill(path);
  return canvas;
}

// ---------------------------------------------------------------------------------------------------------------------
// Filters

/** With more values than this, a filter is a list to select from. */
const MOST_CHIPS = 12;

const filters = [
  ...["chain", "adapter", "scene", "status"].map((name) => makeFilter(columns.get(name))),
  ...withRole("axis").map((column) => makeFilter(column)),
].filter((filter) => filter.column.name === "chain" || filter.levels.values.length > 1);

function makeFilter(column) {
  return { column, levels: levelsOf(column), inputs: [], select: null };
}

/** Cells that no filter has switched off. */
function cellsShown() {
  const active = filters.filter((filter) => state.off.get(filter.column.name)?.size > 0);
  if (active.length === 0) return everyCell;
  const passes = (cell) => active.every(({ column, levels }) => !state.off.get(column.name).has(levels.of[cell]));
  return everyCell.filter(passes);
}

function setOff(filter, levels) {
  state.off.set(filter.column.name, new Set(levels));
  state.page = 0;
  showFilter(filter);
  update();
}

/** Brings chips or list of a filter to what `state` says. */
function showFilter(filter) {
  const off = state.off.get(filter.column.name) ?? new Set();
  filter.inputs.forEach((input, level) => {
    input.checked = !off.has(level);
    input.parentElement.classList.toggle("off", off.has(level));
  });
  if (filter.select) [...filter.select.options].forEach((option, level) => (option.selected = !off.has(level)));
  filter.all.hidden = off.size === 0;
}

function resetFilters() {
  state.off.clear();
  state.page = 0;
  filters.forEach(showFilter);
  update();
}

function buildFilters() {
  const axisHome = byId("axis-filters").lastElementChild;
  for (const filter of filters) {
    const { column } = filter;
    const isAxis = column.role === "axis";
    const isList = filter.levels.values.length > MOST_CHIPS && column.name !== "chain";
    filter.all = make("button", { type: "button", className: "plain", textContent: "all", hidden: true });
    filter.all.onclick = () => setOff(filter, []);
    const name = make("span", { className: "name", title: column.meaning ?? "" }, breakable(titled(column)));
    const choice = isList ? buildList(filter) : buildChips(filter);
    (isAxis ? axisHome : byId("legend")).append(make("div", { className: "filter" }, name, choice, filter.all));
  }
  const axisFilters = filters.filter((filter) => filter.column.role === "axis").length;
  byId("axis-filters").hidden = axisFilters === 0;
  byId("axis-filters").open = axisFilters > 0 && axisFilters <= 3;
  byId("reset-filters").onclick = resetFilters;
}

function levelText(column, value) {
  if (value === null) return "(has none)";
  if (value === "") return "(no name)";
  return shownValue(column, value);
}

function buildChips(filter) {
  const chips = filter.levels.values.map((value, level) => {
    const input = make("input", { type: "checkbox", checked: true, value: String(level) });
    input.onchange = () => {
      const off = new Set(state.off.get(filter.column.name));
      if (input.checked) off.delete(level);
      else off.add(level);
      setOff(filter, off);
    };
    filter.inputs.push(input);
    const chip = make("label", { className: "chip", title: "Double click: only this one" }, input, chipIcon(filter, level));
    chip.append(levelText(filter.column, value));
    chip.ondblclick = () => setOff(filter, filter.levels.values.map((_, other) => other).filter((other) => other !== level));
    return chip;
  });
  return make("div", { className: "chips" }, chips);
}

/** The chips of chains, adapters and states are the legend of the plot. */
function chipIcon(filter, level) {
  const value = filter.levels.values[level];
  switch (filter.column.name) {
    case "chain":
      return markerIcon("circle", chainColour(level));
    case "adapter":
      return markerIcon(shapeOfAdapter(level), "#5d6878");
    case "status":
      return value === "failed" ? null : markerIcon("circle", "#5d6878", value === "faulty");
    default:
      return null;
  }
}

function buildList(filter) {
  const options = filter.levels.values.map((value) => make("option", { selected: true }, levelText(filter.column, value)));
  filter.select = make("select", { multiple: true, size: 6, "aria-label": filter.column.title }, options);
  filter.select.onchange = () => {
    const isOff = (_, level) => !options[level].selected;
    setOff(filter, options.map((_, level) => level).filter(isOff));
  };
  return filter.select;
}

// ---------------------------------------------------------------------------------------------------------------------
// Axes of the plot

/** A log axis has no zero, and less than this is no error that a picture could show. */
const SMALLEST_PX = 1e-4;
/** What is larger is drawn as infinite: it is no error of a picture, no time, and no number of triangles. */
const LARGEST = 1e12;

/**
 * How the numbers of a column are placed on an axis. Where less is better the axis is logarithmic. Where more is better (decibels,
 * similarity), the numbers themselves are such that a plain axis shows them best.
 *
 * Numbers below `least` and infinite ones have no place there. They are drawn at `floor` and `ceiling`, a little beyond all others: the
 * axis is broken there, and has no ticks beyond the break. (At its true place, one cell of error 0 would take three quarters of the plot.)
 */
function makeScale(column, values, target) {
  const isLog = !isMore(column);
  const least = !isLog ? -LARGEST : column.unit === "px" ? SMALLEST_PX : Number.MIN_VALUE;
  const seen = values.filter((value) => value >= least && value <= LARGEST);
  if (target !== null && isLog) seen.push(target);
  const [low, high] = extremes(seen);
  const [floor, ceiling] = isLog ? beyondLog(low, high) : beyondLinear(low, high);
  const isBelow = values.some((value) => value < least);
  const isAbove = values.some((value) => value > LARGEST);
  const place = (value) => (value > LARGEST ? ceiling : value < least ? floor : value);
  const ends = [isBelow ? floor : low, isAbove ? ceiling : high];
  const [min, max] = isLog ? paddedLog(...ends) : paddedLinear(...ends);
  // ticks are between these
  const [first, last] = [isBelow ? Math.sqrt(floor * low) : min, isAbove ? (high + ceiling) / 2 : max];
  return { column, isLog, least, floor, ceiling, isBelow, isAbove, place, min, max, first, last };
}

function beyondLog(low, high) {
  const factor = Math.pow(high / low, 0.15) * 1.6;
  return [low / factor, high * factor];
}

function beyondLinear(low, high) {
  const distance = 0.15 * (high - low) || Math.abs(high) * 0.1 || 1;
  return [low - distance, high + distance];
}

/** (Not `Math.min(...values)`: as arguments, 50 000 numbers are too many for some browsers.) */
function extremes(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) {
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  return low <= high ? [low, high] : [1, 1];
}

function paddedLog(low, high) {
  const factor = Math.max(Math.pow(high / low, 0.06), 1.02);
  return [low / factor, high * factor];
}

function paddedLinear(low, high) {
  const padding = Math.max((high - low) * 0.06, Math.abs(high) * 1e-3, 1e-9);
  return [low - padding, high + padding];
}

/** Ticks at 1, 2 and 5 times powers of ten; where these are fewer than three, in steps of 1, 2 or 5. `most` is what there is room for. */
function ticks(isLog, min, max, most) {
  if (isLog) {
    const found = [[1, 2, 5], [1]].map((leading) => logTicks(min, max, leading, 1));
    const fitting = found.find((list) => list.length >= 3 && list.length <= most);
    if (fitting) return fitting;
    for (let step = 2; found[1].length > most; step++) found[1] = logTicks(min, max, [1], step);
    if (found[1].length >= 3) return found[1];
    if (found[0].length >= 3) return found[0];
  }
  return linearTicks(min, max, most);
}

function logTicks(min, max, leading, everyDecades) {
  const list = [];
  for (let decade = Math.floor(Math.log10(min)); decade <= Math.log10(max); decade++) {
    if (decade % everyDecades !== 0) continue;
    for (const digit of leading) {
      // as text, since 3 * 0.1 is not 0.3
      const tick = Number(`${digit}e${decade}`);
      if (tick >= min && tick <= max) list.push(tick);
    }
  }
  return list;
}

function linearTicks(min, max, most) {
  const wanted = Math.max(3, Math.min(most, 6));
  let exponent = Math.ceil(Math.log10(max - min));
  for (let guard = 0; guard < 4; guard++, exponent--) {
    for (const digit of [5, 2, 1]) {
      const step = Number(`${digit}e${exponent}`);
      const first = Math.ceil(min / step);
      const count = Math.floor(max / step) - first + 1;
      if (count >= Math.min(4, wanted)) {
        return Array.from({ length: count }, (_, index) => Number(((first + index) * step).toPrecision(12)));
      }
    }
  }
  return [min, (min + max) / 2, max];
}

function tickText(value) {
  const size = Math.abs(value);
  const units = [[1e9, "G"], [1e6, "M"], [1e4, "k", 1e3]];
  for (const [least, letter, divisor = least] of units) {
    if (size >= least && size < 1e12) return `${Number((value / divisor).toPrecision(6))}${letter}`;
  }
  if (size !== 0 && (size < 1e-4 || size >= 1e12)) return value.toExponential().replace("e+", "e");
  return String(Number(value.toPrecision(6)));
}

// ---------------------------------------------------------------------------------------------------------------------
// Curves: cells that differ in one axis only

/** All lines there could be, as `{ axis, cells }`, the cells in the order of the axis. They depend on no choice, so they are found once. */
const lines = findLines();

function findLines() {
  const axes = withRole("axis").map((column) => ({ column, levels: levelsOf(column), rank: rankOf(column) }));
  const found = [];
  chains.values.forEach((_, chain) => {
    const cells = everyCell.filter((cell) => chains.of[cell] === chain);
    const varying = axes.filter(({ levels }) => cells.some((cell) => levels.of[cell] !== levels.of[cells[0]]));
    // axes that always change together are one axis with two names
    const leaders = varying.filter((axis, index) => !varying.slice(0, index).some((other) => areTied(axis.levels, other.levels, cells)));
    for (const axis of leaders.filter((axis) => axis.rank !== null)) {
      const others = leaders.filter((other) => other !== axis);
      for (const group of groupsAlong(axis, others, cells)) found.push({ axis: axis.column.name, cells: group });
    }
  });
  return found;
}

/** Does each value of one axis come with one value of the other, and the other way round? */
function areTied(one, other, cells) {
  const [forth, back] = [new Map(), new Map()];
  return cells.every((cell) => {
    const [a, b] = [one.of[cell], other.of[cell]];
    if (!forth.has(a)) forth.set(a, b);
    if (!back.has(b)) back.set(b, a);
    return forth.get(a) === b && back.get(b) === a;
  });
}

/** For each cell where it is along an axis; `null` if there is no between on it. A text of numbers, such as "(64, 48)", has one. */
function rankOf(column) {
  if (isNumeric(column)) return everyCell.map((cell) => number(column, cell));
  const isTuple = (value) => value === null || /^\(?\s*-?[\d.]+(\s*[,x×]\s*-?[\d.]+)+\s*\)?$/.test(value);
  if (column.kind !== "text" || !column.values.every(isTuple)) return null;
  const levels = levelsOf(column);
  return everyCell.map((cell) => (column.values[cell] === null ? null : levels.of[cell]));
}

function groupsAlong(axis, others, cells) {
  const groups = new Map();
  for (const cell of cells) {
    if (axis.rank[cell] === null) continue;
    const key = [scenes.of[cell], adapters.of[cell], ...others.map((other) => other.levels.of[cell])].join();
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(cell);
  }
  const inOrder = (a, b) => axis.rank[a] - axis.rank[b];
  return [...groups.values()].filter((group) => group.length > 1).map((group) => group.sort(inOrder));
}

// ---------------------------------------------------------------------------------------------------------------------
// Fronts

/**
 * Of points `{ cell, x, y }` those that none beats in both, from the cheapest on. Of two equal points both are on it.
 * What counts is where a point is drawn: of two errors that are both too small to be seen, neither is better.
 */
function frontOf(points, moreIsBetter) {
  const sign = moreIsBetter ? -1 : 1;
  const sorted = [...points].sort((a, b) => a.x - b.x || sign * (a.y - b.y));
  const front = [];
  let best = null;
  for (const point of sorted) {
    const isBetter = best === null || sign * (point.y - best.y) < 0;
    const isEqual = best !== null && point.x === best.x && point.y === best.y;
    if (isBetter || isEqual) front.push(point);
    if (isBetter) best = point;
  }
  return front;
}

// ---------------------------------------------------------------------------------------------------------------------
// The plot: what is in it

/** What the plot shows now: scales, and a panel for each scene. Made by `computePlot`. */
let plot = null;

/** Panels that the plot has at once; the filter of scenes chooses others. */
const MOST_PANELS = 24;

function computePlot() {
  const [errorColumn, costColumn] = [columns.get(state.error), columns.get(state.cost)];
  if (!errorColumn || !costColumn) return null;
  const measured = [];
  let unmeasured = 0;
  for (const cell of state.shown) {
    const [error, cost] = [number(errorColumn, cell), number(costColumn, cell)];
    if (text("status", cell) === "failed") continue;
    if (error === null || cost === null) unmeasured++;
    else measured.push({ cell, error, cost });
  }
  const target = errorColumn.unit === "px" ? data.target_px ?? null : null;
  const x = makeScale(costColumn, measured.map((point) => point.cost), null);
  const y = makeScale(errorColumn, measured.map((point) => point.error), target);
  const panels = new Map();
  for (const { cell, error, cost } of measured) {
    const scene = scenes.of[cell];
    if (!panels.has(scene)) panels.set(scene, { scene, points: [] });
    const isFaulty = text("status", cell) !== "ok";
    const point = { cell, x: x.place(cost), y: y.place(error), error, cost, isFaulty, isFront: false };
    panels.get(scene).points.push(point);
  }
  const inOrder = [...panels.values()].sort((a, b) => a.scene - b.scene);
  inOrder.forEach((panel) => (panel.fronts = frontsOf(panel.points, errorColumn)));
  const hiddenPanels = Math.max(0, inOrder.length - MOST_PANELS);
  return { x, y, target, panels: inOrder.slice(0, MOST_PANELS), hiddenPanels, unmeasured, size: measured.length };
}

/** One front an adapter, since times of different adapters say nothing of a method. */
function frontsOf(points, errorColumn) {
  const isCandidate = (point) => !point.isFaulty && (isMore(errorColumn) ? point.error > -LARGEST : point.error <= LARGEST) && point.cost <= LARGEST;
  return adapters.values.map((_, adapter) => {
    const own = points.filter((point) => adapters.of[point.cell] === adapter && isCandidate(point));
    const front = frontOf(own, isMore(errorColumn));
    front.forEach((point) => (point.isFront = true));
    return { adapter, points: front };
  });
}

// ---------------------------------------------------------------------------------------------------------------------
// The plot: how it is drawn

const HEIGHT_OF_ONE = 540;
const AXIS_FONT = "12px system-ui, sans-serif";

function drawPlot() {
  const home = byId("plots");
  // what the card says is of the plot that goes
  state.hovered = null;
  byId("card").hidden = true;
  (plot?.panels ?? []).forEach((panel) => panel.chart?.destroy());
  home.replaceChildren();
  plot = computePlot();
  state.front = plot ? plot.panels.flatMap((panel) => panel.fronts.flatMap((front) => front.points.map((point) => point.cell))) : [];
  byId("reset-zoom").hidden = state.zoom === null;
  if (!plot || plot.size === 0) {
    const why = plot ? "No cell that is shown has both of these." : "No cell has an error and a cost that could be plotted.";
    home.append(make("p", { className: "empty" }, why));
    showKeys();
    return;
  }
  const count = plot.panels.length;
  const perRow = Math.min(count, window.innerWidth < 700 ? 1 : count === 4 ? 2 : 3);
  home.style.gridTemplateColumns = `repeat(${perRow}, minmax(0, 1fr))`;
  const width = Math.floor((home.clientWidth - 16 * (perRow - 1)) / perRow);
  const height = Math.round(Math.min(HEIGHT_OF_ONE, Math.max(340, width * 0.85)));
  for (const panel of plot.panels) {
    const heading = scenes.values.length > 1 ? make("h3", {}, levelText(columns.get("scene"), scenes.values[panel.scene])) : null;
    panel.element = make("div", { className: "panel" }, heading);
    home.append(panel.element);
    panel.chart = makeChart(panel, width, height);
    listenTo(panel);
  }
  showKeys();
  showRings();
}

/** uPlot gives axes, the crosshair and the selection of a part; what is between the axes is drawn by `drawPanel`. */
function makeChart(panel, width, height) {
  const { x, y } = plot;
  const range = (axis, scale) => () => state.zoom?.[axis] ?? [scale.min, scale.max];
  const axis = (scale, key, room, pixelsATick) => ({
    scale: key,
    label: axisTitle(scale.column),
    labelFont: `600 ${AXIS_FONT}`,
    font: AXIS_FONT,
    labelSize: 24,
    labelGap: 2,
    size: key === "x" ? 30 : 56,
    gap: 4,
    stroke: "#3c4657",
    grid: { stroke: "#eceff3", width: 1 },
    ticks: { stroke: "#c9d0d9", width: 1, size: 5 },
    border: { show: true, stroke: "#9aa4b2", width: 1 },
    splits: (_, __, min, max) => ticks(scale.isLog, Math.max(min, scale.first), Math.min(max, scale.last), room / pixelsATick),
    filter: (_, splits) => splits,
    values: (_, splits) => splits.map(tickText),
  });
  const options = {
    width,
    height,
    legend: { show: false },
    padding: [10, 14, 0, 0],
    cursor: {
      points: { show: false },
      drag: { x: true, y: true, setScale: false, dist: 6 },
      bind: { dblclick: () => () => setZoom(null) },
    },
    scales: {
      x: { time: false, distr: x.isLog ? 3 : 1, range: range("x", x) },
      y: { distr: y.isLog ? 3 : 1, range: range("y", y) },
    },
    axes: [axis(x, "x", width - 80, 52), axis(y, "y", height - 60, 28)],
    // uPlot wants a series, and draws nothing of it
    series: [{}, { paths: () => null, points: { show: false } }],
    hooks: { draw: [(chart) => drawPanel(chart, panel)], setSelect: [zoomIn] },
  };
  return new uPlot(options, [[x.min, x.max], [y.min, y.max]], panel.element);
}

function axisTitle(column) {
  const when = column.role !== "cost" ? "" : COLD.has(column.name) ? " (once a cell)" : "";
  return titled(column) + when + (isMore(column) ? " (more is better)" : "");
}

function zoomIn(chart) {
  const { left, top, width, height } = chart.select;
  if (width < 6 || height < 6) return;
  const at = (pixels, key) => chart.posToVal(pixels, key);
  setZoom({ x: [at(left, "x"), at(left + width, "x")], y: [at(top + height, "y"), at(top, "y")] });
}

function setZoom(zoom) {
  if (zoom === null && state.zoom === null) return;
  state.zoom = zoom;
  // not at once: uPlot is in the midst of an event of the chart that is thrown away
  setTimeout(drawPlot, 0);
}

function drawPanel(chart, panel) {
  const context = chart.ctx;
  const ratio = uPlot.pxRatio;
  const [width, height] = [chart.bbox.width / ratio, chart.bbox.height / ratio];
  placePoints(chart, panel);
  context.save();
  // from here on, lengths are those of the page, and (0, 0) is the corner of what the axes enclose
  context.translate(chart.bbox.left, chart.bbox.top);
  context.scale(ratio, ratio);
  context.beginPath();
  context.rect(0, 0, width, height);
  context.clip();
  context.lineJoin = context.lineCap = "round";
  const isInside = ({ left, top }) => left >= 0 && left <= width && top >= 0 && top <= height;
  panel.inside = panel.points.filter(isInside);
  const radius = radiusFor(panel.inside.length, width);
  drawLimits(context, chart, width, height);
  drawFronts(context, panel);
  drawLines(context, panel);
  drawWhiskers(context, panel);
  drawPoints(context, panel, radius);
  drawWords(context, chart, panel, width, height, radius);
  context.restore();
}

/** Markers are smaller where there are many, and in narrow panels. */
function radiusFor(count, width) {
  const radius = count <= 60 ? 5 : count <= 600 ? 3.6 : 2.2;
  return width < 500 ? Math.max(radius * 0.8, 2) : radius;
}

/** Where the points are, in pixels of the page from the corner of what the axes enclose: for drawing, for the pointer and for tests. */
function placePoints(chart, panel) {
  for (const point of panel.points) {
    point.left = chart.valToPos(point.x, "x");
    point.top = chart.valToPos(point.y, "y");
  }
  panel.byCell = new Map(panel.points.map((point) => [point.cell, point]));
}

const LIMIT = { colour: "#76808e", dash: [2, 3] };
const TARGET = { colour: "#c0392b", dash: [6, 4] };

/** Lines across the plot: the target, and where numbers are drawn that have no place on the axis. */
function limits(scale, target) {
  const list = [];
  if (target !== null) list.push({ at: target, words: `target ${tickText(target)} px`, ...TARGET });
  if (scale.isBelow) list.push({ at: scale.floor, words: scale.column.unit === "px" ? `less than ${tickText(scale.least)} px` : "0", ...LIMIT });
  if (scale.isAbove) list.push({ at: scale.ceiling, words: "infinite", ...LIMIT });
  return list;
}

/** The lines, and beyond the breaks of the axes another ground. */
function drawLimits(context, chart, width, height) {
  const { x, y, target } = plot;
  const [across, up] = [(value) => chart.valToPos(value, "x"), (value) => chart.valToPos(value, "y")];
  context.fillStyle = "#f5f6f8";
  if (y.isBelow) context.fillRect(0, up(y.first), width, height);
  if (y.isAbove) context.fillRect(0, 0, width, up(y.last));
  if (x.isBelow) context.fillRect(0, 0, across(x.first), height);
  if (x.isAbove) context.fillRect(across(x.last), 0, width, height);
  for (const { at, colour, dash } of limits(y, target)) stroke(context, [[0, up(at)], [width, up(at)]], colour, 1.3, dash);
  for (const { at, colour, dash } of limits(x, null)) stroke(context, [[across(at), 0], [across(at), height]], colour, 1.3, dash);
}

/** Text that can be read over anything. */
function writeOver(context, words, left, top, colour) {
  context.strokeStyle = "rgba(255, 255, 255, .9)";
  context.lineWidth = 3;
  context.strokeText(words, left, top);
  context.fillStyle = colour;
  context.fillText(words, left, top);
}

function stroke(context, places, colour, width, dash = []) {
  context.beginPath();
  places.forEach(([left, top]) => context.lineTo(left, top));
  context.strokeStyle = colour;
  context.lineWidth = width;
  context.setLineDash(dash);
  context.stroke();
  context.setLineDash([]);
}

function drawFronts(context, panel) {
  for (const { adapter, points } of panel.fronts) {
    if (points.length === 0) continue;
    const places = points.map((point) => [point.left, point.top]);
    // a front of one point is a dot
    if (places.length === 1) places.push(places[0]);
    // where two are the same, both are seen
    stroke(context, places, frontColour(adapter), Math.max(9 - 3 * adapter, 3));
  }
}

function drawLines(context, panel) {
  if (state.along === "none") return;
  const paths = new Map();
  let segments = 0;
  for (const { axis, cells } of lines) {
    if (scenes.of[cells[0]] !== panel.scene || (state.along !== "every" && state.along !== axis)) continue;
    const points = cells.map((cell) => panel.byCell.get(cell)).filter((point) => point !== undefined);
    if (points.length < 2) continue;
    const colour = colourOf(points[0].cell);
    if (!paths.has(colour)) paths.set(colour, new Path2D());
    const path = paths.get(colour);
    path.moveTo(points[0].left, points[0].top);
    points.slice(1).forEach((point) => path.lineTo(point.left, point.top));
    segments += points.length - 1;
  }
  // many lines are a fabric, in which each is faint
  context.globalAlpha = segments <= 60 ? 0.75 : segments <= 1500 ? 0.3 : 0.1;
  context.lineWidth = segments <= 60 ? 1.5 : 1;
  for (const [colour, path] of paths) {
    context.strokeStyle = colour;
    context.stroke(path);
  }
  context.globalAlpha = 1;
}

/** Whiskers from quartile to quartile. Of very many points only those on the front have them: the others would be a hatching. */
function drawWhiskers(context, panel) {
  const all = panel.inside.length <= 800;
  for (const point of panel.points) {
    if (!all && !point.isFront) continue;
    const { lower, upper } = spread(plot.x.column, point.cell);
    if (lower === null || upper === null) continue;
    const [from, to] = [lower, upper].map((value) => panel.chart.valToPos(plot.x.place(value), "x"));
    if (to - from < 2) continue;
    context.globalAlpha = 0.55;
    const [{ top }, colour] = [point, colourOf(point.cell)];
    stroke(context, [[from, top], [to, top]], colour, 1.2);
    stroke(context, [[from, top - 3], [from, top + 3]], colour, 1.2);
    stroke(context, [[to, top - 3], [to, top + 3]], colour, 1.2);
    context.globalAlpha = 1;
  }
}

/** All points of one look are one path: 10 000 points take a dozen strokes. Those of the front come last, and larger. */
function drawPoints(context, panel, radius) {
  for (const isFront of [false, true]) {
    const looks = new Map();
    for (const point of panel.points) {
      if (point.isFront !== isFront) continue;
      const key = `${chains.of[point.cell]},${adapters.of[point.cell]},${point.isFaulty}`;
      if (!looks.has(key)) looks.set(key, { colour: colourOf(point.cell), isFaulty: point.isFaulty, path: new Path2D(), arrows: new Path2D() });
      const { path, arrows } = looks.get(key);
      // (a smaller cross could not be seen)
      const size = isFront ? radius + 1.2 : point.isFaulty ? Math.max(radius, 3) : radius;
      addMarker(path, shapeOfAdapter(adapters.of[point.cell]), point.left, point.top, size);
      if (point.isFaulty) addCross(path, point.left, point.top, size);
      addArrow(arrows, point, size);
    }
    for (const { colour, isFaulty, path, arrows } of looks.values()) {
      context.fillStyle = context.strokeStyle = colour;
      context.fill(arrows);
      context.lineWidth = radius < 3 ? 0.9 : 1.2;
      if (isFaulty) {
        context.stroke(path);
        continue;
      }
      context.globalAlpha = isFront || panel.inside.length < 2000 ? 1 : 0.55;
      context.fill(path);
      context.globalAlpha = 1;
      context.strokeStyle = isFront ? "#1d2430" : "#ffffff";
      if (isFront || panel.inside.length <= 600) context.stroke(path);
    }
  }
}

/** A small arrow beyond a point that is drawn at a limit: where it is really cannot be seen. */
function addArrow(path, point, size) {
  const { x, y } = plot;
  const arrow = (dx, dy) => {
    const [left, top] = [point.left + dx * (size + 6), point.top + dy * (size + 6)];
    path.moveTo(left, top);
    path.lineTo(left - 4 * dx - 3.5 * dy, top - 4 * dy - 3.5 * dx);
    path.lineTo(left - 4 * dx + 3.5 * dy, top - 4 * dy + 3.5 * dx);
    path.closePath();
  };
  if (point.error < y.least) arrow(0, 1);
  if (point.error > LARGEST) arrow(0, -1);
  if (point.cost < x.least) arrow(-1, 0);
  if (point.cost > LARGEST) arrow(1, 0);
}

// ---------------------------------------------------------------------------------------------------------------------
// Words in the plot: names of the lines across it, labels of the front

/** They come last, above all points, and none hides a point, a front or another one. */
function drawWords(context, chart, panel, width, height, radius) {
  const taken = new Crowd();
  for (const { left, top } of panel.inside) taken.add(left - radius, top - radius, left + radius, top + radius);
  for (const { points } of panel.fronts) alongFront(points, (left, top) => taken.add(left - 4, top - 4, left + 4, top + 4));
  context.textAlign = "left";
  context.textBaseline = "middle";
  drawLimitNames(context, chart, taken, width, height);
  drawLabels(context, panel, taken, width, height, radius);
  context.textBaseline = "alphabetic";
}

/** What the lines across the plot are; these names are written in any case, if possible where there is room. */
function drawLimitNames(context, chart, taken, width, height) {
  context.font = "11px system-ui, sans-serif";
  const write = (limit, places) => {
    const boxes = places.map(([left, middle]) => [left - 3, middle - 7, left + context.measureText(limit.words).width + 3, middle + 7]);
    const box = boxes.find((box) => !taken.meets(...box)) ?? boxes[0];
    taken.add(...box);
    writeOver(context, limit.words, box[0] + 3, box[1] + 7, limit.colour);
  };
  for (const limit of limits(plot.y, plot.target)) {
    const top = chart.valToPos(limit.at, "y");
    // a part of the plot that somebody has chosen may not have it
    if (top < 0 || top > height) continue;
    const [left, right] = [6, width - context.measureText(limit.words).width - 6];
    write(limit, [[right, top - 9], [right, top + 10], [left, top - 9], [left, top + 10], [(left + right) / 2, top - 9]]);
  }
  for (const limit of limits(plot.x, null)) {
    const left = chart.valToPos(limit.at, "x") - context.measureText(limit.words).width - 6;
    if (left < 0 || left > width) continue;
    write(limit, [[left, height - 10], [left, 10]]);
  }
}

/** What a point is called in the plot: the colour says which chain it is and the panel which scene, so the rest is enough if there is one. */
function shortLabel(cell, most) {
  const name = data.details[cell]?.short || text("chain", cell);
  return name.length > most ? `${name.slice(0, most - 1)}…` : name;
}

/** Writes the labels that fit, and leaves out the others. */
function drawLabels(context, panel, taken, width, height, radius) {
  const most = width > 700 ? 48 : 30;
  context.font = "11.5px system-ui, sans-serif";
  const front = panel.inside.filter((point) => point.isFront).sort((a, b) => a.left - b.left);
  for (const point of endsFirst(front)) {
    const label = shortLabel(point.cell, most);
    const place = findPlace(taken, point, context.measureText(label).width, width, height, radius);
    if (!place) continue;
    taken.add(...place.box);
    writeOver(context, label, place.left, place.middle, colourOf(point.cell));
  }
}

/** Where a label has room: first on the side of the front where no point can be, since it would beat those of the front. */
function findPlace(taken, point, textWidth, width, height, radius) {
  const gap = radius + 6;
  const free = isMore(plot.y.column) ? -1 : 1;
  const places = [[-1, 1], [-1, 0], [0, 1.7], [1, 1], [1, 0], [-1, -1], [1, -1], [0, 3], [0, -1.7], [0, -3]];
  // over or under a point, a label may be moved away from the plot's edge
  const centred = Math.max(4, Math.min(point.left - textWidth / 2, width - textWidth - 4));
  for (const [side, down] of places) {
    const left = side === 0 ? centred : side < 0 ? point.left - gap - textWidth : point.left + gap;
    const middle = point.top + down * free * (side === 0 ? gap : 9);
    const box = [left - 2, middle - 7, left + textWidth + 2, middle + 7];
    const isInside = box[0] >= 0 && box[2] <= width && box[1] >= 0 && box[3] <= height;
    if (isInside && !taken.meets(...box)) return { left, middle, box };
  }
  return null;
}

/** Calls `visit` every few pixels along a front. */
function alongFront(points, visit) {
  points.slice(1).forEach((to, index) => {
    const from = points[index];
    const steps = Math.ceil(Math.hypot(to.left - from.left, to.top - from.top) / 8);
    for (let step = 0; step <= steps; step++) {
      visit(from.left + ((to.left - from.left) * step) / steps, from.top + ((to.top - from.top) * step) / steps);
    }
  });
}

/** Ends, then the middle, then the middles between: if only some labels fit, they are spread over the front. */
function endsFirst(list) {
  const [order, left] = [[], new Set(list.keys())];
  const take = (index) => left.delete(index) && order.push(list[index]);
  for (let step = Math.max(list.length - 1, 1); left.size > 0; step /= 2) {
    for (let at = 0; at <= list.length - 1; at += Math.max(step, 1)) take(Math.round(at));
    if (step < 1) left.forEach(take);
  }
  return order;
}

/** Rectangles that must not be covered, sorted into squares so that asking is quick. */
class Crowd {
  #squares = new Map();

  #visit(left, top, right, bottom, visit) {
    const size = 32;
    for (let x = Math.floor(left / size); x <= Math.floor(right / size); x++) {
      for (let y = Math.floor(top / size); y <= Math.floor(bottom / size); y++) {
        if (visit(`${x},${y}`)) return true;
      }
    }
    return false;
  }

  add(...box) {
    this.#visit(...box, (square) => {
      if (!this.#squares.has(square)) this.#squares.set(square, []);
      this.#squares.get(square).push(box);
      return false;
    });
  }

  meets(left, top, right, bottom) {
    const overlaps = (box) => box[0] < right && box[2] > left && box[1] < bottom && box[3] > top;
    return this.#visit(left, top, right, bottom, (square) => (this.#squares.get(square) ?? []).some(overlaps));
  }
}

// ---------------------------------------------------------------------------------------------------------------------
// What stands under the plot

function showKeys() {
  const stripe = (style) => {
    const element = make("i");
    element.style.cssText = `display:inline-block;width:26px;${style}`;
    return element;
  };
  const keys = [];
  const several = adapters.values.length > 1;
  adapters.values.forEach((adapter, level) => {
    const name = several ? `front of ${adapter}` : "front: nothing that is shown beats these in both";
    keys.push(make("span", {}, stripe(`height:8px;border-radius:4px;background:${frontColour(level)}`), name));
  });
  if (plot && columns.has(`${state.cost}_q1`)) keys.push(make("span", {}, "├─┤ quartiles"));
  keys.push(make("span", {}, markerIcon("circle", "#5d6878", true), "faulty: never on the front"));
  if (plot && state.along !== "none" && lines.length > 0) keys.push(make("span", {}, stripe("border-top:1.5px solid #8b96a5"), "differ in one axis"));
  keys.push(make("span", {}, "Click pins a point, a second one compares, Escape lets go. Drag zooms."));
  byId("keys").replaceChildren(...keys);
  byId("notes").replaceChildren(...notes().map((note) => make("li", {}, note)));
}

/** What the plot does not show as it is. */
function notes() {
  if (!plot) return [];
  const { x, y } = plot;
  const points = plot.panels.flatMap((panel) => panel.points);
  const list = [];
  const add = (count, one, many) => count > 0 && list.push(count === 1 ? `One cell ${one}` : `${grouped(count)} cells ${many}`);
  for (const [scale, key] of [[y, "error"], [x, "cost"]]) {
    const { title, unit } = scale.column;
    const below = points.filter((point) => point[key] < scale.least).length;
    const least = unit === "px" ? `less than ${tickText(scale.least)} px of` : "0 or less of";
    const where = "drawn at the dotted line with an arrow: it has no place on this axis.";
    add(below, `has ${least} ${title} and is ${where}`, `have ${least} ${title} and are ${where.replace("it has", "they have")}`);
    const above = points.filter((point) => point[key] > LARGEST).length;
    add(above, `has infinite ${title} and is ${where}`, `have infinite ${title} and are ${where.replace("it has", "they have")}`);
  }
  const neither = `no point: ${y.column.title} or ${x.column.title} was not measured.`;
  add(plot.unmeasured, `has ${neither}`, `have ${neither}`);
  if (plot.hiddenPanels > 0) list.push(`${grouped(plot.hiddenPanels)} more scenes have no panel here: the filter of scenes chooses them.`);
  return list;
}

const MOST_FAILED_OPEN = 20;
const MOST_FAILED_LISTED = 300;

function showFailed() {
  const failed = state.shown.filter((cell) => text("status", cell) === "failed");
  const home = byId("failed");
  home.hidden = failed.length === 0;
  home.open = failed.length <= MOST_FAILED_OPEN;
  home.firstElementChild.textContent = `${plural(failed.length, "cell has", "cells have")} failed and no figures`;
  const item = (cell) => {
    const place = [text("scene", cell), adapters.values.length > 1 ? text("adapter", cell) : ""].filter(Boolean).join(", ");
    const why = make("span", { className: "why" }, `${place ? ` (${place})` : ""}: ${text("why", cell) || "no reason is known"}`);
    return make("li", {}, markerIcon("square", colourOf(cell)), " ", text("label", cell), why);
  };
  const items = failed.slice(0, MOST_FAILED_LISTED).map(item);
  if (failed.length > MOST_FAILED_LISTED) items.push(make("li", {}, `and ${grouped(failed.length - MOST_FAILED_LISTED)} more, which the table has`));
  home.lastElementChild.replaceChildren(...items);
}

// ---------------------------------------------------------------------------------------------------------------------
// The pointer

/** How near the pointer has to come to a point. */
const REACH = 24;

function listenTo(panel) {
  const over = panel.chart.over;
  let pressed = null;
  const nearest = (event) => {
    const box = over.getBoundingClientRect();
    return nearestPoint(panel, event.clientX - box.left, event.clientY - box.top);
  };
  over.addEventListener("mousemove", (event) => hover(event.buttons === 0 ? nearest(event) : null, panel));
  over.addEventListener("mouseleave", () => hover(null, panel));
  over.addEventListener("mousedown", (event) => (pressed = [event.clientX, event.clientY]));
  over.addEventListener("click", (event) => {
    const isDrag = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) > 4;
    const point = isDrag ? null : nearest(event);
    if (point) togglePin(point.cell);
  });
}

/** The point that is meant; of several in one place one of the front, since that is the one on top. */
function nearestPoint(panel, left, top) {
  let [best, least] = [null, REACH];
  for (const point of panel.points) {
    const distance = Math.hypot(point.left - left, point.top - top);
    if (distance < least || (distance === least && best && point.isFront && !best.isFront)) [best, least] = [point, distance];
  }
  return best;
}

function hover(point, panel) {
  const cell = point ? point.cell : null;
  panel.chart.over.classList.toggle("on-point", point !== null);
  if (cell === state.hovered) return;
  state.hovered = cell;
  showRings();
  if (cell === null) byId("card").hidden = true;
  else showCard(cell, clientPlace(panel, point));
}

/** Where a point is in the window. */
function clientPlace(panel, point) {
  const box = panel.chart.over.getBoundingClientRect();
  return { x: box.left + point.left, y: box.top + point.top };
}

function findPoint(cell) {
  for (const panel of plot?.panels ?? []) {
    const point = panel.byCell?.get(cell);
    if (point) return { panel, point };
  }
  return null;
}

/** Rings around the point under the pointer and those that are pinned. They are elements, so that nothing has to be drawn anew. */
function showRings() {
  for (const panel of plot?.panels ?? []) panel.element?.querySelectorAll(".ring").forEach((ring) => ring.remove());
  const ring = (cell, className, letter) => {
    const found = findPoint(cell);
    if (!found) return;
    const element = make("div", { className: `ring ${className}`, "data-letter": letter });
    element.style.left = `${found.point.left}px`;
    element.style.top = `${found.point.top}px`;
    found.panel.chart.over.append(element);
  };
  if (state.hovered !== null) ring(state.hovered, "", "");
  state.pinned.forEach((cell, index) => ring(cell, `pin ${"ab"[index]}`, "AB"[index]));
}

function showCard(cell, place) {
  const [errorColumn, costColumn] = [columns.get(state.error), columns.get(state.cost)];
  const cost = spread(costColumn, cell);
  const status = text("status", cell);
  const where = [text("scene", cell), text("adapter", cell)].filter(Boolean).join(" · ");
  const picture = finalPicture(cell);
  const row = (name, ...content) => [make("dt", {}, name), make("dd", {}, ...content)];
  byId("card").replaceChildren(
    make("div", { className: "label" }, markerIcon("circle", colourOf(cell)), " ", text("label", cell)),
    make("div", { className: "where" }, where),
    make("dl", {},
      row(errorColumn.title, withUnit(errorColumn, number(errorColumn, cell))),
      row(costColumn.title, withUnit(costColumn, cost.median), " ", make("span", { className: "quartiles" }, quartileText(cost))),
      row("cell", make("span", { className: "hash" }, text("cell", cell)))),
    status === "ok" ? "" : make("div", { className: "bad" }, [status, text("why", cell)].filter(Boolean).join(": ")),
    picture ? makePicture(picture[1], picture[0]) : "",
  );
  placeCard(place);
}

/** Beside the point, on the side where there is room. */
function placeCard({ x, y }) {
  const card = byId("card");
  card.hidden = false;
  const [width, height] = [card.offsetWidth, card.offsetHeight];
  const left = x + 18 + width < window.innerWidth ? x + 18 : x - 18 - width;
  const top = Math.min(y + 14, window.innerHeight - height - 8);
  card.style.left = `${Math.max(8, left)}px`;
  card.style.top = `${Math.max(8, top)}px`;
  // a picture that comes later makes the card higher
  const image = card.querySelector("img");
  if (image && !image.complete) image.onload = () => !card.hidden && placeCard({ x, y });
}

// ---------------------------------------------------------------------------------------------------------------------
// Pictures

const picturesOf = (cell) => data.details[cell]?.pictures ?? [];
const finalPicture = (cell) => picturesOf(cell).find(([kind]) => kind === "final image") ?? picturesOf(cell)[0] ?? null;
const pictureOfKind = (cell, kind) => picturesOf(cell).find(([known]) => known === kind)?.[1] ?? null;

/** A picture, or the words that it is not there: a page can be moved without the folder beside it. */
function makePicture(source, name, className = "") {
  const image = make("img", { src: source, alt: name, className });
  image.onerror = () => image.replaceWith(make("div", { className: "missing" }, `${name}: the picture ${source.slice(0, 80)} is not there`));
  return image;
}

// ---------------------------------------------------------------------------------------------------------------------
// Pinned cells

function togglePin(cell) {
  if (state.pinned.includes(cell)) state.pinned = state.pinned.filter((other) => other !== cell);
  // the first one stays, so that many can be compared with it
  else state.pinned = [...state.pinned.slice(0, 1), cell];
  showPinned();
}

function unpinAll() {
  state.pinned = [];
  showPinned();
}

function showPinned() {
  const home = byId("pinned");
  const cells = state.pinned;
  home.hidden = cells.length === 0;
  showRings();
  showPinBar();
  markPinnedRows();
  if (cells.length === 0) {
    home.replaceChildren();
    return;
  }
  const heads = make("div", { className: "pin-heads" }, cells.map(pinHead));
  const body = make("div", { className: "pin-body" },
    make("div", {}, pictureBlock(cells), kernelBlock(cells), planBlock(cells)),
    make("div", {}, factBlock(cells)));
  const title = cells.length === 2 ? "Two cells compared" : "One cell";
  home.replaceChildren(make("h2", {}, title), heads, body);
}

const letter = (index) => make("span", { className: `letter ${"ab"[index]}` }, "AB"[index]);

function pinHead(cell, index) {
  const status = text("status", cell);
  const where = [text("scene", cell), text("adapter", cell)].filter(Boolean).join(" · ");
  const unpin = make("button", { type: "button", className: "plain", textContent: "unpin" });
  unpin.onclick = () => togglePin(cell);
  const warnings = data.details[cell]?.warnings ?? [];
  return make("div", { className: `pin-head ${"ab"[index]}` },
    make("div", { className: "label" }, letter(index), " ", text("label", cell)),
    make("div", {}, where, where ? " · " : "", make("span", { className: "hash" }, text("cell", cell)), " ", unpin),
    status === "ok" ? "" : make("div", { className: "bad" }, [status, text("why", cell)].filter(Boolean).join(": ")),
    warnings.length === 0 ? "" : make("ul", {}, warnings.map((warning) => make("li", {}, warning))));
}

/** A bar at the window's edge: who pins cells far down in the table sees that something has happened. */
function showPinBar() {
  const bar = byId("pinbar");
  bar.hidden = state.pinned.length === 0;
  const show = make("button", { type: "button", textContent: state.pinned.length === 2 ? "Compare" : "Show" });
  show.onclick = () => byId("pinned").scrollIntoView({ behavior: "smooth" });
  const unpin = make("button", { type: "button", textContent: "Unpin (Esc)" });
  unpin.onclick = unpinAll;
  const names = state.pinned.flatMap((cell, index) => [letter(index), make("span", { className: "label" }, text("label", cell))]);
  bar.replaceChildren(...names, show, unpin);
}

/** Pictures of one cell below one another, or of two cells over one another with an edge to draw. */
function pictureBlock(cells) {
  const kinds = [...new Set(cells.flatMap((cell) => picturesOf(cell).map(([kind]) => kind)))];
  if (kinds.length === 0) {
    const none = make("p", { className: "missing" }, "There are none.");
    return make("div", {}, make("h3", {}, "Pictures"), none);
  }
  const kind = kinds.includes(state.picture) ? state.picture : kinds.includes("final image") ? "final image" : kinds[0];
  const options = kinds.map((name) => make("option", { value: name, selected: name === kind }, name));
  const select = make("select", { id: "picture-kind", "aria-label": "Kind of picture" }, options);
  const frame = make("div", { className: "pictures" });
  const show = () => frame.replaceChildren(cells.length === 2 ? wipe(cells, select.value) : single(cells[0], select.value));
  select.onchange = () => {
    state.picture = select.value;
    show();
  };
  show();
  return make("div", {}, make("h3", {}, "Pictures ", select), frame);
}

function single(cell, kind) {
  return make("figure", {}, makePicture(pictureOfKind(cell, kind), kind));
}

function wipe(cells, kind) {
  const sources = cells.map((cell) => pictureOfKind(cell, kind));
  const lacking = sources.indexOf(null);
  const frame = make("div", { className: "wipe" });
  if (lacking >= 0) {
    const other = 1 - lacking;
    frame.append(makePicture(sources[other], kind), letter(other));
    return make("div", {}, frame, make("p", { className: "missing" }, `${"AB"[lacking]} has no picture of this kind.`));
  }
  const slider = make("input", { type: "range", min: 0, max: 100, step: 0.1, value: state.wipe, "aria-label": "How much of A is seen" });
  const move = () => {
    state.wipe = Number(slider.value);
    frame.style.setProperty("--at", `${state.wipe}%`);
  };
  slider.oninput = move;
  move();
  frame.append(makePicture(sources[0], `A, ${kind}`), makePicture(sources[1], `B, ${kind}`, "over"));
  frame.append(make("div", { className: "edge" }), letter(0), letter(1), slider);
  return frame;
}

function planBlock(cells) {
  const plans = cells.map((cell) => data.plans?.[data.details[cell]?.plan] ?? null);
  const isSame = cells.length === 2 && plans[0] !== null && plans[0] === plans[1];
  const one = (plan, title) => (plan === null ? null : make("details", {}, make("summary", {}, title), make("pre", {}, plan)));
  if (isSame) return make("div", {}, one(plans[0], "Plan (the same of both)"));
  return make("div", {}, plans.map((plan, index) => one(plan, cells.length === 2 ? `Plan of ${"AB"[index]}` : "Plan")));
}

/** Times of kernels as bars, side by side where both cells have the step. */
function kernelBlock(cells) {
  const rows = new Map();
  cells.forEach((cell, index) => {
    const detail = data.details[cell];
    const seen = new Map();
    (data.kernel_sets?.[detail?.kernel_set] ?? []).forEach((kernel, at) => {
      const name = kernel.step ? `${kernel.stage} / ${kernel.step}` : kernel.stage;
      // a stage can stand in a chain twice
      const count = (seen.get(name) ?? 0) + 1;
      seen.set(name, count);
      const key = `${kernelGroup(kernel)}|${name}|${count}`;
      if (!rows.has(key)) rows.set(key, { group: kernelGroup(kernel), name, times: cells.map(() => undefined) });
      rows.get(key).times[index] = detail.kernel_ms?.[at] ?? null;
    });
  });
  if (rows.size === 0) return null;
  const list = [...rows.values()];
  const element = make("div", { className: "kernels" });
  for (const group of ["each frame", "each frame, after the surface", "once a cell"]) {
    const own = list.filter((row) => row.group === group);
    const largest = Math.max(1e-9, ...own.flatMap((row) => row.times.map((time) => time?.[2] ?? time?.[0] ?? 0)));
    if (own.length > 0) element.append(make("div", { className: "group" }, group));
    for (const row of own) {
      // a cell whose chain has no such step has no bar; the colours say which one has
      const bars = row.times.map((time, index) => (time === undefined ? null : kernelBar(time, index, largest)));
      element.append(make("div", { className: "name" }, row.name), make("div", {}, bars));
    }
  }
  return make("div", {}, make("h3", {}, "Kernel times, ms"), element);
}

function kernelGroup(kernel) {
  if (kernel.once) return "once a cell";
  return kernel.after_surface ? "each frame, after the surface" : "each frame";
}

/** `time` is `[median, lower quartile, upper quartile]`, `null` if it was not measured. */
function kernelBar(time, index, largest) {
  const bar = make("div", { className: `bar ${"ab"[index]}` });
  const share = (value) => `${((72 * value) / largest).toFixed(2)}%`;
  const say = (words, left) => {
    const label = make("span", {}, words);
    label.style.left = left;
    bar.append(label);
  };
  if (!time) {
    say("not measured", "0");
    return bar;
  }
  const [median, lower, upper] = time;
  const body = make("i");
  body.style.width = share(median);
  bar.append(body);
  if (typeof lower === "number" && typeof upper === "number") {
    const whisker = make("s");
    whisker.style.left = share(lower);
    whisker.style.width = share(upper - lower);
    bar.append(whisker);
  }
  say(digits(median), share(Math.max(median, upper ?? 0)));
  bar.title = `${median} ms ${quartileText({ lower: lower ?? null, upper: upper ?? null })}`;
  return bar;
}

const ROLE_NAMES = { id: "Which cell", axis: "Axes", error: "Errors", cost: "Costs", spread: "Quartiles", figure: "Figures", about: "About the run" };

/** All figures of one cell, or what is different between two. */
function factBlock(cells) {
  const isCompared = cells.length === 2;
  const rows = [];
  let differing = 0;
  for (const role of Object.keys(ROLE_NAMES)) {
    // quartiles stand beside their medians; what a cell is called, and what is wrong with it, stands above
    const own = withRole(role).filter((column) => role !== "spread" && !["cell", "label", "why"].includes(column.name));
    const told = own.filter((column) => isWorthTelling(column, cells));
    if (told.length === 0) continue;
    differing += told.length;
    rows.push(make("tr", { className: "role" }, make("th", { colSpan: isCompared ? 4 : 2 }, ROLE_NAMES[role])));
    rows.push(...told.map((column) => factRow(column, cells)));
  }
  const heading = isCompared ? `What differs (${differing})` : "Figures";
  const head = make("tr", {}, make("th"), make("th", {}, letter(0)), make("th", {}, letter(1)), make("th", {}, "B / A"));
  const table = make("table", { id: "facts" }, isCompared ? make("thead", {}, head) : "", make("tbody", {}, rows));
  return make("div", {}, make("h3", {}, heading), make("div", { className: "facts" }, table));
}

function isWorthTelling(column, cells) {
  const values = cells.map((cell) => column.values[cell]);
  return cells.length === 2 ? values[0] !== values[1] : values[0] !== null && values[0] !== "";
}

function factRow(column, cells) {
  const cellOf = (cell) => {
    const value = column.values[cell];
    const quartiles = isNumeric(column) ? quartileText(spread(column, cell)) : "";
    const content = [shownValue(column, value), quartiles ? make("span", { className: "quartiles" }, ` ${quartiles}`) : ""];
    return make("td", { title: fullText(column, value) }, content);
  };
  const head = make("th", { className: "text", title: column.meaning ?? "" }, titled(column));
  const row = make("tr", { "data-column": column.name }, head, cells.map(cellOf));
  if (cells.length === 2) row.append(make("td", { className: "ratio" }, ratioText(column, cells)));
  return row;
}

/** How many times as much the second has; of costs and errors only, since a ratio of settings or decibels says nothing. */
function ratioText(column, cells) {
  if (!["cost", "error"].includes(column.role) || isMore(column)) return "";
  const [a, b] = cells.map((cell) => number(column, cell));
  if (a === null || b === null || a === 0 || !Number.isFinite(a) || !Number.isFinite(b)) return "";
  return `× ${digits(b / a)}`;
}

// ---------------------------------------------------------------------------------------------------------------------
// The table

/** More rows than a screen has, and few enough to be drawn at once. */
const ROWS_A_PAGE = 100;

/** Columns in which any row has a value. */
const filledColumns = data.columns.filter((column) => column.values.some((value) => value !== null && value !== ""));

/** What is in the table before somebody chooses: quartiles, what is the same of all cells, and what stands elsewhere is only in the way. */
function defaultTableColumns() {
  const isInLabel = everyCell.every((cell) => text("label", cell).startsWith(text("chain", cell)));
  const isOfInterest = (column) => ["id", "axis", "error", "cost"].includes(column.role);
  const isTold = (column) => column.name === "why" || (column.name === "chain" && isInLabel);
  const isUseful = (column) => ["cell", "label"].includes(column.name) || column.values.some((value) => value !== column.values[0]);
  return new Set(filledColumns.filter((column) => isOfInterest(column) && isUseful(column) && !isTold(column)).map((column) => column.name));
}

/** What a cell is called comes first and its hash last of what says which cell it is. */
function tableColumns() {
  const order = ["label", "chain", "scene", "adapter", "status", "why", "cell"];
  const rank = (column) => (order.includes(column.name) ? order.indexOf(column.name) : order.length);
  return filledColumns.filter((column) => state.tableColumns.has(column.name)).sort((a, b) => rank(a) - rank(b));
}

function sortedCells() {
  const column = columns.get(state.sort.column);
  if (!column) return state.shown;
  const sign = state.sort.descending ? -1 : 1;
  const isMissing = (value) => value === null || value === "";
  return [...state.shown].sort((a, b) => {
    const [x, y] = [column.values[a], column.values[b]];
    // what was not measured comes last both ways
    if (isMissing(x) || isMissing(y)) return isMissing(x) - isMissing(y) || a - b;
    return sign * compareValues(x, y) || a - b;
  });
}

function showTable() {
  const shownColumns = tableColumns();
  const cells = sortedCells();
  const last = Math.max(0, Math.ceil(cells.length / ROWS_A_PAGE) - 1);
  state.page = Math.min(state.page, last);
  const first = state.page * ROWS_A_PAGE;
  const table = byId("cells");
  table.tHead.replaceChildren(make("tr", {}, shownColumns.map(headCell)));
  table.tBodies[0].replaceChildren(...cells.slice(first, first + ROWS_A_PAGE).map((cell) => tableRow(cell, shownColumns)));
  showPages(first, cells.length, last);
  markPinnedRows();
}

function headCell(column) {
  const isSorted = state.sort.column === column.name;
  const arrow = isSorted ? (state.sort.descending ? " ▼" : " ▲") : "";
  const button = make("button", { type: "button" }, breakable(column.title), arrow, column.unit ? make("small", {}, column.unit) : "");
  button.onclick = () => sortBy(column.name);
  const title = [column.meaning, column.unit ? `Unit: ${column.unit}.` : "", isMore(column) ? "More is better." : ""].filter(Boolean).join(" ");
  const sort = isSorted ? (state.sort.descending ? "descending" : "ascending") : "none";
  return make("th", { title, scope: "col", className: isNumeric(column) ? "" : "text", "data-column": column.name, "aria-sort": sort }, button);
}

function sortBy(name) {
  state.sort = { column: name, descending: state.sort.column === name && !state.sort.descending };
  state.page = 0;
  showTable();
  // the header was made anew, and who sorts by keyboard wants to stay on it
  document.querySelector(`#cells th[data-column="${CSS.escape(name)}"] button`)?.focus({ preventScroll: true });
}

function tableRow(cell, shownColumns) {
  const row = make("tr", { className: text("status", cell), "data-cell": String(cell) });
  for (const column of shownColumns) {
    const value = column.values[cell];
    const isLong = ["label", "why"].includes(column.name);
    const className = [isNumeric(column) ? "" : "text", isLong ? "long" : ""].join(" ").trim();
    let content = shownValue(column, value);
    if (column.name === "cell") content = make("button", { type: "button", className: "plain hash", title: "Pin this cell" }, content);
    if (column.name === "label") content = [markerIcon("circle", colourOf(cell), row.className === "faulty"), " ", content];
    const title = column.name === "status" && text("why", cell) ? text("why", cell) : fullText(column, value);
    row.append(make("td", { className, title }, ...[content].flat()));
  }
  return row;
}

function markPinnedRows() {
  for (const row of byId("cells").tBodies[0].rows) {
    const index = state.pinned.indexOf(Number(row.dataset.cell));
    row.classList.toggle("a", index === 0);
    row.classList.toggle("b", index === 1);
  }
}

function showPages(first, count, last) {
  const button = (words, page, name) => {
    const disabled = page < 0 || page > last || page === state.page;
    const element = make("button", { type: "button", textContent: words, "aria-label": name, disabled });
    element.onclick = () => {
      state.page = page;
      showTable();
    };
    return element;
  };
  const range = count === 0 ? "no cells" : `${grouped(first + 1)}–${grouped(Math.min(first + ROWS_A_PAGE, count))} of ${grouped(count)}`;
  const buttons = last === 0 ? [[], []] : [
    [button("«", 0, "First page"), button("‹", state.page - 1, "Previous page")],
    [button("›", state.page + 1, "Next page"), button("»", last, "Last page")],
  ];
  byId("pages").replaceChildren(...buttons[0], range, ...buttons[1]);
}

function listenToTable() {
  const body = byId("cells").tBodies[0];
  const cellOf = (event) => {
    const row = event.target.closest("tr[data-cell]");
    return row ? Number(row.dataset.cell) : null;
  };
  body.addEventListener("click", (event) => {
    // who marks text in order to copy it does not mean to pin
    const cell = cellOf(event);
    if (cell !== null && String(window.getSelection()) === "") togglePin(cell);
  });
  body.addEventListener("mouseover", (event) => {
    state.hovered = cellOf(event);
    showRings();
  });
  body.addEventListener("mouseleave", () => {
    state.hovered = null;
    showRings();
  });
}

function buildChooser() {
  const groups = Object.entries(ROLE_NAMES).map(([role, name]) => {
    const boxes = filledColumns.filter((column) => column.role === role).map((column) => {
      const input = make("input", { type: "checkbox", checked: state.tableColumns.has(column.name) });
      input.onchange = () => {
        if (input.checked) state.tableColumns.add(column.name);
        else state.tableColumns.delete(column.name);
        showTable();
      };
      return make("label", { title: column.meaning ?? "" }, input, " ", column.title);
    });
    return boxes.length === 0 ? null : make("fieldset", {}, make("legend", {}, name), boxes);
  });
  byId("chooser").lastElementChild.append(...groups.filter(Boolean));
}

// ---------------------------------------------------------------------------------------------------------------------
// Choices above the plot, and the start

function buildSelects() {
  const option = (column) => make("option", { value: column.name, title: column.meaning ?? "" }, titled(column));
  const hasValue = (column) => filledColumns.includes(column);
  const group = (label, list) => (list.length === 0 ? null : make("optgroup", { label }, list.map(option)));
  const [errors, costs] = [withRole("error").filter(hasValue), withRole("cost").filter(hasValue)];
  const isLess = (column) => !isMore(column);
  const errorGroups = [group("less is better", errors.filter(isLess)), group("more is better", errors.filter(isMore))];
  byId("error").append(...errorGroups.filter(Boolean));
  const isCold = (column) => COLD.has(column.name);
  const isTime = (column) => column.unit === "ms";
  const costGroups = [
    group("warm, each frame", costs.filter((column) => isTime(column) && !isCold(column))),
    group("cold, once a cell", costs.filter(isCold)),
    group("amounts", costs.filter((column) => !isTime(column) && !isCold(column))),
  ];
  byId("cost").append(...costGroups.filter(Boolean));
  const axes = [...new Set(lines.map((line) => line.axis))].map((name) => columns.get(name));
  byId("along").append(make("option", { value: "every" }, "every axis"), make("option", { value: "none" }, "no axis"), ...axes.map(option));
  byId("along-label").hidden = axes.length === 0;
  for (const name of ["error", "cost", "along"]) {
    const select = byId(name);
    if (state[name] !== null) select.value = state[name];
    state[name] = select.value || null;
    select.onchange = () => {
      state[name] = select.value;
      // another column has other numbers, so the part that was seen means nothing
      if (name !== "along") state.zoom = null;
      drawPlot();
    };
  }
  byId("reset-zoom").onclick = () => setZoom(null);
}

/** Computes and draws everything that depends on the filters. */
function update() {
  state.shown = cellsShown();
  byId("count").textContent = `${grouped(state.shown.length)} of ${plural(cellCount, "cell", "cells")} shown`;
  byId("reset-filters").hidden = state.shown.length === cellCount;
  drawPlot();
  showFailed();
  showTable();
}

function redrawWhenWidthChanges() {
  let width = byId("plots").clientWidth;
  new ResizeObserver(() => {
    if (byId("plots").clientWidth === width) return;
    width = byId("plots").clientWidth;
    drawPlot();
  }).observe(byId("plots"));
}

function start() {
  byId("title").textContent = data.title;
  byId("about").textContent = data.about ?? "";
  byId("equal-section").hidden = byId("equal").childElementCount === 0;
  state.tableColumns = defaultTableColumns();
  buildSelects();
  buildFilters();
  buildChooser();
  listenToTable();
  document.addEventListener("keydown", (event) => {
    if (event.key === "Escape") unpinAll();
  });
  update();
  redrawWhenWidthChanges();
}

/** What tests ask: where a cell's point is in the window and in which panel, or `null` if it has none. */
function pointAt(cell) {
  const found = findPoint(cell);
  if (!found) return null;
  return { ...clientPlace(found.panel, found.point), panel: plot.panels.indexOf(found.panel) };
}

start();
window.lodlab = { data, state, shown: () => [...state.shown], pointAt };
})();
