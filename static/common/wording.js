// Sentences of the service, in the page's words: names for paths, numbers in display units.

import { h, symbol } from "./dom.js";
import * as units from "./units.js";

const PATH = /((?:chassis|front|rear|brakes)(?:\.\w+)+)/;
const NUMBER = "-?\\d[\\d.]*(?:e[+-]?\\d+)?";
const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");

/** A sentence as nodes: parameters by symbol and label, their numbers as the sliders show them. */
export function worded(text) {
  return inDisplayUnits(text).replace(/(\d) %/g, "$1\u00a0%").split(PATH).filter(Boolean).map((part) => {
    const row = units.parameter(part);
    if (row) {
      return h("span", { title: part }, symbol(row.symbol), ` ${row.label.toLowerCase()}`);
    }
    const name = units.knownName(part);
    return name ? h("span", { title: part }, name) : part;
  });
}

/** One number, or two joined by "to" or "and", before the SI unit of a parameter that is named. */
function inDisplayUnits(text) {
  const named = text.split(PATH).map(units.parameter).filter(Boolean);
  let shown = text;
  for (const { name, unit, display_factor: factor, display_unit: display } of named) {
    if (factor === 1) continue;
    const bare = new RegExp(`(${escaped(name)} is ${NUMBER})(?=, but must lie)`, "g");
    shown = shown.replace(bare, `$1 ${unit}`);
    const said = new RegExp(`(${NUMBER})(?:( to | and )(${NUMBER}))? ${escaped(unit)}(?![\\w/^])`, "g");
    const number = (digits) => units.number(Number(digits) * factor);
    shown = shown.replace(said, (_, one, joined, other) =>
      `${number(one)}${joined ? joined + number(other) : ""} ${display}`);
  }
  return shown;
}
