// Sentences of the service, in the page's words: symbols for parameters' paths, display units.

import { h, symbol } from "./dom.js";
import { get } from "./store.js";
import * as units from "./units.js";

const NUMBER = "(-?[\\d.]+(?:e[+-]?\\d+)?)";
const escaped = (text) => text.replace(/[.*+?^${}()|[\]\\/]/g, "\\$&");

/** A sentence as nodes: paths become symbols, and bounds what the sliders show. */
export function worded(text) {
  const rows = get("parameters") ?? [];
  let shown = text;
  for (const { name, unit, display_factor: factor, display_unit: display } of rows) {
    const bound = new RegExp(`(${escaped(name)} is at its \\w+ bound, )${NUMBER} ${escaped(unit)}(?=[;,. ])`, "g");
    shown = shown.replace(bound, (_, before, value) =>
      `${before}${units.number(Number(value) * factor)} ${units.pretty(display)}`);
  }
  const known = new Map(rows.map((row) => [row.name, row]));
  const paths = new RegExp(`(${rows.map(({ name }) => escaped(name)).join("|")})(?![\\w.]*\\w)`);
  return shown.split(rows.length ? paths : /$^/).filter(Boolean).map((part) => {
    const row = known.get(part);
    return row ? h("span", { title: row.label }, symbol(row.symbol)) : part;
  });
}
