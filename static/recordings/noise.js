// The noise of the compared channels, which weighs them against each other in a fit: typed for all
// its runs, else as a run states it, else the service's default. A standard deviation.

import { fold, h } from "../common/dom.js";
import { nameOf } from "../common/names.js";
import { notice } from "../common/notices.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";

const SHORT = { "chassis.z": "z", "chassis.pitch": "pitch", "chassis.roll": "roll" };
const CHANNELS = Object.keys(SHORT);
const memory = { open: false };
/** What brings the fields up to date with the runs that are fitted. */
let rows = [];
let summary = null;

export function view(runs) {
  summary = h("summary");
  rows = [];
  const panel = fold(memory, summary,
    h("table", { className: "filters noise" }, h("tbody", {}, CHANNELS.map(row))),
    h("p", { className: "hint" }, "Standard deviations: the smaller, the more a channel counts. " +
      "Empty: as a run states it, in a NAME.toml added beside its NAME.csv, else the default."));
  show(runs);
  return panel;
}

/** Bring fields and summary up to date with the runs that are fitted. */
export function show(runs) {
  const holding = rows.map((update) => update(runs));
  summary.textContent = `Noise: ${[...new Set(holding)].join(", ")}`;
}

function row(name) {
  const { display_factor: factor, display_unit: unit } = units.channel(name);
  const source = h("td", { className: "soft" });
  let fitted = [];
  const field = h("input", {
    type: "number", min: "0", step: "any",
    "aria-label": `Noise of ${SHORT[name]}, ${unit}; empty for as stated`,
    on: { change: () => {
      const { [name]: _, ...others } = get("noise");
      if (field.value === "" && !field.validity.badInput) set({ noise: others });
      else if (Number(field.value) > 0) set({ noise: { ...others, [name]: Number(field.value) / factor } });
      else refuse(name, fitted);
      show(fitted);
    } },
  });
  rows.push((runs) => {
    fitted = runs;
    const [word, text] = holding(name, runs);
    field.value = name in get("noise") ? units.plain(get("noise")[name] * factor, 4) : "";
    field.placeholder = text;
    field.title = runs.map((run) => `${nameOf(run.id)}: ${said(name, run.noise[name])}`).join("\n");
    source.textContent = word;
    return word;
  });
  return h("tr", {}, h("th", { scope: "row" }, SHORT[name]),
    h("td", {}, field), h("td", { className: "unit" }, unit), source);
}

/** Which noise of a channel holds, in a word, and what it is unless one is typed. */
function holding(name, runs) {
  const stated = [...new Set(runs.map(({ noise }) => noise[name] ?? units.channel(name).default_noise))];
  const text = stated.length > 1 ? "by run" : inUnit(name, stated[0] ?? units.channel(name).default_noise);
  if (name in get("noise")) return ["typed", text];
  return [runs.some(({ noise }) => name in noise) ? "stated" : "default", text];
}

function refuse(name, runs) {
  const { label, display_unit: unit } = units.channel(name);
  const now = name in get("noise") ? inUnit(name, get("noise")[name]) : holding(name, runs)[1];
  notice("warning", `The noise of ${label.toLowerCase()} stays ${now} ${unit}`,
    "Noise is a positive number; an empty field takes what the run states, else the default.");
}

const inUnit = (name, value) => units.plain(value * units.channel(name).display_factor, 3);

const said = (name, value) => value === undefined ? "not stated"
  : `${inUnit(name, value)} ${units.channel(name).display_unit} stated`;

/** What a fit takes as a recording's noise, that of the compared channels, in a sentence. */
export function sentence({ noise }) {
  const list = (names, value) => names.map((name) => `${SHORT[name]} ` +
    `${inUnit(name, value(name))} ${units.channel(name).display_unit}`).join(", ");
  const stated = CHANNELS.filter((name) => name in noise);
  const others = CHANNELS.filter((name) => !(name in noise));
  const usual = list(others, (name) => units.channel(name).default_noise);
  return [stated.length ? `Noise as stated: ${list(stated, (name) => noise[name])}.` : "Noise is not stated.",
    others.length ? `By default: ${usual}.` : ""].filter(Boolean).join(" ");
}
