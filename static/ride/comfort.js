// Comfort and road holding in numbers: now against the car it is compared with.

import * as api from "../common/api.js";
import { $, fileName, h, saveFile } from "../common/dom.js";
import { span } from "../common/intervals.js";
import { nameOf } from "../common/names.js";
import { refused } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import { worded } from "../common/wording.js";
import { ofRide } from "./simulation.js";

const SAME = 0.001;

let table = null;
let lift = null;

export function build() {
  lift = h("label", {
    className: "inline", title: "Off, as in the paper: a tyre may pull on the road",
  }, h("input", {
    type: "checkbox", id: "lift-off",
    on: { change: (event) => set({ liftOff: event.target.checked }) },
  }), "Wheels may lift off");
  table = h("div");
  $("#comfort").append(table, h("div", { className: "row-tools after-table" }, lift,
    h("button", { type: "button", id: "save-run",
      title: "Every channel of the simulated ride as a measurement file", on: { click: save } },
      "Save run as CSV")));
  on("now reference measured compare trouble bands", show);
  show();
}

function show() {
  const now = get("now")?.head;
  const other = get("reference")?.head;
  lift.hidden = now?.mode === "rims";
  if (!now) {
    table.replaceChildren(h("p", { className: "empty" },
      worded(get("trouble")?.message ?? "The numbers come with the first simulation.")));
    return;
  }
  const name = get("compare") === "7dof" ? "7-DOF model" : "Baseline";
  const rows = now.metrics.map((metric) => row(metric, find(other, metric.name), find(get("bands")?.head, metric.name)));
  const figures = h("table", { className: "metrics" },
    h("thead", {}, h("tr", {},
      h("th", { scope: "col" }, "Metric of the ride"), h("th", { scope: "col" }, name),
      h("th", { scope: "col" }, "Now"), h("th", { scope: "col", className: "unit" }, "Unit"),
      h("th", { scope: "col" }, "Change"))),
    h("tbody", {}, rows));
  table.replaceChildren(...[fits(now, other, name), warnings(now), figures].filter(Boolean));
}

async function save() {
  const ride = get("ride");
  const name = ride.key ? `manoeuvre-${ride.key}`
    : nameOf(ride.id);
  try {
    const file = await api.simulateFile(ofRide({ vehicle: get("vehicle"), values: get("values") }));
    saveFile(file, `${fileName(name)}-simulated.csv`);
  } catch (error) {
    if (error.lost) set({ online: false });
    refused(error, "Saving the run");
  }
}

const find = (head, name) => head?.metrics.find((metric) => metric.name === name);

function row(metric, before, within) {
  const factor = metric.display_factor ?? 1;
  return h("tr", {},
    h("th", { scope: "row", title: metric.meaning ?? "" }, metric.label),
    h("td", {}, before ? units.number(before.value * factor, 3) : "–"),
    h("td", {}, units.number(metric.value * factor, 3), within?.interval ? spread(within.interval, factor) : null),
    h("td", { className: "unit" }, units.pretty(metric.display_unit ?? metric.unit)),
    changed(metric, before));
}

/** How far the errors of the fit leave a figure open. */
function spread(interval, factor) {
  const [low, high] = interval;
  const open = !Number.isFinite(low) || !Number.isFinite(high);
  return h("span", { className: "soft", title: `95 % by the errors of the fit: ${span(interval, factor)}` },
    open ? " ± ∞" : ` ± ${units.number(factor * (high - low) / 2, 2)}`);
}

/** The least load of a tyre; of all else less is better, in either sense. */
const HOLDS = /^tyre\.\w+\.load\.(least|p01)$/;

/** By how much a metric has changed; arrows say which way without colour. */
function changed(metric, before) {
  if (!before || Math.abs(before.value) <= 1e-12) return h("td", {}, "–");
  const change = (metric.value - before.value) / Math.abs(before.value);
  if (Math.abs(change) < SAME) return h("td", { className: "same" }, "same");
  const better = HOLDS.test(metric.name) ? change > 0 : Math.abs(metric.value) < Math.abs(before.value);
  const size = Math.abs(change) >= 9.995 ? `×${units.number(1 + change, 3)}`
    : `${units.number(100 * Math.abs(change), 2)} %`;
  return h("td", { className: better ? "better" : "worse" }, `${change < 0 ? "▼" : "▲"} ${size}`);
}

/** How far the simulated motion follows the measured one, channel by channel. */
function fits(now, other, name) {
  const channels = Object.keys(now.fit_percent ?? {});
  if (!channels.length) return null;
  const cell = (head, channel) =>
    h("td", {}, channel in (head.fit_percent ?? {}) ? percent(head.fit_percent[channel]) : "–");
  return h("table", { className: "metrics fits" },
    h("thead", {}, h("tr", {}, h("th", { scope: "col" }, "Follows the measurement"),
      other ? h("th", { scope: "col" }, name) : null, h("th", { scope: "col" }, "Now"))),
    h("tbody", {}, channels.map((channel) => h("tr", {},
      h("th", { scope: "row" }, units.channel(channel).label),
      other ? cell(other, channel) : null, cell(now, channel)))));
}

export const short = (channel) => channel.replace("chassis.", "");
/** A fit in percent; far below zero only says that it does not follow at all. */
export const percent = (value) => (value < -999 ? "< −999 %" : `${units.number(value, 3)} %`);

function warnings(now) {
  const share = Math.max(0, ...Object.values(now.negative_load_share ?? {}));
  const texts = [...(now.warnings ?? [])];
  if (share > 0) {
    texts.push(`A tyre pulls on the road during ${units.number(100 * share, 2)} % of the time: ` +
      "a real wheel would leave it there.");
  }
  return texts.length ? h("ul", { className: "warnings" }, texts.map((t) => h("li", {}, worded(t)))) : null;
}
