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
 * earlier versions have no conditions. One that was not looked for is that of a damper taken for linear.
 */
export function condition(of, result) {
  const holding = Object.entries(result.verdict.conditions ?? {}).filter(([, moved]) => moved.includes(of))
    .map(([name]) => name);
  const bounds = holding.filter((name) => isFound(name, result))
    .map((name) => units.parameter(name)?.label.toLowerCase() ?? name);
  const said = [];
  if (bounds.length) {
    said.push(`${bounds.join(" and ")} ${bounds.length > 1 ? "are where their bounds put them" : "is where its bound puts it"}`);
  }
  if (bounds.length < holding.length) said.push("the dampers are linear");
  return said.length ? `if ${said.join(" and ")}` : "";
}

/** Whether a fit looked for what goes by a name: a parameter, or, of which there is no table, a sensor. */
const isFound = (name, { parameters }) =>
  !units.parameter(name) || parameters.some((one) => one.name === name);

/** How well a parameter or combination is determined, marked. */
export function mark({ name, determined: word }, result) {
  const held = condition(name, result);
  return h("span", {
    className: `determined ${word}${held ? " conditional" : ""}`,
    title: held ? `${DETERMINED[word]}, ${held}` : DETERMINED[word],
  }, held ? `${WORDS[word]}, if …` : WORDS[word]);
}
