// What columns are taken for: the entries of a mapping by the column that each is about.
//
// An entry is {channel, unit, sign, gain, missing, note, confidence, doubted}; `confidence` is null
// for one that a person made.

export const BY_HAND = "set by hand";
/** Confidence below which an entry is worth a look. */
const UNSURE = 0.7;

/** What an identification needs; one of OUTPUTS is enough. */
const INPUTS = ["time", "wheel.fl.z", "wheel.fr.z", "wheel.rl.z", "wheel.rr.z", "chassis.a_x"];
const OUTPUTS = ["chassis.z", "chassis.pitch", "chassis.roll"];

/** Units that test departments write, by quantity; any other may be typed. */
export const USUAL_UNITS = {
  time: ["s", "ms", "us", "min"],
  displacement: ["mm", "cm", "m", "in"],
  angle: ["deg", "rad", "mrad"],
  acceleration: ["m/s^2", "g", "mg"],
  speed: ["km/h", "m/s", "mph"],
  distance: ["m", "km"],
  force: ["N", "kN"],
  torque: ["N m", "kN m"],
  "angular rate": ["deg/s", "rad/s"],
};

/** Columns that an entry of a mapping is about, as engine/mapping/mapping.py finds them. */
function places(columns, { column, group }) {
  const named = columns.filter(({ name }) => name === column);
  const grouped = named.filter((one) => one.group === (group ?? ""));
  return grouped.length ? grouped : group && named.length > 1 ? [] : named;
}

/** {entries: Map of column index to entry, lost: names of columns that the file does not have}. */
export function entriesOf(mapping, columns) {
  const entries = new Map(), lost = [];
  for (const { column, group, ...told } of mapping.columns) {
    const found = places(columns, { column, group });
    if (found.length !== 1) {
      lost.push(column);
      continue;
    }
    const { guess, candidates, stand_ins: standIns } = found[0];
    const likely = [guess, ...candidates].find((one) =>
      one && one.channel === told.channel && one.unit === told.unit
        && (one.reason === told.note || (one.doubted && one.reason.startsWith("template"))));
    const missing = told.missing ?? (standIns.length ? standIns.map(({ value }) => value) : null);
    entries.set(found[0].index, { sign: 1, gain: 1, note: "", ...told, missing,
      confidence: likely?.confidence ?? null, doubted: likely?.doubted ?? false });
  }
  return { entries, lost };
}

/** The entry of a column as the channel that a candidate names. */
export function entryFor(column, { channel, unit, sign, confidence, doubted, reason }) {
  const missing = column.stand_ins.length ? column.stand_ins.map(({ value }) => value) : null;
  return { channel, unit, sign, gain: 1, missing, confidence, doubted, note: reason };
}

/** The columns of a mapping as the service takes it. */
export function columnsOf(entries, columns) {
  return [...entries].sort(([one], [other]) => one - other)
    .map(([index, { confidence: _, doubted: __, missing, ...entry }]) => ({
      column: columns[index].name, group: columns[index].group, ...entry, ...(missing ? { missing } : {}) }));
}

/** Why the entry of a column is worth a look, in a word or two; "" for one that is not. */
export function doubt({ confidence, doubted, sign, note }, { unit }) {
  if (doubted) return unit ? "unit doubted" : "unit guessed";
  if (sign < 0 && confidence !== null && !note.startsWith("template")) return "sign turned over";
  return confidence !== null && confidence < UNSURE ? "unsure" : "";
}

/** [{name, has}] of what an identification needs. */
export function needs(entries, columns) {
  const taken = new Set([...entries.values()].map(({ channel }) => channel));
  if (columns.some(({ clock, step }, index) => entries.has(index) && (clock !== null || step !== null))) {
    taken.add("time");
  }
  return [...INPUTS.map((name) => ({ name, has: taken.has(name) })),
    { name: "z, pitch or roll", has: OUTPUTS.some((name) => taken.has(name)) }];
}

/** Channels of raw sensors, of which conditioning makes what is needed. */
export const isRaw = (name) =>
  /^chassis\.(body_a_[xyz]|a_z|v_x|pitch_rate|roll_rate)$|^wheel\.\w+\.(a_z|speed)$|^suspension\.\w+\.travel$/.test(name);

/** The channels in the order in which they are offered: [[heading, names]]. */
export function offered(names) {
  const fitting = names.filter((name) => INPUTS.includes(name) || OUTPUTS.includes(name));
  const raw = names.filter(isRaw);
  const rest = names.filter((name) => !fitting.includes(name) && !raw.includes(name));
  return [["Needed for fitting", fitting], ["Raw sensors, for conditioning", raw], ["Others", rest]];
}
