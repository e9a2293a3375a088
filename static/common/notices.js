// Messages for a person: what the service said, word for word, and what can be done.

import { $, h } from "./dom.js";
import { worded } from "./wording.js";

const KEPT = { info: 6000, warning: 15000 };
/** The newest so many are in sight; a button shows the others. */
const IN_SIGHT = 2;

/** What is shown, newest first: {said, box, count}. */
let shown = [];
let unfolded = false;
/** Where the focus was before it went into the messages. */
let cameFrom = null;

/**
 * A message below the 3D view, newest first; errors stay until they are dismissed. One that is said
 * again while it is shown is counted instead of shown twice. Returns what takes it away.
 */
export function notice(kind, title, text = "", action = null) {
  const said = JSON.stringify([kind, title, text]);
  const before = shown.find((one) => one.said === said);
  if (before) dismiss(before);
  const one = { said, count: (before?.count ?? 0) + 1 };
  one.box = h(
    "div",
    { className: `notice ${kind}`, role: kind === "error" ? "alert" : undefined },
    h("p", {}, h("strong", {}, text ? `${title}.` : title), " ", text ? worded(text) : null),
    one.count > 1 ? h("span", { className: "badge", title: `Said ${one.count} times` }, `× ${one.count}`) : null,
    action
      ? h("button", { type: "button", on: { click: () => { dismiss(one); action.run(); } } },
          action.label)
      : null,
    h("button", {
      type: "button", className: "dismiss", title: "Dismiss (Esc)", "aria-label": "Dismiss",
      on: { click: () => dismiss(one) },
    }, "×"),
  );
  shown.unshift(one);
  show();
  if (KEPT[kind]) leaveAfter(one, KEPT[kind]);
  return () => dismiss(one);
}

const hasFocus = ({ box }) => box.contains(document.activeElement);

/** Put the messages in their place; those that stay keep focus and pointer. */
function show() {
  const all = $("#notices");
  if (shown.length <= IN_SIGHT) unfolded = false;
  for (const { box } of shown) if (box.parentElement !== all) all.prepend(box);
  shown.forEach((one, i) => { one.box.hidden = i >= IN_SIGHT && !unfolded && !hasFocus(one); });
  all.classList.toggle("unfolded", unfolded);
  const older = shown.slice(IN_SIGHT);
  const errors = older.some(({ box }) => box.classList.contains("error"));
  $("#notices-bar").hidden = older.length === 0;
  $("#notices-older").textContent = unfolded ? "Hide older messages"
    : `${older.length} older message${older.length > 1 ? "s" : ""}${errors ? ", errors among them" : ""}`;
  $("#notices-older").setAttribute("aria-expanded", unfolded);
}

/** Take messages away; the focus that they held goes to the newest one, or back where it came from. */
function dismiss(...gone) {
  const bar = $("#notices-bar");
  const [held, inBar] = [gone.some(hasFocus), bar.contains(document.activeElement)];
  shown = shown.filter((one) => !gone.includes(one));
  for (const { box } of gone) box.remove();
  show();
  if (held || (inBar && bar.hidden)) (shown[0]?.box.querySelector(".dismiss") ?? cameFrom)?.focus();
}

/** Goes by itself, but not while it is pointed at or holds the focus. */
function leaveAfter(one, wait) {
  let timer = 0;
  const leave = () => { timer = setTimeout(() => dismiss(one), wait); };
  for (const event of ["pointerenter", "focusin"]) {
    one.box.addEventListener(event, () => clearTimeout(timer));
  }
  for (const event of ["pointerleave", "focusout"]) {
    one.box.addEventListener(event, () => { clearTimeout(timer); leave(); });
  }
  leave();
}

/** What messages share: unfolding, and dismissing them all. */
export function build() {
  $("#notices-older").addEventListener("click", () => { unfolded = !unfolded; show(); });
  $("#notices-dismiss").addEventListener("click", () => dismiss(...shown));
  for (const place of [$("#notices"), $("#notices-bar")]) {
    place.addEventListener("focusin", ({ relatedTarget }) => {
      if (relatedTarget && !relatedTarget.closest("#notices, #notices-bar")) cameFrom = relatedTarget;
    });
  }
  // Escape takes the newest message away, unless something else is open that it closes.
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || event.defaultPrevented || $("dialog[open]")) return;
    if (shown.length) dismiss(shown[0]);
  });
}

/** Show a refusal; a lost connection is the banner's business. */
export function refused(error, doing) {
  if (error.lost) return null;
  if (error.code === undefined) throw error;
  return notice("error", `${doing} did not work`, error.message);
}

/** The bar across the page: lost connection, compiling. Empty text takes it away. */
export function banner(text, kind = "") {
  const bar = $("#banner");
  bar.hidden = !text;
  bar.className = `banner ${kind}`;
  if (bar.textContent !== text) bar.textContent = text;
}
