// 95 % intervals in words; an end that is null lies open.

import * as units from "./units.js";

/** Whether an interval says anything. */
export const isKnown = (interval) => Boolean(interval?.some(Number.isFinite));

/**
 * "2.1 … 3.4", "from 2.1", "up to 3.4" or "unbounded"; SI times `factor`. An end that stands alone has the
 * digits of the value beside it, which may be as near to it as at a bound.
 */
export function span([lower, upper], factor) {
  const ends = [lower, upper];
  const digits = ends.every(Number.isFinite) ? 3 : 4;
  const [low, high] = ends.map((end) => (Number.isFinite(end) ? units.number(end * factor, digits) : null));
  if (low !== null && high !== null) return `${low} … ${high}`;
  if (low !== null) return `from ${low}`;
  return high !== null ? `up to ${high}` : "unbounded";
}

/** Half the width as a share of the value, "± 12 %"; nothing where an end lies open. */
export function share(value, [lower, upper]) {
  if (!Number.isFinite(lower) || !Number.isFinite(upper) || !value) return "";
  const percent = (50 * (upper - lower)) / Math.abs(value);
  return percent > 999 ? "± >999 %" : `± ${units.number(percent, 2)} %`;
}
