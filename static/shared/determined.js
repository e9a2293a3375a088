// How well a fit determines something, in one word; "if …" where a bound decides it.

import { h } from "./dom.js";
import * as units from "./units.js";

export const WORDS = { yes: "well", weakly: "weakly", no: "not" };
export const DETERMINED = {
  yes: "well determined",
  weakly: "weakly determined",
  no: "not determined",
};

/**
 * "if rear bar stiffness is where its bound puts it" of a parameter or combination, or nothing; fits of
 * earlier versions have no conditions.
 */
export function condition(of, result) {
  const held = Object.entries(result.verdict.conditions ?? {}).filter(([, moved]) => moved.includes(of))
    .map(([name]) => units.parameter(name)?.label.toLowerCase() ?? name);
  if (!held.length) return "";
  return `if ${held.join(" and ")} ${held.length > 1 ? "are where their bounds put them" : "is where its bound puts it"}`;
}

/** How well a parameter or combination is determined, marked. */
export function mark({ name, determined: word }, result) {
  const held = condition(name, result);
  return h("span", {
    className: `determined ${word}${held ? " conditional" : ""}`,
    title: held ? `${DETERMINED[word]}, ${held}` : DETERMINED[word],
  }, held ? `${WORDS[word]}, if …` : WORDS[word]);
}
