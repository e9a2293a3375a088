// Display units, in one place: the service's tables say how SI is shown.

const channels = new Map();
const parameters = new Map();

/** Take the tables of /api/channels and /api/parameters. */
export function learn(channelRows, parameterRows) {
  channelRows.forEach((row) => channels.set(row.name, row));
  parameterRows.forEach((row) => parameters.set(row.name, row));
}

/** A channel's row, or a plain one for a name the table does not have. */
export function channel(name, unit = "") {
  return (
    channels.get(name) ??
    { name, label: name, unit, display_unit: unit, display_factor: 1 }
  );
}

export const parameter = (name) => parameters.get(name);

/** A number for reading: `digits` significant, no exponent for sizes a person meets. */
export function number(value, digits = 4) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size >= 7 || size < -5) return minus(value.toExponential(digits - 1));
  return minus(value.toFixed(Math.min(Math.max(digits - 1 - size, 0), 6)));
}

/** The same without padding zeros, as an input field wants it. */
export function plain(value, digits = 5) {
  return Number.isFinite(value) ? String(Number(value.toPrecision(digits))) : "";
}

const minus = (text) => text.replace("-", "−");

/** Units of a vehicle's known data by the last word of their path. */
const KNOWN = {
  mass: ["kg", "mass"],
  xx: ["kg m²", "roll inertia xx"],
  yy: ["kg m²", "pitch inertia yy"],
  zz: ["kg m²", "yaw inertia zz"],
  xz: ["kg m²", "product of inertia xz"],
  cg_height: ["m", "height of the CG at rest"],
  cg_distance: ["m", "axle to CG, along the car"],
  track: ["m", "track"],
  radius: ["m", "loaded radius"],
  mount_height: ["m", "mount above wheel centre"],
  rolling_resistance: ["", "rolling resistance"],
  front_share: ["", "front share of braking"],
  stiffness: ["N/m", "vertical stiffness"],
  damping: ["N s/m", "vertical damping"],
};

/** {unit, label} of a number of the vehicle's JSON that is no slider. */
export function known(path) {
  const [unit, label] = KNOWN[path.split(".").at(-1)] ?? ["", path];
  return { unit, label };
}
