// How recordings drive the model: traction, initial state, filters, and when each run brakes.

import { fold, h } from "../common/dom.js";
import { nameOf } from "../common/names.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";

/** Hz, as the service takes them. */
const LOW_PASS = { min: "0.5" };
const HIGH_PASS = { min: "0.02", max: "5" };
const FILTERS = [
  ["a_x_cutoff_hz", "aₓ below", "Low-pass of the longitudinal acceleration", LOW_PASS],
  ["rim_cutoff_hz", "wheels below", "Low-pass of the wheel centres", LOW_PASS],
  ["output_cutoff_hz", "z, pitch, roll below",
    "Low-pass of the compared channels, recorded and simulated alike", LOW_PASS],
  ["output_highpass_hz", "z, pitch, roll above",
    "High-pass of the compared channels, recorded and simulated alike", HIGH_PASS],
];
const TRACTIONS = { exact: "exact", paper: "paper (biased)" };
const memory = { open: false };
const STATES = { equilibrium: "equilibrium", measured: "as measured" };

/** What a simulation or a fit is told of one recording. */
export function rimsOf(id) {
  const rims = { measurement: id, traction: get("traction"), settings: get("rimsSettings") };
  const braking = get("braking")[id];
  return braking ? { ...rims, braking } : rims;
}

/** Braking marked by hand, of the recordings given. */
export const brakingOf = (ids) =>
  Object.fromEntries(Object.entries(get("braking")).filter(([id]) => ids.includes(id)));

/** What differs from the usual, in words. */
function different() {
  const [now, usual] = [get("rimsSettings"), get("rimsUsual")];
  return [
    ...FILTERS.filter(([key]) => now[key] !== usual[key]).map(([key, name]) => (now[key] === null
      ? name.replace(/ \w+$/, " unfiltered") : `${name} ${units.plain(now[key])} Hz`)),
    get("traction") === "paper" && "paper's traction",
    now.initial_state === "measured" && "initial state as measured",
  ].filter(Boolean);
}

/** The choices that hold for every recording. */
export function view() {
  const settings = get("rimsSettings");
  const summary = h("summary");
  const follow = () => {
    summary.textContent = `How recordings drive the model: ${different().join("; ") || "as usual"}`;
  };
  const keep = (changes) => {
    set(changes);
    follow();
  };
  const change = (changes) => keep({ rimsSettings: { ...get("rimsSettings"), ...changes } });
  follow();
  return fold(memory, summary,
    choice("Traction", "traction", TRACTIONS, get("traction"), (traction) => keep({ traction }),
      "exact: the force that gives the measured aₓ; paper: total mass times aₓ"),
    choice("Initial state", "initial-state", STATES, settings.initial_state,
      (initial_state) => change({ initial_state }),
      "of the body: at rest under the first wheel heights, or from the first 0.2 s of z, pitch, roll"),
    h("table", { className: "filters" },
      h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "What counts"),
        h("th", { scope: "col" }, "Hz; empty: none"))),
      h("tbody", {}, FILTERS.map(([key, name, what, limits]) => {
        const field = h("input", {
          type: "number", className: "frequency", ...limits, step: "any", value: settings[key] ?? "",
          "aria-label": `${what}, Hz; empty for none`,
          on: { change: () => {
            if (field.reportValidity()) change({ [key]: field.value === "" ? null : Number(field.value) });
          } },
        });
        return h("tr", {}, h("th", { scope: "row", title: what }, name), h("td", {}, field));
      }))));
}

function choice(label, id, options, chosen, change, title) {
  const element = h("select", { id, title, on: { change: () => change(element.value) } },
    Object.entries(options).map(([key, text]) =>
      h("option", { value: key, selected: key === chosen }, text)));
  return h("label", { className: "block" }, label, element);
}

/** When one run brakes, s: a field that is empty while aₓ tells. */
export function brakingField(run) {
  const marked = get("braking")[run.id];
  const field = h("input", {
    type: "text", className: "braking", value: marked ? written(marked) : "",
    placeholder: "as aₓ shows", "aria-label": `When ${nameOf(run.id)} brakes`,
    title: "When the car brakes, s, e.g. 6.2-9.8 or 3-4, 12-15; none for never; empty: found in aₓ",
    on: { change: () => {
      const { [run.id]: _, ...others } = get("braking");
      const intervals = parsed(field.value);
      field.setCustomValidity(intervals === undefined
        ? "Write begin-end in seconds, such as 6.2-9.8, or none." : "");
      if (!field.reportValidity()) return;
      set({ braking: intervals ? { ...others, [run.id]: intervals } : others });
      field.value = intervals ? written(intervals) : "";
    } },
  });
  return field;
}

/** Whether every field can be read; the first that cannot says so. */
export function ready() {
  const wrong = document.querySelector("input.braking:invalid, input.frequency:invalid");
  const folded = wrong?.closest("details");
  if (folded) folded.open = true;
  wrong?.reportValidity();
  return !wrong;
}

const written = (intervals) =>
  intervals.length ? intervals.map((interval) => interval.join("-")).join(", ") : "none";

/** Intervals in s; null where nothing is marked, undefined for what cannot be read. */
function parsed(text) {
  const said = text.trim().toLowerCase();
  if (said === "") return null;
  if (said === "none") return [];
  const found = said.split(/[,;]/).map((part) =>
    /^\s*(\d+(?:\.\d+)?)\s*(?:-|–|:|to)\s*(\d+(?:\.\d+)?)\s*s?\s*$/.exec(part));
  return found.every(Boolean) ? found.map(([, begin, end]) => [Number(begin), Number(end)])
    : undefined;
}
