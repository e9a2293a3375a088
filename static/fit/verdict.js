// What the runs of a fit determine: in sentences, as combinations, and along which directions not.

import { condition, mark, WORDS } from "../common/determined.js";
import { h } from "../common/dom.js";
import { combinationRow, formula, symbolOf } from "../common/formula.js";
import { share, span } from "../common/intervals.js";
import * as units from "../common/units.js";

/** Half-width from which a direction is shown, and of how many at most. */
const WIDE = 0.15;
const MOST_DIRECTIONS = 4;
/** Beyond this half-width of a logarithm, a factor says more than per cent. */
const AS_FACTOR = 0.7;
/** Factor beyond which it only says that hardly anything holds the parameters. */
const MOST_FACTOR = 1000;
/** Combined standard errors from which a prior and the runs contradict each other. */
const APART = 3;

/** How many parameters are well, weakly and not determined; `open()` shows the verdict. */
export function summary(result, open) {
  const counts = Object.entries(WORDS).flatMap(([word, text]) => {
    const names = result.verdict.parameters[word];
    const held = names.filter((name) => condition(name, result)).length;
    return [[names.length - held, word, text], [held, `${word} conditional`, `${text}, if …`]];
  });
  return h("button", { type: "button", className: "link verdict-counts", title: "What these runs determine",
    on: { click: open } },
  counts.filter(([count]) => count).map(([count, marks, text]) =>
    h("span", { className: `determined ${marks}` }, `${count} ${text}`)));
}

/** The combinations that are better known than what they are made of, as a table; or nothing. */
export function combinations(result) {
  const { verdict } = result;
  if (!verdict.combinations.length) return null;
  return h("table", { className: "combinations" },
    h("caption", {}, "Determined together, where the parameters are not known apart"),
    h("thead", {}, h("tr", {}, ["Combination", "Value", "95 %", "Unit", "95 % interval", "Determined"].map((text) =>
      h("th", { scope: "col", className: text === "Unit" ? "unit" : "" }, text)))),
    h("tbody", {}, verdict.combinations.map((one) => combinationRow(one, { span, share, mark: mark(one, result) }))));
}

/** The whole verdict. */
export function view(result) {
  return h("div", { className: "fit-two" },
    h("div", { className: "fit-main scrolls", tabIndex: 0, role: "region", "aria-label": "Verdict" },
      h("h3", {}, "What these runs determine"), said(result), priors(result)),
    h("div", { className: "fit-side scrolls" }, directions(result)));
}

function said({ verdict, outcome }) {
  if (!verdict.sentences.length) {
    return h("p", { className: "verdict-said" }, outcome, " So nothing is said of its parameters.");
  }
  const classes = Object.keys(WORDS).filter((word) => verdict.parameters[word].length);
  return h("ul", { className: "verdict-said" }, verdict.sentences.map((text, i) =>
    h("li", { className: i < classes.length ? `determined ${classes[i]}` : "" },
      h("span", {}, formula(text)))));
}

/** The axes along which the parameters are least determined, as bars. */
function directions({ verdict, converged }) {
  if (!converged) return null;
  const wide = verdict.directions.filter(({ half_width: half }) => half === null || half > WIDE);
  const others = verdict.directions.length - Math.min(wide.length, MOST_DIRECTIONS);
  return h("section", { className: "directions" }, h("h3", {}, "Least determined directions"),
    wide.length ? null : h("p", { className: "hint" }, "Along every direction the parameters are known to 15 %."),
    wide.slice(0, MOST_DIRECTIONS).map((one) => direction(one, verdict.combinations)),
    wide.length ? h("p", { className: "hint" }, "Bars: how much each parameter takes part; to the left it falls " +
      `while others rise. ${others ? `${others} more ${others > 1 ? "directions are" : "direction is"} known better.` : ""}`) : null);
}

function direction({ half_width: half, parts, combination }, known) {
  const moved = known.find(({ name }) => name === combination);
  return h("figure", { className: "direction" },
    h("figcaption", {}, h("strong", {}, reach(half)),
      moved ? [", moves ", h("span", { className: "formula" }, formula(moved.symbol))] : null),
    Object.entries(parts).map(([name, part]) => {
      const bar = h("span", { className: `part ${part < 0 ? "falls" : "rises"}` });
      bar.style.width = `${50 * Math.abs(part)}%`;
      return h("div", { className: "part-row", title: `${units.parameter(name).label}: ${units.fixed(part, 2)} of 1` },
        symbolOf(name), h("span", { className: "part-track" }, bar),
        h("span", { className: "soft" }, units.fixed(part, 2)));
    }));
}

/** How far the parameters may go along a direction. */
function reach(half) {
  if (half === null) return "No run moves it";
  if (half < AS_FACTOR) return `± ${units.number(100 * half, 2)} %`;
  const factor = Math.exp(half);
  return factor > MOST_FACTOR ? "Hardly anything holds it" : `× or ÷ ${units.number(factor, 2)}`;
}

/** What was known before, beside what the runs say without it. */
function priors({ priors: given = [] }) {
  if (!given.length) return null;
  return h("section", {}, h("h3", {}, "What was known before"),
    h("table", { className: "priors-check" },
      h("thead", {}, h("tr", {}, ["", "Prior", "Runs alone", "Apart"].map((text) => h("th", { scope: "col" }, text)))),
      h("tbody", {}, given.map((one) => {
        const { display_factor: factor, display_unit: unit } = units.parameter(one.name);
        const both = (value, error) => `${units.number(value * factor, 3)} ± ${units.number(error * factor, 2)}`;
        const far = Math.abs(one.apart ?? 0) > APART;
        return h("tr", { title: unit }, h("th", { scope: "row" }, symbolOf(one.name)),
          h("td", {}, both(one.mean, one.deviation)),
          h("td", {}, one.without === null ? "not told" : both(one.without, one.without_std_error)),
          h("td", { className: far ? "worse" : "soft", title: "In combined standard errors" },
            one.apart === null ? "–" : `${units.number(Math.abs(one.apart), 2)} σ${far ? " !" : ""}`));
      }))));
}

