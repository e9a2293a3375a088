// One column of a file close up: its numbers over time, what it may be and why.

import * as api from "../common/api.js";
import { breakable, h } from "../common/dom.js";
import { envelope } from "../common/envelope.js";
import * as units from "../common/units.js";

const POINTS = 600;
/** How long a column is selected before it is read, ms. */
const PAUSE = 120;

let plot = null;
let shown = {};

/**
 * Show a column in a panel. `entry` is what it is taken for, or nothing.
 * `clock` tells its time; `edit(changes)` and `choose(channel)` change the entry.
 */
export function show(panel, row, column, entry, { clock, edit, choose }) {
  const drawing = h("div", { className: "column-plot" });
  const again = shown.row === row.id && shown.index === column.index;
  if (!again) shown = { row: row.id, index: column.index, seen: null };
  const info = entry && units.channel(entry.channel);
  panel.replaceChildren(...[
    h("h3", {}, breakable(column.name)),
    column.comment ? h("p", { className: "hint" }, column.comment) : null,
    drawing,
    h("p", { className: "hint" }, `Time: ${clock}.`),
    entry
      ? h("p", {}, h("strong", {}, entry.channel), `, ${info.label}`, info.sign ? `; positive: ${info.sign}.` : ".")
      : h("p", { className: "hint" }, "Not used. Choose a channel in its row, or one of these:"),
    entry?.note ? h("p", { className: "hint" }, `Why: ${entry.note}.`) : null,
    h("ul", { className: "pick candidates" }, column.candidates
      .filter(({ channel }) => channel !== entry?.channel)
      .map(({ channel, confidence, reason, unit }) => h("li", {}, h("button", { type: "button",
        on: { click: () => choose(channel) } },
      h("span", {}, `${channel} in ${unit || "no unit"}, ${Math.round(100 * confidence)} %`),
      h("span", { className: "soft" }, reason))))),
    entry ? h("div", { className: "column-fields" }, gain(column, entry, edit), missing(column, entry, edit)) : null,
  ].filter(Boolean));
  look(drawing, row, column, entry);
}

function gain(column, entry, edit) {
  const field = h("input", { type: "number", step: "any", value: units.plain(entry.gain, 8),
    "aria-label": `Gain of ${column.name}`,
    on: { change: () => edit({ gain: field.value === "" ? 1 : Number(field.value) }) } });
  return h("label", { className: "block", title: "By which every number is multiplied, e.g. of a calibration" }, "Gain", field);
}

function missing(column, entry, edit) {
  const field = h("input", { type: "text", value: entry.missing?.join(", ") ?? "", placeholder: "none",
    "aria-label": `Missing numbers of ${column.name}`,
    on: { change: () => {
      const found = field.value.split(/[,;\s]+/).filter(Boolean).map(Number);
      field.setCustomValidity(found.every(Number.isFinite) ? "" : "Write numbers, such as -64, 999.");
      if (field.reportValidity()) edit({ missing: field.value.trim() || entry.missing ? found : null });
    } } });
  return h("label", { className: "block", title: "Numbers that stand for nothing measured" }, "Missing numbers", field);
}

/** Draw what the service says of the column; once asked, another unit or sign is only drawn anew. */
async function look(drawing, row, column, entry) {
  plot?.destroy();
  plot = null;
  const mine = shown;
  drawing.replaceChildren(h("p", { className: "hint" }, "Reading …"));
  let seen;
  try {
    // Columns that are only passed by are not read.
    if (!mine.seen) await new Promise((done) => setTimeout(done, PAUSE));
    if (!drawing.isConnected) return;
    mine.seen ??= api.columnPreview(row.id, column.index, POINTS);
    seen = await mine.seen;
  } catch (error) {
    mine.seen = null;
    if (error.code === undefined) throw error;
    drawing.replaceChildren(h("p", { className: "hint" }, error.message));
    return;
  }
  if (!drawing.isConnected) return;
  drawing.replaceChildren();
  const gaps = new Set(entry?.missing ?? []);
  const without = (values) => values.map((value) => (gaps.has(value) ? null : value));
  plot = envelope(drawing, { time: seen.time, minimum: without(seen.minimum), maximum: without(seen.maximum) },
    entry ? entry.sign * entry.gain : 1,
    [seen.time_unit === "sample" ? "sample" : `time, ${seen.time_unit}`,
      units.withUnit(entry?.channel ?? "as in the file", entry ? entry.unit : column.unit, ", ")]);
}
