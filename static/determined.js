// How well a fit determines something, in one word; "if …" where a bound decides it.

import { h } from "./dom.js";
import * as units from "./units.js";

export const WORDS = { yes: "well", weakly: "weakly", no: "not" };
export const DETERMINED = {
  yes: "well determined",
  weakly: "weakly determined",
  no: "not determined",
};

/** "if KtorR is where its bound puts it" of a fit, or nothing; fits of earlier versions have no conditions. */
export function condition(result) {
  const held = (result.verdict.conditions ?? []).map((name) => units.parameter(name)?.label.toLowerCase() ?? name);
  if (!held.length) return "";
  return `if ${held.join(" and ")} ${held.length > 1 ? "are where their bounds put them" : "is where its bound puts it"}`;
}

/** Whether a word of this fit holds on a condition only. */
export const isConditional = (word, result) => word !== "no" && Boolean(condition(result));

/** The word, marked. */
export function mark(word, result, title = DETERMINED[word]) {
  const held = isConditional(word, result);
  return h("span", {
    className: `determined ${word}${held ? " conditional" : ""}`,
    title: held ? `${title}, ${condition(result)}` : title,
  }, held ? `${WORDS[word]}, if …` : WORDS[word]);
}
