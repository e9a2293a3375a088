// Display units, in one place: the service's tables say how SI is shown.

import { capital } from "./dom.js";

const channels = new Map();
const parameters = new Map();

/** Take the tables of /api/channels and /api/parameters. */
export function learn(channelRows, parameterRows) {
  for (const [rows, table] of [[channelRows, channels], [parameterRows, parameters]]) {
    for (const row of rows) table.set(row.name, { ...row, display_unit: pretty(row.display_unit) });
  }
}

/** `m/s^2` as it is written by hand; angles are in deg everywhere, as in a file's header. */
export const pretty = (unit) =>
  unit.replace("^2", "²").replace("^1.75", "¹·⁷⁵").replace("°", "deg");

/** A channel's row, or a plain one for a name the table does not have. */
export function channel(name, unit = "") {
  return channels.get(name) ?? atPoint(name, unit);
}

/** Accelerations at chassis points follow a pattern, since the points are the user's own. */
function atPoint(name, unit) {
  const [, kind, point, axis] = /^(seat|point)\.(\w+)\.a_([xyz])$/.exec(name) ?? [];
  const where = point?.replaceAll("_", " ");
  const label = point
    ? `${capital(where)}${kind === "seat" ? " seat" : ""} acceleration, along ${axis}` : name;
  return { name, label, unit, display_unit: point ? "m/s²" : unit, display_factor: 1 };
}

/** A number's text with its unit, which a ratio has none of. */
export const withUnit = (text, unit, between = " ") => (unit ? `${text}${between}${unit}` : text);

export const parameter = (name) => parameters.get(name);

/** A number for reading: `digits` significant, no exponent for sizes a person meets. */
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (Math.abs(value) < 1e-9) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size >= 7 || size < -5) return minus(value.toExponential(digits - 1));
  return minus(value.toFixed(Math.min(Math.max(digits - 1 - size, 0), 6)));
}

/** A number with so many decimals, for readings that change in place. */
export const fixed = (value, decimals) => {
  const text = value.toFixed(decimals);
  return minus(Number(text) === 0 ? (0).toFixed(decimals) : text);
};

/** The same without padding zeros, as an input field wants it. */
export function plain(value, digits = 5) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : "";
}

/** A number for a field seven characters wide. */
export function short(value) {
  const digits = [5, 4, 3].find((count) => plain(value, count).length <= 7) ?? 3;
  return plain(value, digits);
}

const minus = (text) => text.replace("-", "−");

/** Units of a vehicle's known data by the last word of their path. */
const KNOWN = {
  mass: ["kg", "mass"],
  xx: ["kg m²", "inertia xx, roll"],
  yy: ["kg m²", "inertia yy, pitch"],
  zz: ["kg m²", "inertia zz, yaw"],
  xz: ["kg m²", "product xz"],
  cg_height: ["m", "CG height"],
  cg_distance: ["m", "axle to CG"],
  track: ["m", "track"],
  radius: ["m", "radius, loaded"],
  mount_height: ["m", "mount height"],
  rolling_resistance: ["", "rolling resistance"],
  front_share: ["", "front share"],
  stiffness: ["N/m", "stiffness"],
  damping: ["N s/m", "damping"],
};

const PARTS = { wheel: "wheel ", tyre: "tyre " };

/** {unit, label} of a number of the vehicle's JSON that is no slider. */
export function known(path) {
  const [unit, label] = KNOWN[path.split(".").at(-1)] ?? ["", path];
  return { unit, label: (PARTS[path.split(".")[1]] ?? "") + label };
}

/** `front.tyre.stiffness` as a person says it, or null for what is no number of a car. */
export const knownName = (path) =>
  path.split(".").at(-1) in KNOWN ? `${path.split(".")[0]} ${known(path).label}` : null;
