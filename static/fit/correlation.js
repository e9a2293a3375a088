// How the errors of a fit's parameters hang together: a heat map, and the pairs that trade.

import { counted, h } from "../common/dom.js";
import { formula, symbolOf } from "../common/formula.js";
import * as units from "../common/units.js";

/** Correlation from which two parameters are hardly known apart. */
const STRONG = 0.9;
const MOST_PAIRS = 8;

export function view(result) {
  const names = result.parameters.map(({ name }) => name);
  const said = h("p", { className: "correlation-said", role: "status" });
  const element = h("div", { className: "fit-two correlation-view" },
    h("div", { className: "fit-main scrolls" }, map(result, names, said)),
    h("div", { className: "fit-side scrolls" }, said, legend(), pairs(result, names)));
  // The style sheet shares the room among so many cells.
  element.style.setProperty("--count", names.length);
  return element;
}

function map({ correlation }, names, said) {
  const cells = names.map((_, i) => names.map((_, j) => cell(correlation[i][j], i, j, names, said)));
  const focus = (i, j) => {
    const next = cells[i]?.[j];
    if (!next) return;
    cells.flat().forEach((one) => { one.tabIndex = -1; });
    next.tabIndex = 0;
    next.focus();
  };
  const table = h("table", { className: "correlation", role: "grid", "aria-label": "Correlation of the errors",
    on: { keydown: (event) => {
      const [di, dj] = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key] ?? [];
      if (di === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      const at = cells.findIndex((row) => row.includes(event.target));
      if (at >= 0) focus(at + di, cells[at].indexOf(event.target) + dj);
    } } },
  h("thead", {}, h("tr", {}, h("td"), names.map((name) => head("col", name)))),
  h("tbody", {}, cells.map((row, i) => h("tr", {}, head("row", names[i]), row))));
  if (cells.length) cells[0][0].tabIndex = 0;
  tell(said);
  return table;
}

const head = (scope, name) => h("th", { scope, title: units.parameter(name).label }, symbolOf(name));

function cell(value, i, j, names, said) {
  const known = Number.isFinite(value);
  const strong = known && i !== j && Math.abs(value) >= STRONG;
  const [one, other] = [i, j].map((k) => units.parameter(names[k]));
  const text = i === j ? "" : known ? units.fixed(value, 3) : "not determined";
  const show = () => tell(said, one, other, text, value);
  const element = h("td", {
    className: `${i === j ? "self" : known ? "" : "unknown"}${strong ? " strong-pair" : ""}`,
    tabIndex: -1, "aria-label": `${one.label} and ${other.label}: ${text || "itself"}`,
    on: { pointerenter: show, focus: show },
  }, strong ? (value > 0 ? "+" : "−") : "");
  if (known && i !== j) {
    element.style.setProperty("--r", Math.min(Math.abs(value), 1));
    element.classList.add(value > 0 ? "positive" : "negative");
  }
  return element;
}

/** The pair under the pointer, or what to do. */
function tell(said, one, other, text, value) {
  if (!one || one === other) {
    said.replaceChildren("Point at a cell, or move by the arrows, for its number.");
    return;
  }
  said.replaceChildren(...formula(one.symbol), " and ", ...formula(other.symbol), ": ", h("strong", {}, text),
    h("span", { className: "soft" }, Number.isFinite(value) && Math.abs(value) >= STRONG
      ? value > 0 ? " rise and fall together." : " trade one for the other." : ""));
}

const legend = () => h("div", { className: "correlation-legend" },
  h("span", {}, "−1 ", h("span", { className: "scale" }), " +1"),
  h("span", {}, h("span", { className: "mark" }, "+"), ` beyond ±${STRONG}`),
  h("span", {}, h("span", { className: "mark unknown" }), " not determined"));

/** The strongest pairs, and the combination by which each is known. */
function pairs({ correlation, verdict }, names) {
  const found = names.flatMap((one, i) => names.slice(0, i).map((other, j) =>
    ({ of: [other, one], value: correlation[i][j] })))
    .filter(({ value }) => Number.isFinite(value) && Math.abs(value) >= STRONG)
    .sort((a, b) => Math.abs(b.value) - Math.abs(a.value));
  if (!found.length) return h("p", { className: "hint" }, `No two parameters are correlated beyond ±${STRONG}.`);
  const together = (of) => verdict.combinations.find((one) => of.every((name) => one.of.includes(name)));
  return h("section", {}, h("h3", {}, "Hardly known apart"),
    h("table", { className: "pairs" }, h("tbody", {}, found.slice(0, MOST_PAIRS).map(({ of, value }) => {
      const known = together(of);
      return h("tr", {},
        h("th", { scope: "row" }, symbolOf(of[0]), ", ", symbolOf(of[1]),
          known ? h("p", { className: "hint", title: known.label }, "as ",
            h("span", { className: "formula" }, formula(known.symbol))) : null),
        h("td", { className: "strong" }, units.fixed(value, 3)));
    }))),
    found.length > MOST_PAIRS ? h("p", { className: "hint" }, `and ${counted(found.length - MOST_PAIRS, "pair")} more`) : null);
}
