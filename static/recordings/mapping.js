// Columns of a file as channels: what is guessed and why, corrected by a person, applied, kept.

import * as api from "../common/api.js";
import { $, h, inPlace } from "../common/dom.js";
import * as units from "../common/units.js";
import { clockOf, clocks } from "./mapping_clock.js";
import * as detail from "./mapping_detail.js";
import {
  BY_HAND, USUAL_UNITS, columnsOf, doubt, entriesOf, entryFor, isRaw, needs,
} from "./mapping_entries.js";
import { rowOf } from "./mapping_row.js";
import * as templates from "./mapping_templates.js";

/** Rows shown at once; the filter finds the others. */
const MOST_ROWS = 200;

let host = null;
/** What is on show: row, columns, rows (of the table, by index), entries, selected, filter, onlyMapped, shown, longest_gap, step. */
let at = null;
const parts = {};

const ROW = {
  entry: ({ index }) => at.entries.get(index), doubt: doubtOf, selected: () => at.selected,
  select, edit, choose,
};

/** The view of a recording's columns. */
export async function open(row, itsHost) {
  host = itsHost;
  const [found, kept] = await Promise.all([api.columns(row.id), api.mappings()]);
  const begin = found.mapping ?? found.proposed;
  at = { row, ...found, kept, rows: new Map(), shown: MOST_ROWS, filter: "", onlyMapped: false,
    outcome: row.needs_mapping ? null : row };
  take(begin);
  at.applied = !row.needs_mapping;
  const first = found.columns.find((one) => at.entries.has(one.index) && doubt(at.entries.get(one.index), one))
    ?? found.columns.find(({ index }) => at.entries.has(index)) ?? found.columns[0];
  at.selected = first.index;
  build();
  show();
  return parts.view;
}

/** What needs its place on the page. */
export function shown() {
  look();
}

/** Take a mapping for what is on show. */
function take(mapping) {
  const { entries, lost } = entriesOf(mapping, at.columns);
  Object.assign(at, { entries, lost, longest_gap: mapping.longest_gap, step: mapping.step, applied: false });
}

function build() {
  parts.head = h("div", { className: "mapping-head" });
  parts.rows = h("tbody");
  parts.more = h("p", { className: "hint" });
  parts.side = h("aside", { className: "mapping-side scrolls", "aria-label": "The column that is looked at" });
  parts.needs = h("ul", { className: "needs", "aria-label": "What an identification needs" });
  const filter = h("input", { type: "text", id: "column-filter", placeholder: "Find columns",
    "aria-label": "Find columns by name, group, unit or channel",
    on: { input: () => { Object.assign(at, { filter: filter.value, shown: MOST_ROWS }); rows(); } } });
  const only = h("input", { type: "checkbox", id: "only-mapped",
    on: { change: () => { at.onlyMapped = only.checked; rows(); } } });
  parts.count = h("span", { className: "hint" });
  parts.numbers = [number("Bridge gaps up to", "longest_gap", 1, "s"), number("Sample every", "step", 1e3, "ms", "finest")];
  parts.forget = h("button", { type: "button", on: { click: forget } }, "Forget mapping");
  parts.download = h("a", { className: "button", download: "", href: api.mappingUrl(at.row.id),
    title: "The mapping that is applied, for other recordings and for --mapping on the command line" }, "Download mapping");
  parts.apply = h("button", { type: "button", id: "apply-mapping",
    on: { click: async () => { if (await apply()) show(); } } }, "Apply");
  parts.next = h("span");
  // What comes and goes stands left of Apply, which so stays under the hand.
  host.tools(...parts.numbers.map(({ element }) => element), parts.download, parts.forget, parts.next, parts.apply);
  parts.view = h("div", { className: "mapping" },
    parts.head,
    h("div", { className: "mapping-bar" }, filter, h("label", { className: "inline" }, only, "only mapped"),
      parts.count, h("span", { className: "grow" }), templates.build(host, at, {
        take: (mapping, said) => { take(mapping); host.changed(true); host.say("doubt", ...said); show(); },
        mapping: whole,
        reload: async () => { Object.assign(at, await api.columns(at.row.id)); },
      })),
    h("div", { className: "mapping-table scrolls" },
      h("table", {},
        h("thead", {}, h("tr", {}, ["Column", "File's unit", "Samples", "Range", "Channel", "Unit taken",
          "Sign", "Sure", "Why"].map((text) => h("th", { scope: "col" }, text)))),
        parts.rows),
      parts.more, lists()),
    parts.side, parts.needs);
}

/** Units to choose from, by quantity. */
const lists = () => Object.entries(USUAL_UNITS).map(([quantity, known]) =>
  h("datalist", { id: `units-${quantity.replace(" ", "-")}` }, known.map((value) => h("option", { value }))));

function show() {
  head();
  for (const row of at.rows.values()) row.refresh();
  rows();
  told();
  for (const one of parts.numbers) one.refresh();
  if (parts.side.isConnected) look();
}

/** What is known of the file as a whole, and what came of applying the mapping. */
function head() {
  const { kind, columns, outcome, warnings } = at;
  const groups = new Set(columns.map(({ group }) => group)).size;
  const said = outcome ? outcome.warnings : warnings;
  parts.head.replaceChildren(
    h("p", { className: "hint" }, `${kind}, ${columns.length} column${columns.length === 1 ? "" : "s"}` +
      `${groups > 1 ? ` in ${groups} groups` : ""}. ${clocks(at)}`),
    ...(outcome?.mapping ? [h("p", { className: "strong" }, `Applied: ${outcome.channels.length} channels, ` +
      `${units.number(outcome.duration, 3)} s, a sample every ${units.number(1000 * outcome.sample_step, 3)} ms.`)] : []),
    ...(outcome?.sign_suggestions.length ? [h("ul", { className: "warnings signs" },
      outcome.sign_suggestions.map(signRow))] : []),
    ...(said.length ? [h("ul", { className: "warnings", "aria-label": "Warnings" },
      said.map((text) => h("li", {}, text)))] : []));
}

function signRow({ channel, sentence }) {
  return h("li", {}, h("span", { className: "grow" }, sentence),
    h("button", { type: "button", "aria-label": `Keep ${channel}`, title: "The sign is right; it is not asked about again",
      on: { click: () => sign(channel, { sign_sure: true }) } }, "Keep"),
    h("button", { type: "button", "aria-label": `Flip ${channel}`, title: "Turn the sign over",
      on: { click: () => sign(channel) } }, "Flip"));
}

/** Confirm the sign of a channel, or turn it over, and apply that. */
async function sign(channel, confirmed = null) {
  const [index, entry] = [...at.entries].find(([, one]) => one.channel === channel);
  at.entries.set(index, { ...entry, ...(confirmed ?? { sign: -entry.sign, sign_sure: false }) });
  if (!(await apply())) at.entries.set(index, entry);
  show();
  // The button is gone; the focus goes to the next one that is asked about, else to Apply.
  ($(".signs button", parts.head) ?? parts.apply).focus();
}

function rows() {
  const words = at.filter.toLowerCase().split(/\s+/).filter(Boolean);
  const fitting = at.columns.filter(({ index, name, group, unit }) => {
    const channel = at.entries.get(index)?.channel ?? "";
    if (at.onlyMapped && !channel) return false;
    const text = `${name} ${group} ${unit} ${channel}`.toLowerCase();
    return words.every((word) => text.includes(word));
  });
  // What is mapped comes first where there is more than a screen of columns.
  if (at.columns.length > 30) {
    fitting.sort((one, other) => at.entries.has(other.index) - at.entries.has(one.index) || one.index - other.index);
  }
  const shownRows = fitting.slice(0, at.shown).map((column) => {
    if (!at.rows.has(column.index)) at.rows.set(column.index, rowOf(column, ROW));
    return at.rows.get(column.index);
  });
  parts.rows.replaceChildren(...shownRows);
  const left = fitting.length - at.shown;
  parts.more.replaceChildren(...(left > 0
    ? [`${left} more; find them by a part of their name, or `,
       h("button", { type: "button", on: { click: () => { at.shown += MOST_ROWS; rows(); } } }, "show more")]
    : fitting.length ? [] : ["No column is like that."]));
}

/** Keys on a closed list choose as they pass, so that no other column loses its channel by it. */
function choose(column, channel) {
  const before = at.entries.get(column.index)?.channel;
  const likely = column.candidates.find((one) => one.channel === channel);
  if (likely) at.entries.set(column.index, entryFor(column, likely));
  else if (channel) ask(column, channel);
  else at.entries.delete(column.index);
  const others = [...at.entries].filter(([, one]) => [before, channel].includes(one.channel)).map(([index]) => index);
  touched(column.index, ...others);
  const [twice] = others.filter((index) => channel && index !== column.index && at.entries.get(index).channel === channel);
  if (twice !== undefined) {
    host.say("doubt", `${at.columns[twice].name} is ${channel}, too; keep one of the two.`);
  }
}

/** An entry that nobody guessed; its unit and sign are the service's to find by the numbers. */
function ask(column, channel) {
  const mine = at;
  const entry = entryFor(column, { channel, unit: "", sign: 1, confidence: null, doubted: false, reason: BY_HAND });
  const answered = async () => {
    try {
      const found = await api.columnAs(mine.row.id, column.index, channel);
      // Another choice meanwhile, or a unit that was typed, goes before the answer.
      if (mine.entries.get(column.index) !== entry) return;
      mine.entries.set(column.index, entryFor(column, { ...found, confidence: null }));
      if (mine === at) touched(column.index);
    } catch (error) {
      host.refused(error);
    }
  };
  at.entries.set(column.index, entry);
  at.asked = Promise.all([at.asked, answered()]);
}

/** The doubt about the entry of a column, or that its channel is that of another one, too. */
function doubtOf(column) {
  const entry = at.entries.get(column.index);
  const twice = [...at.entries].some(([index, { channel }]) => channel === entry.channel && index !== column.index);
  return twice ? "channel taken twice" : doubt(entry, column);
}

/** Change the entry of a column; what a person has said of its unit is not doubted. */
function edit(column, changes) {
  const before = at.entries.get(column.index);
  const told = changes.unit !== undefined && changes.unit !== before.unit
    ? { note: `${BY_HAND}: unit`, confidence: null, doubted: false } : {};
  at.entries.set(column.index, { ...before, ...changes, ...told });
  touched(column.index);
}

/** What is on show is not what is applied; some columns have changed. */
function touched(...indices) {
  at.applied = false;
  host.changed(true);
  host.say();
  for (const index of indices) at.rows.get(index)?.refresh();
  told();
  // The focus moves on first, so that it is not lost with what is built anew.
  setTimeout(() => { if (indices.includes(at.selected)) look(); });
}

function select(index) {
  if (index === at.selected) return;
  at.selected = index;
  for (const [one, row] of at.rows) row.classList.toggle("looked-at", one === index);
  look();
}

/** Show the selected column close up. */
function look() {
  const column = at.columns[at.selected];
  inPlace(parts.side, () => detail.show(parts.side, at.row, column, at.entries.get(column.index), {
    clock: clockOf(column, at)?.told ?? "of the column mapped as time",
    edit: (changes) => edit(column, changes), choose: (channel) => choose(column, channel),
  }));
}

/** What is needed still, and what can be done now. */
function told() {
  const found = needs(at.entries, at.columns);
  const lacking = found.some(({ has }) => !has);
  // Of raw sensors conditioning makes what is lacking, as far as it can.
  const raw = [...at.entries.values()].some(({ channel }) => isRaw(channel) && channel !== "chassis.v_x");
  const [kind, mark, word] = raw ? ["to-make", "○", "not recorded"] : ["lacks", "✗", "lacking"];
  parts.needs.replaceChildren(h("li", { className: "soft" }, "For fitting:"),
    ...found.map(({ name, has }) => h("li", { className: has ? "has" : kind },
      h("span", { "aria-hidden": "true" }, has ? "✓ " : `${mark} `), name,
      h("span", { className: "unseen" }, has ? "" : `, ${word}`))),
    ...(lacking ? [h("li", { className: "soft" }, raw
      ? "○ is for conditioning to make of the raw sensors, which comes next."
      : "Map columns that hold them, or raw sensors of which conditioning makes them.")] : []));
  parts.forget.hidden = !at.row.mapping;
  parts.download.hidden = !at.row.mapping || !at.applied;
  parts.apply.classList.toggle("primary", !at.applied);
  parts.count.textContent = `${at.entries.size} of ${at.columns.length} mapped`;
  parts.next.replaceChildren(...[at.applied ? host.next(at.row) : null].filter(Boolean));
}

function number(label, key, factor, unit, placeholder = "") {
  const field = h("input", { type: "number", min: "0", step: "any", placeholder,
    on: { change: () => { at[key] = field.value === "" ? null : Number(field.value) / factor; touched(); } } });
  const refresh = () => { field.value = at[key] === null || at[key] === undefined ? "" : units.plain(at[key] * factor); };
  return { element: h("label", { className: "inline" }, label, field, unit), refresh };
}

/** The mapping on show as the service takes it. */
function whole() {
  return { columns: columnsOf(at.entries, at.columns),
    ...(at.longest_gap === null ? {} : { longest_gap: at.longest_gap }), step: at.step };
}

async function apply() {
  host.say("", "Applying …");
  await at.asked;
  try {
    at.row = await api.setMapping(at.row.id, whole());
  } catch (error) {
    host.refused(error);
    showWrong(error.message);
    return false;
  }
  Object.assign(at, { applied: true, outcome: at.row });
  host.changed(false);
  host.took(at.row);
  host.say("", at.row.usable_for_identification ? "It has all that an identification needs."
    : "Conditioning comes next, which makes what a fit lacks of raw sensors.");
  return true;
}

/** Lead to the column that a refusal is about: it names the column or its channel. */
function showWrong(text) {
  const [index] = [...at.entries].find(([one, { channel }]) =>
    text.includes(`${channel}:`) || text.includes(`mapped as ${channel},`) || text.includes(`column ${at.columns[one].name}`)) ?? [];
  if (index === undefined) return;
  select(index);
  at.rows.get(index)?.scrollIntoView({ block: "nearest" });
}

async function forget() {
  try {
    const row = await api.forgetMapping(at.row.id);
    host.took(row);
    parts.view.replaceWith(await open(row, host));
    host.changed(false);
    host.say("", "The file goes by the names of its columns again.");
    shown();
  } catch (error) {
    host.refused(error);
  }
}

