// What is known of the sensors that recorded the runs, or is to be found with the parameters: by
// channel its sign, gain, delay and bias, and whether the noise is fitted.

import { fold, h } from "../common/dom.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";
import { CORNERS } from "../ride/poses.js";

const SHORT = { "chassis.z": "z", "chassis.pitch": "pitch", "chassis.roll": "roll", "chassis.a_x": "aₓ",
  ...Object.fromEntries(CORNERS.map((corner) => [`wheel.${corner}.z`, `wheel ${corner.toUpperCase()}`])) };
const FIT = "fit";
const memory = { open: false };
let follow = () => {};

/** Take what a fit offers for a channel. */
export function take({ channel, sensor }) {
  const known = get("sensors");
  set({ sensors: { ...known, [channel]: { ...known[channel], ...sensor } } });
  memory.open = true;
}

/** {factor, unit} in which a quantity is typed. */
function shownIn(name, quantity) {
  if (quantity === "delay") return { factor: 1000, unit: "ms" };
  if (quantity !== "bias") return { factor: 1, unit: "" };
  const { display_factor: factor, display_unit: unit } = units.channel(name);
  return { factor, unit };
}

export function view() {
  const summary = h("summary");
  const noise = h("input", { type: "checkbox", checked: get("fitNoise"),
    on: { change: () => { set({ fitNoise: noise.checked }); follow(); } } });
  follow = () => {
    const names = Object.keys(get("sensors")).map((name) => SHORT[name] ?? name);
    const told = [...names, ...(get("fitNoise") ? ["noise fitted"] : [])];
    summary.textContent = `Sensors: ${told.length ? told.join(", ") : "as recorded"}`;
  };
  const part = fold(memory, summary,
    h("table", { className: "sensors filters" },
      h("thead", {}, h("tr", {}, ["Channel", "Sign", "Gain", "Delay, ms", "Bias"].map((text) =>
        h("th", { scope: "col" }, text)), h("th", { className: "unit" }))),
      h("tbody", {}, Object.keys(SHORT).map(row))),
    h("label", { className: "inline" }, noise, " Find the noise of z, pitch and roll"),
    h("p", { className: "hint" }, "A number is taken as known; “fit” finds it with the parameters. Reading = " +
      "sign · gain · true value, late by the delay, + bias."));
  follow();
  return part;
}

function row(name) {
  const { label, display_unit: unit } = units.channel(name);
  const sign = h("select", { "aria-label": `Sign of ${label}`, on: { change: () => put(name, "sign", sign.value === "-1" ? -1 : null) } },
    [["1", "+"], ["-1", "−"]].map(([value, text]) => h("option", { value, selected: String(get("sensors")[name]?.sign ?? 1) === value }, text)));
  return h("tr", {}, h("th", { scope: "row", title: label }, SHORT[name]),
    h("td", {}, sign), ["gain", "delay", "bias"].map((quantity) => h("td", {}, field(name, quantity, label))),
    h("td", { className: "unit" }, unit));
}

function field(name, quantity, label) {
  const { factor, unit } = shownIn(name, quantity);
  const kept = get("sensors")[name]?.[quantity];
  const usual = quantity === "gain" ? "1" : "0";
  const element = h("input", { type: "text", inputMode: "decimal", placeholder: usual,
    value: kept === undefined ? "" : kept === FIT ? FIT : units.plain(kept * factor),
    "aria-label": `${units.withUnit(`${quantity === "gain" ? "Gain" : quantity === "delay" ? "Delay" : "Bias"} of ${label}`, unit, ", ")}, or fit`,
    on: { change: () => {
      const text = element.value.trim().toLowerCase();
      const right = text === "" || text === FIT || Number.isFinite(Number(text));
      element.setCustomValidity(right ? "" : "Write a number, or fit.");
      if (!element.reportValidity()) return;
      put(name, quantity, text === "" ? null : text === FIT ? FIT : Number(text) / factor);
    } } });
  return element;
}

function put(name, quantity, value) {
  const { [name]: known = {}, ...channels } = get("sensors");
  const { [quantity]: _, ...others } = known;
  const told = value === null ? others : { ...others, [quantity]: value };
  set({ sensors: Object.keys(told).length ? { ...channels, [name]: told } : channels });
  follow();
}

/** Whether every field can be read; the first that cannot says so. */
export function ready() {
  const wrong = document.querySelector(".sensors input:invalid");
  if (wrong) wrong.closest("details").open = true;
  wrong?.reportValidity();
  return !wrong;
}

/** What a fit found of the sensors, as a table; or nothing. */
export function found({ sensors = [] }, { span, words }) {
  if (!sensors.length) return null;
  return h("table", { className: "combinations" },
    h("caption", {}, "Sensors, found with the parameters"),
    h("tbody", {}, sensors.map(({ channel, quantity, run, value, confidence_interval: interval, determined }) => {
      const { factor, unit } = shownIn(channel, quantity);
      return h("tr", {}, h("th", { scope: "row", title: run ?? "" }, `${units.channel(channel).label}: ${quantity}`,
        run ? h("span", { className: "soft" }, ` of ${run}`) : null),
      h("td", { className: "strong" }, units.number(value * factor)), h("td", { className: "unit" }, unit),
      h("td", { className: "soft span" }, span(interval, factor)),
      h("td", {}, h("span", { className: `determined ${determined}` }, words[determined])));
    })));
}
