// Drives a report's page as a person would, and writes down what it shows.
//
// A test puts this file into a script element at the end of the body of a copy of report.html, lets a browser load it without a window
// (chromium --headless=new --virtual-time-budget=10000 --dump-dom), and reads the JSON in the element "test-result", a pre at the very end.
// What is expected is the test's business, since it has the records: here nothing is judged, except that "problems" has what could not be
// done at all.
(async () => {
"use strict";

const problems = [];
window.addEventListener("error", (event) => problems.push(`error: ${event.message}`));
window.addEventListener("unhandledrejection", (event) => problems.push(`error: ${event.reason}`));
document.addEventListener("securitypolicyviolation", (event) => problems.push(`asks for ${event.blockedURI} (${event.effectiveDirective})`));

const result = { problems };
// if there is none, the page's script has not come to its end, and `drive` says so
const { data, state, shown, pointAt } = window.lodlab ?? {};

const byId = (id) => document.getElementById(id);
const words = (element) => (element ? element.textContent.replace(/\s+/g, " ").trim() : null);
const column = (name) => data.columns.find((known) => known.name === name);
const value = (name, cell) => column(name)?.values[cell] ?? null;
const hash = (cell) => value("cell", cell);
/** Until what was asked for is drawn: uPlot draws a little later than it is told to. */
const settle = () => new Promise((resolve) => setTimeout(resolve, 60));

function overOf(place) {
  return document.querySelectorAll("#plots .panel")[place.panel].querySelector(".u-over");
}

function mouse(target, kind, place) {
  const at = place ? { clientX: place.x, clientY: place.y } : {};
  target.dispatchEvent(new MouseEvent(kind, { bubbles: kind !== "mouseenter", cancelable: true, view: window, ...at }));
}

async function hoverPoint(cell) {
  const place = pointAt(cell);
  if (!place) return null;
  const over = overOf(place);
  mouse(over, "mouseenter", place);
  mouse(over, "mousemove", place);
  await settle();
  return readCard();
}

function readCard() {
  const card = byId("card");
  if (card.hidden) return null;
  const entries = [...card.querySelectorAll("dt")].map((term) => [words(term), words(term.nextElementSibling)]);
  return {
    text: card.innerText.replace(/\s+/g, " ").trim(),
    label: words(card.querySelector(".label")),
    entries: Object.fromEntries(entries),
    picture: card.querySelector("img") !== null,
  };
}

async function clickPoint(cell) {
  const place = pointAt(cell);
  const over = overOf(place);
  for (const kind of ["mouseenter", "mousemove", "mousedown", "mouseup", "click"]) mouse(over, kind, place);
  await settle();
}

async function choose(id, name) {
  byId(id).value = name;
  byId(id).dispatchEvent(new Event("change", { bubbles: true }));
  await settle();
}

function readFirstRow() {
  const names = [...document.querySelectorAll("#cells thead th")].map((head) => head.dataset.column);
  const row = document.querySelector("#cells tbody tr");
  if (!row) return null;
  const entries = names.map((name, at) => [name, { shown: words(row.cells[at]), full: row.cells[at].title }]);
  return { hash: hash(Number(row.dataset.cell)), values: Object.fromEntries(entries) };
}

async function sortBy(name) {
  const button = document.querySelector(`#cells thead th[data-column="${name}"] button`);
  if (!button) return null;
  button.click();
  await settle();
  const direction = document.querySelector(`#cells thead th[data-column="${name}"]`).getAttribute("aria-sort");
  return { column: name, direction, rows: document.querySelectorAll("#cells tbody tr").length, first: readFirstRow() };
}

function readCompared() {
  const rows = [...document.querySelectorAll("#facts tr[data-column]")];
  return rows.map((row) => {
    const cells = [...row.querySelectorAll("td")];
    return { column: row.dataset.column, shown: cells.map(words), full: cells.slice(0, 2).map((cell) => cell.title) };
  });
}

/** The colour that the plot has where a cell's point should be, as "#rrggbb". */
function colourAt(cell) {
  const place = pointAt(cell);
  const canvas = overOf(place).parentElement.querySelector("canvas");
  const box = canvas.getBoundingClientRect();
  const ratio = canvas.width / box.width;
  const pixel = canvas.getContext("2d").getImageData(Math.round((place.x - box.left) * ratio), Math.round((place.y - box.top) * ratio), 1, 1).data;
  return `#${[...pixel].slice(0, 3).map((part) => part.toString(16).padStart(2, "0")).join("")}`;
}

/** The cells of which a point can be pointed at: no other is drawn in the same place. */
function apart(cells) {
  const places = shown().map(pointAt).filter((place) => place !== null);
  const isNear = (one, other) => other.panel === one.panel && Math.hypot(other.x - one.x, other.y - one.y) < 1;
  const isAlone = (place) => places.filter((other) => isNear(place, other)).length === 1;
  return cells.filter((cell) => {
    const place = pointAt(cell);
    return place !== null && isAlone(place);
  });
}

async function drive() {
  await settle();
  if (!data) throw new Error("the page has no window.lodlab: its script failed");
  result.cells = column("cell").values.length;
  result.title = words(byId("title"));
  result.count = words(byId("count"));
  result.plotted = { error: state.error, cost: state.cost, points: shown().filter((cell) => pointAt(cell) !== null).map(hash).length };
  // in pixels of the window: a test can see whether they are as far apart as the logarithms of their numbers
  result.places = shown().filter((cell) => pointAt(cell) !== null).slice(0, 200).map((cell) => ({ hash: hash(cell), ...pointAt(cell) }));
  result.panels = document.querySelectorAll("#plots .panel canvas").length;
  result.front = state.front.map(hash);
  const groups = [...document.querySelectorAll("#cost optgroup")];
  result.costs = Object.fromEntries(groups.map((group) => [group.label, [...group.children].map((option) => option.value)]));
  result.failed = [...document.querySelectorAll("#failed li")].map(words);
  result.notes = [...document.querySelectorAll("#notes li")].map(words);

  // a point of the front and one that is not on it
  const front = apart(state.front);
  const others = apart(shown().filter((cell) => !state.front.includes(cell)).slice(0, 50));
  result.hover = [];
  for (const cell of [front[0], others[0]].filter((cell) => cell !== undefined)) {
    result.hover.push({ hash: hash(cell), card: await hoverPoint(cell), colour: colourAt(cell) });
  }
  const over = document.querySelector("#plots .u-over");
  if (over) mouse(over, "mouseleave");
  await settle();
  result.card_after_leaving = readCard();

  // a chain is switched off, and on again
  const chips = [...document.querySelectorAll("#legend .filter:first-child .chip input")];
  if (chips.length > 0) {
    const chain = words(chips[0].parentElement);
    chips[0].click();
    await settle();
    const rows = [...document.querySelectorAll("#cells tbody tr")];
    const ofChain = rows.filter((row) => value("chain", Number(row.dataset.cell)) === chain);
    result.filter = { chain, count: words(byId("count")), shown: shown().length, front: state.front.map(hash), rows_of_chain: ofChain.length };
    chips[0].click();
    await settle();
    result.filter.count_after = words(byId("count"));
  }

  // the table, from the cheapest and from the dearest
  result.sort = [await sortBy(state.cost), await sortBy(state.cost)].filter((sorted) => sorted !== null);

  // every other error there is
  result.errors = [];
  for (const option of [...byId("error").options].map((option) => option.value)) {
    await choose("error", option);
    const cell = apart(state.front)[0];
    const hover = cell === undefined ? null : { hash: hash(cell), card: await hoverPoint(cell) };
    result.errors.push({ column: option, front: state.front.map(hash), hover });
  }
  if (column("error_rms")) await choose("error", "error_rms");

  // two cells side by side: the ends of the front, or whatever there is
  const pair = [...apart([...state.front]), ...others].filter((cell, at, all) => all.indexOf(cell) === at);
  const two = [pair[0], pair[pair.length - 1]];
  if (pair.length >= 2) {
    await clickPoint(two[0]);
    const alone = words(byId("pinned").querySelector("h2"));
    await clickPoint(two[1]);
    result.compare = {
      heading_of_one: alone,
      heading: words(byId("pinned").querySelector("h2")),
      pinned: state.pinned.map(hash),
      heads: [...document.querySelectorAll("#pinned .pin-head")].map(words),
      rows: readCompared(),
      kernels: document.querySelectorAll("#pinned .kernels .bar").length,
      pictures: document.querySelectorAll("#pinned .wipe img").length,
      kinds: [...(byId("picture-kind")?.options ?? [])].map((option) => option.value),
      wipe: await moveWipe(25),
    };
    document.dispatchEvent(new KeyboardEvent("keydown", { key: "Escape", bubbles: true }));
    await settle();
    result.compare.pinned_after_escape = state.pinned.map(hash);
    result.compare.hidden_after_escape = byId("pinned").hidden;
  }

  // data URLs are no requests; pictures beside the page are, of files
  const asked = performance.getEntriesByType("resource").map((entry) => entry.name);
  result.network = asked.filter((name) => !name.startsWith("data:") && !name.startsWith("file:"));
}

async function moveWipe(percent) {
  const slider = document.querySelector("#pinned .wipe input");
  if (!slider) return null;
  slider.value = percent;
  slider.dispatchEvent(new Event("input", { bubbles: true }));
  await settle();
  return document.querySelector("#pinned .wipe").style.getPropertyValue("--at");
}

try {
  await drive();
} catch (error) {
  problems.push(`the page could not be driven: ${error.stack}`);
}
// as text, so that nothing in it is read as an element
document.body.append(Object.assign(document.createElement("pre"), { id: "test-result", textContent: JSON.stringify(result) }));
})();
