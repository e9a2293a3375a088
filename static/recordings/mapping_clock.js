// Clocks of a file's columns: which each goes by, and which the run will have.
//
// `of` is {columns, entries, step} of a mapping on show.

import * as units from "../common/units.js";

/** Which clock the run will have, where the columns have several. */
export function clocks(of) {
  const { columns, entries, step } = of;
  const found = new Map();
  for (const [index, { channel }] of entries) {
    const clock = clockOf(columns[index], of);
    if (channel !== "time" && clock) found.set(clock.key, clock);
  }
  if (found.size < 2) return "";
  const [finest] = [...found.values()].sort((one, other) => one.step - other.step);
  return `The mapped columns have ${found.size} clocks; the run takes ` +
    `${step ? `a sample every ${units.plain(1000 * step)} ms` : `the finest, ${finest.told}`}, ` +
    "and the others are interpolated to it.";
}

const SECONDS = { s: 1, ms: 1e-3, us: 1e-6, "µs": 1e-6, min: 60 };

/** {key, step, told} of the clock that the file tells of a column, or null; `step` is in s. */
export function clockOf({ clock, step, samples, group }, { columns, entries }) {
  if (clock === null) {
    return step === null ? null
      : { key: `step ${step} ${samples}`, step, told: every(step) + (group ? `, as in ${group}` : "") };
  }
  const { name, unit, minimum, maximum } = columns[clock];
  const factor = SECONDS[entries.get(clock)?.unit ?? (unit || "s")];
  const mean = minimum === null || samples < 2 || !factor ? Infinity : factor * (maximum - minimum) / (samples - 1);
  return { key: `column ${clock}`, step: mean,
    told: `${name}${group ? ` of ${group}` : ""}${mean < Infinity ? `, ${every(mean)}` : ""}` };
}

const every = (step) => `every ${units.plain(1000 * step, 4)} ms`;
