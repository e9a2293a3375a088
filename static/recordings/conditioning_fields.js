// The steps of conditioning as rows of fields: what each kind takes, in which unit, and what holds untold.

import { h } from "../common/dom.js";
import * as units from "../common/units.js";

const CORNERS = ["fl", "fr", "rl", "rr"];
const BAND = (key, label, untold) => ({ key, label, form: "numbers", count: 2, unit: "Hz", untold });
const NUMBER = (key, label, unit, untold = null, hint = "") => ({ key, label, form: "number", unit, untold, hint });

/** Kind -> {label, what, fields}; as docs/conditioning.md has them. */
export const KINDS = {
  cut: { label: "Cut", what: "keeps the samples between",
    fields: [NUMBER("begin", "from", "s", null, "begin"), NUMBER("end", "to", "s", null, "end")] },
  fill: { label: "Fill gaps", what: "bridges short gaps by a smooth curve",
    fields: [{ key: "channels", label: "of", form: "channels", untold: [], all: "all channels" },
      NUMBER("longest", "up to", "s", 0.1)] },
  despike: { label: "Take out spikes", what: "a straight line in place of samples that tower over their neighbours",
    fields: [{ key: "channels", label: "of", form: "channels", untold: [], all: "all channels" }] },
  resample: { label: "Resample", what: "even samples, behind an anti-alias filter on the way down",
    fields: [NUMBER("rate_hz", "to", "Hz")] },
  scale: { label: "Gain and bias", what: "(reading − bias) / gain; a gain of −1 turns a sensor round",
    fields: [{ key: "channel", label: "of", form: "channel" }, NUMBER("gain", "gain", "", 1),
      NUMBER("bias", "bias", "of the channel", 0)] },
  rest: { label: "Count from rest", what: "takes off what sensors read while the car stands",
    fields: [{ key: "channels", label: "of", form: "channels", untold: [], all: "all that count from rest" },
      { key: "interval", label: "standing from, to", form: "numbers", count: 2, unit: "s", untold: null, hint: "found" }] },
  delay: { label: "Take off a delay", what: "moves a channel that is late; found against a reference, or given",
    fields: [{ key: "channel", label: "of", form: "channel" },
      { key: "reference", label: "against", form: "channel", optional: true },
      NUMBER("seconds", "or by", "s", null, "found"),
      { key: "order", label: "reference", form: "choice", untold: 0,
        options: [[-2, "integrated twice"], [-1, "integrated"], [0, "as it is"], [1, "differentiated"], [2, "differentiated twice"]] },
      BAND("band_hz", "in the band", [0.5, 5]), NUMBER("longest", "at most", "s", 0.5)] },
  speed: { label: "Speed", what: "v_x from wheel speeds, a_x as the slope of v_x",
    fields: [{ key: "source", label: "from", form: "choice", untold: "v_x", options: [["v_x", "v_x as it is"], ["wheels", "wheel speeds"]] },
      { key: "acceleration", label: "makes a_x", form: "flag", untold: false },
      NUMBER("cutoff_hz", "below", "Hz", 2)] },
  angles: { label: "Angle from gyro", what: "pitch or roll by its rate, held to gravity by the accelerometer below the crossover",
    fields: [{ key: "angle", label: "angle", form: "choice", options: [["pitch", "pitch"], ["roll", "roll"]] },
      { key: "accelerometer", label: "with accelerometer", form: "flag", untold: true },
      NUMBER("crossover_hz", "crossover", "Hz", 0.2)] },
  gravity: { label: "Take off gravity", what: "a_x and a_z of the CG from the body-fixed accelerometer",
    fields: [{ key: "position", label: "sensor from CG: x, y, z", form: "numbers", count: 3, unit: "m", untold: [0, 0, 0] },
      NUMBER("rate_cutoff_hz", "rates below", "Hz", 20)] },
  displacement: { label: "Integrate twice", what: "heights from vertical accelerations, in a band",
    fields: [{ key: "channels", label: "of", form: "channels", all: "none", fitting: /^(chassis|wheel\.\w+)\.a_z$/ }, BAND("band_hz", "in the band", [0.3, 50])] },
  "rim-from-travel": { label: "Wheels from travel", what: "wheel heights by potentiometers, z, pitch and roll",
    fields: [{ key: "corners", label: "of", form: "channels", untold: CORNERS, from: CORNERS, all: "no corner" },
      { key: "geometry", label: "wheel moves", form: "choice", untold: "vertical", options: [["vertical", "vertically"], ["arm", "on the car's arms"]] }] },
};

/** The fields of a step; `change(key, value)` is told what was entered, undefined for what holds untold. */
export function fieldsOf(step, names, change) {
  const place = `step ${step.place + 1}`;
  return KINDS[step.told.kind].fields.map((field) => {
    const value = step.told[field.key] ?? field.untold ?? null;
    const unit = field.unit === "of the channel" ? units.pretty(units.channel(step.told.channel ?? "").unit) : field.unit;
    const control = FORMS[field.form](field, value, (entered) => change(field.key, entered), names,
      `${KINDS[step.told.kind].label}, ${place}, ${field.label}`);
    return h(field.form === "channels" ? "div" : "label", { className: "step-field" },
      h("span", { className: "soft" }, field.label), control,
      unit ? h("span", { className: "unit" }, unit) : null);
  });
}

const FORMS = {
  number(field, value, change, _, label) {
    const element = box(value, field.hint, label, () =>
      change(element.value === "" ? undefined : Number(element.value)));
    return element;
  },
  numbers(field, value, change, _, label) {
    const boxes = Array.from({ length: field.count }, (__, k) => box(value?.[k] ?? null, field.hint ?? "", `${label}, ${k + 1}`, () => {
      const entered = boxes.map((one) => one.value);
      if (entered.every((one) => one === "")) change(undefined);
      else if (entered.every((one) => one !== "")) change(entered.map(Number));
    }));
    return h("span", { className: "step-numbers" }, boxes);
  },
  choice(field, value, change, _, label) {
    const element = h("select", { "aria-label": label, on: { change: () => change(field.options[element.selectedIndex][0]) } },
      field.options.map(([key, text]) => h("option", { selected: key === value }, text)));
    return element;
  },
  flag(_, value, change, __, label) {
    const element = h("input", { type: "checkbox", checked: value, "aria-label": label,
      on: { change: () => change(element.checked) } });
    return element;
  },
  channel(field, value, change, names, label) {
    const known = value && !names.includes(value) ? [value, ...names] : names;
    const element = h("select", { "aria-label": label, on: { change: () => change(element.value || undefined) } },
      h("option", { value: "", selected: !value }, field.optional ? "nothing" : "choose"),
      known.map((name) => h("option", { value: name, selected: name === value }, name)));
    return element;
  },
  channels(field, value, change, names, label) {
    const from = field.from ?? [...new Set([...names, ...value ?? []])].filter((name) => !field.fitting || field.fitting.test(name));
    const chosen = new Set(value ?? []);
    const summary = h("summary", { "aria-label": label });
    const told = () => {
      summary.textContent = chosen.size === 0 ? field.all : chosen.size > 3 ? `${chosen.size} of ${from.length}` : [...chosen].join(", ");
    };
    told();
    return h("details", { className: "step-channels" }, summary, h("div", { className: "step-channel-list scrolls" }, from.map((name) => {
      const one = h("input", { type: "checkbox", checked: chosen.has(name), on: { change: () => {
        if (one.checked) chosen.add(name);
        else chosen.delete(name);
        told();
        change(from.filter((other) => chosen.has(other)));
      } } });
      return h("label", { className: "inline" }, one, name);
    })));
  },
};

const box = (value, hint, label, entered) => h("input", { type: "number", step: "any", placeholder: hint ?? "",
  value: value === null ? "" : units.plain(value, 6), "aria-label": label, on: { change: entered } });
