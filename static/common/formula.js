// Symbols of parameters in sentences and combinations of the service, such as Ktor_F/d_F^2.

import { h, symbol } from "./dom.js";
import { get } from "./store.js";
import * as units from "./units.js";

const SYMBOL = /((?:Ktor|Ctor|phi|rho|[KCdv])_[FR])/;
const NEWTONS = /(-?\d[\d.]*(?:e[+-]?\d+)?) N\/m(?![\w/])/g;
const POWER = /\d(?:\.\d+)?e[+-]\d+/g;

/** A sentence or a formula as nodes; rates in N/mm, as the springs' sliders have them. */
export function formula(text) {
  return text.replaceAll("^2", "²").replace(/ - /g, " − ").replace(/ -(?=\d)/g, " −").replace(/\bphi\b(?!_)/g, "φ")
    .replace(NEWTONS, (_, number) => `${units.number(Number(number) / 1000)} N/mm`)
    .replace(POWER, (number) => units.number(Number(number), 2))
    .split(SYMBOL).filter(Boolean).map((part) => (SYMBOL.test(part) ? named(part) : part));
}

/** A parameter's symbol, with its label at the pointer. */
export function named(text) {
  const row = get("parameters").find((one) => one.symbol === text);
  const shown = symbol(text);
  if (row) shown.title = row.label;
  return shown;
}

/** The symbol of a parameter by its name. */
export const symbolOf = (name) => named(units.parameter(name).symbol);

/** Names of parameters as symbols with commas between. */
export const symbols = (names) =>
  names.flatMap((name, i) => [i ? ", " : null, symbolOf(name)]).filter(Boolean);

/** How a quantity of the service is shown: [factor, unit]. */
export const shownIn = (unit) =>
  (unit === "N/m" ? [1e-3, "N/mm"] : [1, unit === "1" ? "" : units.pretty(unit)]);

/** A row of how a combination is determined, for a table. */
export function combinationRow({ symbol: text, label, unit, value, confidence_interval: interval },
  { span, share, mark }) {
  const [factor, shown] = shownIn(unit);
  return h("tr", {},
    h("th", { scope: "row", title: label }, h("span", { className: "formula" }, formula(text)), " ",
      h("span", { className: "soft long" }, label)),
    h("td", { className: "strong" }, units.number(value * factor)),
    h("td", {}, share(value, interval)),
    h("td", { className: "unit" }, shown),
    h("td", { className: "soft span" }, span(interval, factor)),
    h("td", {}, mark));
}
