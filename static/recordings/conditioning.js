// What is done to a recording before it is used: steps, why they are suggested, and what they did.

import * as api from "../common/api.js";
import { h, inPlace } from "../common/dom.js";
import { beforeAndAfter, legend } from "../common/envelope.js";
import { get, set } from "../common/store.js";
import * as units from "../common/units.js";
import { KINDS, fieldsOf } from "./conditioning_fields.js";

const SAMPLES = 1500;
/** A delay is given, or found against a reference. */
const EXCLUSIVE = { seconds: "reference", reference: "seconds" };

let host = null;
/** What is on show: row, raw (names of the channels recorded), suggestion, kinds (a step of each, in the order in which they belong), record, above (Hz, what to compare the run above), steps, applied (those in force), vehicle (of those), wrong (place of the step that was refused), channel, chosen (by hand). */
let at = null;
let plot = null;
const parts = {};

/** The view of a recording's conditioning. */
export async function open(row, itsHost) {
  host = itsHost;
  const [raw, found] = await Promise.all([
    api.measurement(row.id, null, 2, "stride", false), api.conditioning(row.id)]);
  at = { row, channel: null, steps: [], raw: Object.keys(raw.values).filter((name) => name !== "time") };
  took(found);
  if (!at.applied.length) at.steps = structuredClone(at.suggestion.steps);
  parts.head = h("div");
  parts.steps = h("ol", { className: "steps" });
  parts.side = h("div", { className: "conditioning-side" });
  parts.apply = h("button", { type: "button", id: "apply-steps", on: { click: () => apply(at.steps) } }, "Apply");
  parts.undo = h("button", { type: "button", id: "as-recorded", on: { click: () => apply([]) } }, "As recorded");
  parts.download = h("a", { className: "button", download: "", href: api.runUrl(row.id),
    title: "The recording as it is conditioned, in SI" }, "Download CSV");
  parts.next = h("span");
  host.tools(parts.download, parts.undo, parts.next, parts.apply);
  show();
  return h("div", { className: "conditioning" },
    h("div", { className: "conditioning-steps scrolls" }, parts.head, parts.steps, adding()), parts.side);
}

export function shown() {
  draw();
}

/** What the service knows of the recording. */
function took({ steps, record, output_highpass_hz: above, suggestion, kinds, measurement, vehicle }) {
  // A file may bring records of its own; those of the steps come behind them.
  Object.assign(at, { row: measurement, applied: steps, above, suggestion, kinds, vehicle, wrong: null,
    record: steps.length ? record.slice(-steps.length) : [] });
  if (steps.length) at.steps = structuredClone(steps);
  const names = present();
  if (!at.chosen || !names.includes(at.channel)) {
    const made = new Set(at.record.flatMap(({ channels }) => channels));
    at.channel = ["chassis.z", "chassis.pitch", "wheel.fl.z"].find((name) => made.has(name)) ?? names[0] ?? null;
  }
}

const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
const isApplied = () => same(at.steps, at.applied);

function show() {
  head();
  steps();
  side();
  tools();
}

function tools() {
  const applied = isApplied();
  parts.apply.classList.toggle("primary", !applied);
  parts.apply.disabled = applied && !at.vehicle;
  parts.undo.hidden = !at.applied.length;
  parts.download.hidden = !at.applied.length || !applied;
  parts.next.replaceChildren(...[applied && (at.row.usable_for_identification || !at.steps.length)
    ? host.next(at.row) : null].filter(Boolean));
}

function head() {
  const { suggestion, applied, row } = at;
  const suggested = same(at.steps, suggestion.steps);
  const said = [];
  if (!suggestion.steps.length) {
    said.push(row.usable_for_identification && !applied.length
      ? "Nothing has to be done to this recording; add steps if you know better."
      : "No step is suggested.");
  } else if (!applied.length) {
    said.push(suggested ? "These steps are suggested and not applied yet; press Apply to do them."
      : "These are not the steps that are suggested.");
  } else {
    said.push(isApplied() ? `These steps are in force.${madeWith()}` : "These steps differ from those in force; press Apply to do them.");
  }
  parts.head.replaceChildren(
    h("div", { className: "row-tools" }, h("p", { className: "grow" }, said.join(" ")),
      suggestion.steps.length && !suggested
        ? h("button", { type: "button", id: "take-suggestion",
            on: { click: () => change(structuredClone(suggestion.steps)) } }, "Take the suggestion") : null));
}

/** Steps that need a car keep the one that they were done with. */
const madeWith = () => (at.vehicle
  ? ` They were done with the car “${at.vehicle.name}” as it was then; Apply does them with the present one.` : "");

/** What a fit lacks with the steps in force, or what it would lack after those suggested. */
function lacking() {
  if (isApplied() && at.row.usable_for_identification) {
    return h("p", { className: "has" }, "✓ Ready for fitting: it has all that an identification needs.");
  }
  const { lacks } = at.suggestion;
  const remedy = (name) => lacks.find((told) => told.startsWith(`${name}:`)) ?? `${name}.`;
  const inForce = isApplied();
  const told = inForce ? at.row.missing.map(remedy) : lacks;
  if (!told.length) return null;
  return h("div", { className: "lacks" },
    h("p", {}, inForce ? "✗ An identification still lacks:" : "✗ After the suggested steps an identification would still lack:"),
    h("ul", {}, told.map((text) => h("li", {}, text))),
    at.row.mapping ? h("p", {}, "If the file has a column that measures it, map it under Channels.") : null);
}

function steps() {
  inPlace(parts.steps, () => parts.steps.replaceChildren(...at.steps.map(stepRow)));
}

function stepRow(told, place) {
  const { label, what } = KINDS[told.kind];
  const suggested = at.suggestion.steps.findIndex((one) => same(one, told));
  const done = isApplied() ? at.record[place] : null;
  const named = `${label}, step ${place + 1}`;
  return h("li", { className: `step${place === at.wrong ? " wrong" : ""}` },
    h("div", { className: "step-head" },
      h("strong", {}, `${place + 1}  ${label}`), h("span", { className: "hint grow" }, what),
      button("↑", `Move up: ${named}`, place > 0, () => move(place, -1)),
      button("↓", `Move down: ${named}`, place < at.steps.length - 1, () => move(place, 1)),
      button("×", `Remove: ${named}`, true, () => change(at.steps.filter((_, k) => k !== place)))),
    h("div", { className: "step-fields" }, fieldsOf({ told, place }, known(), (key, value) => {
      const { [key]: _, ...rest } = told;
      const other = value === undefined ? null : EXCLUSIVE[key];
      if (other in rest) {
        delete rest[other];
        setTimeout(steps);
      }
      const changed = value === undefined ? rest : { ...rest, [key]: value };
      // Field by field: the row stays, so that the focus does.
      Object.keys(told).forEach((name) => delete told[name]);
      Object.assign(told, changed);
      edited();
    })),
    suggested >= 0 && !done
      ? h("p", { className: "hint" }, `Why: ${at.suggestion.reasons[suggested].replace(/^[\w-]+: /, "")}`) : null,
    done ? recordOf(done) : null);
}

const button = (text, label, usable, run) => h("button", { type: "button", className: "step-tool",
  "aria-label": label, title: label, disabled: !usable, on: { click: run } }, text);

/** What a step did. */
function recordOf({ channels, numbers, band_hz: { low, high }, sentences, warnings }) {
  const hertz = (value) => units.plain(value, 3);
  const band = low && high ? `True from ${hertz(low)} to ${hertz(high)} Hz.` : low ? `True above ${hertz(low)} Hz.`
    : high ? `True below ${hertz(high)} Hz.` : "";
  const found = Object.entries(numbers);
  return h("div", { className: "record" },
    sentences.map((text) => h("p", {}, text)),
    warnings.length ? h("ul", { className: "warnings" }, warnings.map((text) => h("li", {}, text))) : null,
    band ? h("p", { className: "strong" }, band) : null,
    channels.length || found.length
      ? h("details", {}, h("summary", { className: "soft" }, "numbers"),
          channels.length ? h("p", { className: "hint" }, `Writes ${channels.join(", ")}.`) : null,
          h("table", { className: "record-numbers" }, h("tbody", {}, found.map(([name, value]) =>
            h("tr", {}, h("th", { scope: "row" }, name), h("td", {}, units.number(value, 4))))))) : null);
}

/** Channels of the recording as it is with the steps in force. */
const present = () => at.row.channels.map(({ name }) => name).filter((name) => name !== "time");
/** Channels that steps may be about. */
const known = () => [...new Set([...at.raw, ...present(),
  ...at.suggestion.steps.flatMap(({ channels }) => channels ?? [])])];

function adding() {
  const choice = h("select", { id: "step-kind", "aria-label": "Kind of step to add" },
    at.kinds.map(({ kind }) => h("option", { value: kind, title: KINDS[kind].what }, `${KINDS[kind].label}: ${KINDS[kind].what}`)));
  return h("div", { className: "row-tools adding" }, choice,
    h("button", { type: "button", id: "add-step", on: { click: () => add(choice.value) } }, "Add step"));
}

/** A step more, before those that belong behind it. */
function add(kind) {
  const rank = (one) => at.kinds.findIndex((other) => other.kind === one);
  const behind = at.steps.findIndex((one) => rank(one.kind) > rank(kind));
  const place = behind < 0 ? at.steps.length : behind;
  change([...at.steps.slice(0, place), structuredClone(at.kinds[rank(kind)]), ...at.steps.slice(place)]);
}

function move(place, by) {
  const moved = [...at.steps];
  moved.splice(place + by, 0, ...moved.splice(place, 1));
  change(moved);
}

function change(next) {
  at.steps = next;
  edited();
  steps();
}

function edited() {
  at.wrong = null;
  host.changed(!isApplied() && !(same(at.steps, at.suggestion.steps) && !at.applied.length));
  host.say();
  head();
  tools();
  parts.outcome.replaceChildren(...outcome());
}

/** The place of the step that a refusal is about; not a number where it names none. */
const placeIn = (text) => Number(/step\[(\d+)\]/.exec(text)?.[1] ?? /, step (\d+), /.exec(text)?.[1] - 1);

async function apply(wanted) {
  const [lack] = wanted.flatMap(({ kind, ...told }, place) => KINDS[kind].fields
    .filter(({ key, form, optional }) => form === "channel" && !optional && !told[key])
    .map(() => ({ kind, place })));
  if (lack) {
    at.wrong = lack.place;
    steps();
    host.say("problem", `Step ${lack.place + 1}, ${KINDS[lack.kind].label}: choose its channel.`);
    return;
  }
  host.say("", wanted.length ? "Doing the steps …" : "Taking the steps back …");
  parts.apply.disabled = true;
  let found;
  try {
    found = await api.setConditioning(at.row.id, wanted);
  } catch (error) {
    host.refused(error);
    at.wrong = placeIn(error.message);
    steps();
    tools();
    return;
  }
  if (!wanted.length) at.steps = [];
  took(found);
  host.changed(false);
  host.took(at.row);
  host.say("", wanted.length ? `${wanted.length} step${wanted.length > 1 ? "s" : ""} done.` : "The recording is as it was recorded.");
  show();
  draw();
}

function side() {
  const names = [...new Set([...present(), ...at.raw])];
  const choice = h("select", { id: "conditioned-channel", "aria-label": "Channel to compare before and after",
    on: { change: () => { Object.assign(at, { channel: choice.value, chosen: true }); draw(); } } },
  names.map((name) => h("option", { value: name, selected: name === at.channel },
    `${name} · ${units.channel(name).label}${at.raw.includes(name) ? "" : ", made"}`)));
  parts.legend = h("div");
  parts.drawing = h("div", { className: "conditioning-plot" });
  parts.outcome = h("div", { className: "conditioning-outcome scrolls" }, outcome());
  inPlace(parts.side, () => parts.side.replaceChildren(
    h("div", { className: "row-tools" }, choice, parts.legend), parts.drawing, parts.outcome));
}

const outcome = () => [lacking(), highpass(),
  at.row.warnings.length ? h("ul", { className: "warnings" }, at.row.warnings.map((text) => h("li", {}, text))) : null].filter(Boolean);

/** What is slower than a band is not known; an identification should not compare it. */
function highpass() {
  const wanted = at.above;
  if (!wanted || !isApplied()) return null;
  const { output_highpass_hz: now } = get("rimsSettings");
  const hertz = `${units.plain(wanted, 3)} Hz`;
  if (now !== null && now >= wanted) {
    return h("p", { className: "has" }, `✓ Simulation and fit compare z, pitch and roll above ${units.plain(now, 3)} Hz.`);
  }
  return h("div", { className: "offer" },
    h("p", {}, `Slow motion is not known from accelerometers: compare z, pitch and roll above ${hertz} only. ` +
      "This holds for every run; it is under Identification, How recordings drive the model."),
    h("button", { type: "button", id: "use-highpass", on: { click: () => {
      set({ rimsSettings: { ...get("rimsSettings"), output_highpass_hz: wanted } });
      parts.outcome.replaceChildren(...outcome());
    } } }, `Compare above ${hertz}`));
}

/** The channel as recorded and as conditioned. */
async function draw() {
  plot?.destroy();
  plot = null;
  const { channel: name, row } = at;
  if (!name) return;
  const wanted = (conditioned) => api.measurement(row.id, [name], SAMPLES, "extremes", conditioned)
    .then((run) => ({ time: run.time, values: run.values[name] }));
  let before = null, after = null;
  try {
    // A channel that steps make was not recorded.
    [before, after] = await Promise.all([at.raw.includes(name) ? wanted(false) : null,
      at.applied.length && present().includes(name) ? wanted(true) : null]);
  } catch (error) {
    host.refused(error);
    return;
  }
  if (at.channel !== name || at.row !== row || !parts.drawing.isConnected) return;
  const { display_factor: factor, display_unit: unit } = units.channel(name);
  parts.legend.replaceChildren(legend(before, after));
  plot = beforeAndAfter(parts.drawing, before, after, factor, ["time, s", units.withUnit(name, unit, ", ")]);
}
