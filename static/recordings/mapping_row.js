// One column of a file as a row of the table: what it is taken for, and the controls that change it.

import { breakable, h } from "../common/dom.js";
import { get } from "../common/store.js";
import * as units from "../common/units.js";
import { USUAL_UNITS, offered } from "./mapping_entries.js";

/**
 * A row whose controls stay while what they say is refreshed, so that no click on them is lost.
 * `of` tells entry(column), doubt(column) and selected(), and does select(index), edit(column,
 * changes) and choose(column, channel).
 */
export function rowOf(column, of) {
  const { index, name, group, unit, samples } = column;
  const numbers = h("td", { className: "range" });
  const channel = channelSelect(column, of);
  const unitTaken = unitField(column, of), sign = signButton(column, of);
  const certain = h("td"), why = h("td", { className: "why" });
  const row = h("tr", { dataset: { index }, on: { click: () => of.select(index), focusin: () => of.select(index) } },
    h("th", { scope: "row" },
      h("button", { type: "button", className: "link", title: "Look at this column" }, breakable(name)),
      group ? h("span", { className: "group" }, breakable(group)) : null),
    h("td", { className: "left" }, unit || h("span", { className: "soft" }, "none")),
    h("td", {}, samples.toLocaleString("en")),
    numbers, h("td", { className: "left" }, channel.element), h("td", {}, unitTaken.element),
    h("td", {}, sign.element), certain, why);
  row.refresh = () => {
    const entry = of.entry(column);
    const doubts = entry ? of.doubt(column) : "";
    row.className = [entry ? "" : "off", doubts ? "doubted" : "", index === of.selected() ? "looked-at" : ""].join(" ");
    for (const control of [channel, unitTaken, sign]) control.refresh(entry);
    numbers.replaceChildren(...[range(column), standIns(column, entry, of)].flat().filter(Boolean));
    certain.replaceChildren(entry ? sure(entry) : "");
    why.replaceChildren(...(entry
      ? [doubts ? h("strong", { className: "doubt" }, `⚠ ${doubts}: `) : "", entry.note]
      : [hintOf(column)]));
  };
  row.refresh();
  return row;
}

const hintOf = ({ candidates: [first], constant }) => h("span", { className: "soft" },
  first ? `perhaps ${first.channel}, ${percent(first.confidence)}` : constant ? "never changes" : "");
const percent = (share) => `${Math.round(100 * share)} %`;

function range({ minimum, maximum, constant, gaps }) {
  if (minimum === null) return h("span", { className: "soft" }, "not read");
  return [constant ? units.number(minimum, 3) : `${units.number(minimum, 3)} … ${units.number(maximum, 3)}`,
    gaps ? h("span", { className: "group" }, `${gaps} without a number`) : null];
}

function standIns(column, entry, { edit }) {
  const { stand_ins: found, name } = column;
  if (!found.length || !entry) return null;
  const values = found.map(({ value }) => value);
  const box = h("input", { type: "checkbox", checked: values.every((value) => entry.missing?.includes(value)),
    "aria-label": `Take ${values.join(", ")} of ${name} as missing`,
    on: { change: () => edit(column, { missing: box.checked ? values : [] }) } });
  return h("label", { className: "stand-in",
    title: found.map(({ value, samples }) => `${value} in ${samples} samples, far outside the rest`).join("; ") },
  box, `${values.map((value) => units.plain(value)).join(", ")} as missing`);
}

/** The list tells each channel at length; the chosen one is its name alone, for which a row has room. */
function channelSelect(column, { choose }) {
  const named = (name) => `${name} · ${units.channel(name).label}`;
  const option = (name, long) => h("option", { value: name, title: units.channel(name).sign ?? "", dataset: { long } });
  const seen = new Set(column.candidates.map(({ channel }) => channel));
  const likely = column.candidates.map(({ channel, confidence }) =>
    option(channel, `${named(channel)}, ${percent(confidence)}`));
  const tell = () => {
    for (const one of element.options) if (one.value) one.text = one.selected ? one.value : one.dataset.long;
    element.title = element.value ? named(element.value) : "";
  };
  // All channels in every row of a long file would make it slow; they come with the focus.
  const fill = () => {
    const chosen = element.value;
    element.append(...offered(get("channels").map(({ name }) => name)).map(([label, group]) =>
      h("optgroup", { label }, group.filter((name) => !seen.has(name)).map((name) => option(name, named(name))))));
    element.value = chosen;
    tell();
  };
  const element = h("select", { "aria-label": `Channel of ${column.name}`,
    on: { change: () => { choose(column, element.value); tell(); } } },
  h("option", { value: "" }, "not used"),
  likely.length ? h("optgroup", { label: "Likely" }, likely) : null);
  for (const event of ["pointerdown", "focus"]) element.addEventListener(event, () => { if (!filled) fill(); filled = true; });
  let filled = false;
  return { element, refresh: (entry) => {
    element.value = entry?.channel ?? "";
    // Points of the chassis are the user's own, and so are their names.
    if (entry && element.value !== entry.channel) {
      element.append(option(entry.channel, named(entry.channel)));
      element.value = entry.channel;
    }
    tell();
  } };
}

function unitField(column, { edit }) {
  const element = h("input", { type: "text", className: "unit-taken", spellcheck: false,
    "aria-label": `Unit of ${column.name}`,
    on: { change: () => edit(column, { unit: element.value.trim() }) } });
  return { element, refresh: (entry) => {
    element.hidden = !entry;
    if (!entry) return;
    element.value = entry.unit;
    const { quantity } = units.channel(entry.channel);
    if (quantity in USUAL_UNITS) element.setAttribute("list", `units-${quantity.replace(" ", "-")}`);
    else element.removeAttribute("list");
  } };
}

function signButton(column, of) {
  const element = h("button", { type: "button", className: "sign", "aria-label": `Turn ${column.name} over`,
    on: { click: () => of.edit(column, { sign: -of.entry(column).sign, sign_sure: false }) } });
  return { element, refresh: (entry) => {
    element.hidden = !entry;
    if (!entry) return;
    element.setAttribute("aria-pressed", entry.sign < 0);
    element.textContent = entry.sign < 0 ? "−" : "+";
    element.title = `${entry.sign < 0 ? "Turned over" : "As in the file"}${entry.sign_sure ? ", confirmed" : ""}; ${entry.channel} is positive ` +
      `${units.channel(entry.channel).sign ?? "as it is"}`;
  } };
}

const sure = ({ confidence }) => confidence === null
  ? h("span", { className: "soft" }, "by hand")
  : h("span", { className: "sure" }, h("span", { className: "sure-bar", style: `--share: ${confidence}` }), percent(confidence));
