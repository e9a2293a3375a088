// Linked charts of the ride: measured, compared car and now, one time cursor for all and for 3D.

import { $, debounced, h, tabs } from "../common/dom.js";
import { AXIS, COLOURS, decadeLabels, decades, room } from "../common/plots.js";
import { get, on } from "../common/store.js";
import * as units from "../common/units.js";
import { worded } from "../common/wording.js";
import { CORNERS, locate } from "./poses.js";
import { density } from "./spectrum.js";
import { clock, onTime, seek } from "./timeline.js";

const SPECTRUM = "spectrum of ";
const GROUPS = {
  body: ["Body", ["chassis.z", "chassis.pitch", "chassis.roll"]],
  travel: ["Travel", CORNERS.map((c) => `suspension.${c}.travel`)],
  tyre: ["Tyres", CORNERS.map((c) => `tyre.${c}.load`)],
  seat: ["Seat", ["seat.driver.a_z", `${SPECTRUM}seat.driver.a_z`, "chassis.a_x", "chassis.v_x"]],
};
// The reference is dashed, so that not the colour alone tells it.
const RUNS = [
  { key: "measured", label: "measured", stroke: COLOURS.measured, width: 1, dash: [] },
  { key: "reference", label: "baseline", stroke: COLOURS.reference, width: 1.2, dash: [6, 4] },
  { key: "now", label: "now", stroke: COLOURS.now, width: 1.6, dash: [] },
];
/** Ends of the error band, whose area is filled. */
const ENDS = ["lower", "upper"];
/** The band does not make a chart higher than this many heights of the curve beyond it. */
const BAND_ROOM = 1;
const SYNC = "ride";
const FREQUENCIES = [0.2, 30];
const BOTTOM_AXIS = 38;
const BARE_AXIS = 10;
const CLICK_PIXELS = 4;
/** Decades of a spectrum that are shown below its peak; deeper ones are rounding errors. */
const DEPTH = 6;

const LINES = RUNS.length;

let group = "body";
let charts = [];
let hover = null;
let onGroup = () => {};
/** Time span that the charts show, or null for all of it. */
let zoom = null;

/** Channels that the visible charts need. */
export const visibleChannels = () =>
  GROUPS[group][1].map((name) => name.replace(SPECTRUM, ""));

/** Every channel that some chart shows. */
export const allChannels = () =>
  Object.values(GROUPS).flatMap(([, names]) => names).filter((name) => !name.startsWith(SPECTRUM));

/** What the browser tests look at: {channel: {measured, reference, now, lower, upper}} as drawn. */
export const drawn = () =>
  Object.fromEntries(charts.map(({ name, plot }) => [name,
    Object.fromEntries([...RUNS.map(({ key }) => key), ...(plot.data.length > LINES + 1 ? ENDS : [])]
      .map((key, i) => [key, Array.from(plot.data[i + 1])]))]));
export const zoomed = () => zoom;

/** Build the tabs; `changed` is called when other channels are needed. */
export function build(changed) {
  const list = $("#chart-tabs");
  for (const [key, [title]] of Object.entries(GROUPS)) {
    list.append(h("button", {
      role: "tab", type: "button", id: `charts-${key}`, "aria-controls": "chart-area",
    }, title));
  }
  list.append(h("span", { className: "chart-keys" }, h("span", { id: "band-place" }),
    h("span", { className: "legend-line", id: "legend" })));
  legend();
  tabs(list, (id) => {
    group = id.replace("charts-", "");
    lay();
    onGroup();
  });
  onGroup = changed;
  on("now reference measured trouble bands", fill);
  on("trouble", say);
  on("compare ride", legend);
  onTime(cursor);
  new ResizeObserver(debounced(resize, 60)).observe($("#chart-area"));
}

/** The charts begin anew at full length when another ride is chosen. */
export function showAll() {
  zoom = null;
  fill();
}

/** Why the ride could not be simulated, and what the lines are then. */
function say({ trouble, now }) {
  const box = $("#chart-note");
  box.hidden = !trouble;
  const kept = now ? [" The lines are those of the last car that could be simulated."] : [];
  box.replaceChildren(...(trouble ? [...worded(trouble.message), ...kept] : []));
}

function legend() {
  const other = { baseline: "baseline", "7dof": "7-DOF", none: null }[get("compare")];
  $("#legend").replaceChildren(
    ...RUNS.map(({ key, label }) => [key, key === "reference" ? other : label])
      .filter(([key, text]) => text && (key !== "measured" || get("ride")?.kind === "measurement"))
      .map(([key, text]) => h("span", { className: `key ${key}` }, text)),
  );
}

function lay() {
  charts.forEach(({ plot }) => plot.destroy());
  const area = $("#chart-area");
  area.replaceChildren();
  const names = GROUPS[group][1];
  charts = names.map((name, i) => chart(name, i === names.length - 1, area));
  resize();
  fill();
}

function chart(name, bottom, area) {
  const spectrum = name.startsWith(SPECTRUM);
  const row = units.channel(name.replace(SPECTRUM, ""));
  const factor = spectrum ? row.display_factor ** 2 : row.display_factor;
  const unit = spectrum ? `(${row.display_unit})²/Hz` : row.display_unit;
  const title = spectrum ? row.label.replace("acceleration", "spectrum") : row.label;
  const signed = row.quantity === "angle" && row.sign.length < 20;
  const sign = signed ? `, ${row.sign}` : "";
  const values = RUNS.map(({ key }) => h("span", { className: `reading ${key}` }));
  const box = h("figure", { className: "chart", dataset: { channel: name } },
    h("figcaption", {}, h("span", { className: "chart-title", title: row.sign ?? "" },
      `${title}${sign} `, h("span", { className: "unit" }, unit)), h("span", { className: "readings" }, values)),
    h("p", { className: "chart-empty", hidden: true }));
  area.append(box);
  const plot = new window.uPlot(options(name, spectrum, bottom || spectrum), columns([], RUNS.map(() => []), spectrum ? null : [[], []]), box);
  const line = h("div", { className: "time-line" });
  if (!spectrum) plot.over.append(line);
  plot.root.setAttribute("role", "img");
  plot.root.setAttribute("aria-label", `${title} over ${spectrum ? "frequency" : "time"}`);
  return { name, spectrum, bottom: bottom || spectrum, plot, box, line, values, factor };
}

function options(name, spectrum, labelled) {
  const config = {
    width: 300, height: 120, legend: { show: false }, padding: [6, 14, 0, 0],
    scales: {
      x: spectrum ? { time: false, distr: 3, range: [...FREQUENCIES] } : { time: false },
      y: spectrum ? { distr: 3, range: deep } : { range: room },
    },
    axes: [
      { ...AXIS, size: labelled ? BOTTOM_AXIS : BARE_AXIS, gap: 3, labelSize: 14,
        label: labelled ? (spectrum ? "frequency, Hz" : "time, s") : undefined,
        labelFont: AXIS.font, labelGap: 0, values: labelled ? undefined : (_, s) => s.map(() => "") },
      { ...AXIS, size: 46, gap: 4 },
    ],
    series: [{}, ...RUNS.map(({ label, stroke, width, dash }) => ({
      label, stroke, width, dash, points: { show: false }, spanGaps: false,
    })), ...(spectrum ? [] : ENDS.map((label) => ({ label, width: 0, points: { show: false }, spanGaps: false })))],
    bands: spectrum ? [] : [{ series: [LINES + 2, LINES + 1], fill: COLOURS.band }],
    cursor: { points: { show: false }, drag: { x: true, y: false, setScale: true } },
    hooks: { setCursor: [pointed], ready: [clickable] },
  };
  if (spectrum) {
    config.axes[0].splits = () => [0.2, 0.5, 1, 2, 5, 10, 20];
    config.axes[0].values = (_, splits) => splits;
    config.axes.forEach((axis) => { axis.filter = (_, splits) => splits; });
    config.axes[1].splits = (_, _axis, low, high) => decades(low, high);
    config.axes[1].values = decadeLabels;
    config.cursor.drag = { x: false, y: false };
    config.cursor.show = false;
    config.hooks = {};
  } else {
    config.cursor.sync = { key: SYNC, setSeries: false };
    config.hooks.setScale = [(plot, key) => key === "x" && zoomedTo(plot)];
  }
  return config;
}

/** Whole decades around a spectrum. */
function deep(_, low, high) {
  if (!(high > 0)) return [0.1, 1];
  const top = Math.ceil(Math.log10(high) - 1e-9);
  const bottom = low > 0 ? Math.floor(Math.log10(low) + 1e-9) : -Infinity;
  return [10 ** Math.max(bottom, top - DEPTH), 10 ** top];
}

/** Draw the runs on the grid of the first that is there. */
function fill() {
  const runs = RUNS.map(({ key }) => get(key));
  const base = get("now") ?? get("reference") ?? get("measured");
  for (const entry of charts) {
    const { name, spectrum, plot, box, factor } = entry;
    const channel = name.replace(SPECTRUM, "");
    const data = runs.map((run) => run?.values[channel] ?? null);
    const empty = box.querySelector(".chart-empty");
    const nothing = !data.some(Boolean) && Boolean(base ?? get("trouble"));
    empty.hidden = !nothing;
    empty.textContent = base ? "Not in this ride." : "Not simulated.";
    box.classList.toggle("nothing", nothing);
    if (spectrum) {
      fillSpectrum(entry, runs, channel);
      continue;
    }
    const x = base ? base.time : [];
    plot.batch(() => {
      plot.setData(columns(x, runs.map((run, i) => onGrid(run, data[i], base, factor)), within(channel, base, factor)), false);
      const [min, max] = zoom ?? [x[0] ?? 0, x[x.length - 1] ?? 1];
      plot.setScale("x", { min, max });
    });
  }
  cursor();
}

const columns = (x, lines, band) => [x, ...lines, ...(band ?? [])];

/** Both ends of a channel's band; empty where there is none. */
function within(channel, base, factor) {
  const run = get("bands");
  const nothing = Array(base ? base.time.length : 0).fill(null);
  const curve = get("now")?.values[channel];
  if (!run || !curve || !run.values[`${channel}.lower`]) return [nothing, nothing];
  const [low, high] = curve.reduce(([least, most], v) => [Math.min(least, v), Math.max(most, v)], [Infinity, -Infinity]);
  const beyond = BAND_ROOM * (high - low) || Infinity;
  return ENDS.map((end) => onGrid(run, run.values[`${channel}.${end}`], base, factor)
    .map((v) => (v === null ? null : Math.min(Math.max(v, (low - beyond) * factor), (high + beyond) * factor))));
}

function fillSpectrum({ plot, factor }, runs, channel) {
  const spectra = runs.map((run) =>
    run?.values[channel] ? density(run.time, run.values[channel]) : null);
  const first = spectra.find(Boolean);
  if (!first) {
    plot.setData([[], [], [], []]);
    return;
  }
  const keep = first.frequency.map((f, i) => i).filter((i) => first.frequency[i] <= FREQUENCIES[1]);
  plot.setData([
    keep.map((i) => first.frequency[i]),
    ...spectra.map((s) => keep.map((i) => s && densityAt(s, first.frequency[i], factor))),
  ]);
}

/** Between the frequencies of a spectrum, which are the multiples of the first; null beyond them. */
function densityAt({ frequency, density: found }, f, factor) {
  const place = f / frequency[0] - 1;
  const i = Math.round(place);
  if (Math.abs(place - i) < 1e-6) return i < found.length ? found[i] * factor : null;
  const low = Math.floor(place);
  if (low < 0 || low + 1 >= found.length) return null;
  return ((low + 1 - place) * found[low] + (place - low) * found[low + 1]) * factor;
}

/** Lines on the shown grid, kept per run: a slider changes one run of three. */
const lines = new WeakMap();

function onGrid(run, values, base, factor) {
  if (!values) return Array(base ? base.time.length : 0).fill(null);
  const kept = lines.get(values);
  if (kept && sameGrid(kept.base, base)) return kept.line;
  const line = resampled(run, values, base, factor);
  lines.set(values, { base, line });
  return line;
}

const sameGrid = (a, b) =>
  a === b || (a.time.length === b.time.length && a.time[0] === b.time[0] &&
    a.time[1] === b.time[1] && a.time[a.time.length - 1] === b.time[b.time.length - 1]);

function resampled(run, values, base, factor) {
  const shown = (v) => (Number.isFinite(v) ? v * factor : null);
  if (sameGrid(run, base)) return Array.from(values, shown);
  const last = run.time[run.time.length - 1];
  return Array.from(base.time, (t) => {
    if (t < run.time[0] - 1e-6 || t > last + 1e-6) return null;
    const [i, w] = locate(run.time, t);
    return shown(w ? (1 - w) * values[i] + w * values[i + 1] : values[i]);
  });
}

function zoomedTo(plot) {
  const x = plot.data[0];
  if (!x.length) return;
  const { min, max } = plot.scales.x;
  const whole = min <= x[0] + 1e-9 && max >= x[x.length - 1] - 1e-9;
  const span = whole ? null : [min, max];
  if (String(span) === String(zoom)) {
    cursor();
    return;
  }
  zoom = span;
  for (const { plot: other, spectrum } of charts) {
    if (other !== plot && !spectrum) other.setScale("x", { min, max });
  }
  cursor();
}

function pointed(plot) {
  const at = plot.cursor.left >= 0 ? plot.posToVal(plot.cursor.left, "x") : null;
  hover = at;
  readings();
}

/** A click without a drag goes to that time. */
function clickable(plot) {
  let from = 0;
  plot.over.addEventListener("mousedown", (event) => { from = event.clientX; });
  plot.over.addEventListener("mouseup", (event) => {
    if (Math.abs(event.clientX - from) > CLICK_PIXELS) return;
    seek(plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x"));
  });
}

function cursor() {
  for (const { plot, line, spectrum } of charts) {
    if (spectrum || !plot.data[0].length) continue;
    const { min, max } = plot.scales.x;
    const inside = clock.time >= min && clock.time <= max;
    line.hidden = !inside;
    if (inside) line.style.transform = `translateX(${plot.valToPos(clock.time, "x")}px)`;
  }
  readings();
}

/** Numbers at the pointer, else at the time of the ride. */
function readings() {
  const t = hover ?? clock.time;
  for (const { plot, values, spectrum } of charts) {
    if (spectrum) continue;
    const { min, max } = plot.scales.y;
    const decimals = Math.min(Math.max(Math.round(2.6 - Math.log10(max - min || 1)), 0), 6);
    const [i, w] = plot.data[0].length ? locate(plot.data[0], t) : [0, 0];
    values.forEach((element, k) => {
      const value = plot.data[k + 1]?.[w > 0.5 ? i + 1 : i];
      const text = value === null || value === undefined ? "" : units.fixed(value, decimals);
      if (element.textContent !== text) element.textContent = text;
    });
  }
}

function resize() {
  const area = $("#chart-area");
  if (!charts.length || !area.clientWidth) return;
  const captions = charts.reduce((sum, c) => sum + c.box.firstChild.offsetHeight + 4, 0);
  const axes = charts.reduce((sum, c) => sum + (c.bottom ? BOTTOM_AXIS : BARE_AXIS), 0);
  const each = Math.max((area.clientHeight - captions - axes - 6 * charts.length) / charts.length, 48);
  for (const { plot, bottom } of charts) {
    plot.setSize({
      width: area.clientWidth,
      height: Math.floor(each) + (bottom ? BOTTOM_AXIS : BARE_AXIS) + 6,
    });
  }
  cursor();
}
