// Messages for a person: what the service said, word for word, and what can be done.

import { $, h } from "./dom.js";
import { worded } from "./wording.js";

const KEPT = { info: 6000, warning: 15000 };
const MOST = 4;

/** A message below the 3D view, newest first; errors stay until they are dismissed. */
export function notice(kind, title, text = "", action = null) {
  const box = h(
    "div",
    { className: `notice ${kind}`, role: kind === "error" ? "alert" : undefined },
    h("p", {}, h("strong", {}, text ? `${title}.` : title), " ", text ? worded(text) : null),
    action
      ? h("button", { type: "button", on: { click: () => { box.remove(); action.run(); } } },
          action.label)
      : null,
    h("button", {
      type: "button", className: "dismiss", title: "Dismiss (Esc)", "aria-label": "Dismiss",
      on: { click: () => dismiss(box) },
    }, "×"),
  );
  box.addEventListener("focusin", ({ relatedTarget }) => {
    if (relatedTarget && !$("#notices").contains(relatedTarget)) cameFrom = relatedTarget;
  });
  const all = $("#notices");
  all.prepend(box);
  while (all.children.length > MOST) all.lastChild.remove();
  if (KEPT[kind]) leaveAfter(box, KEPT[kind]);
  return box;
}

/** Where the focus was before it went into the messages. */
let cameFrom = null;

/** Take a message away; the focus that it held goes to the next one, or back where it came from. */
function dismiss(box) {
  const held = box?.contains(document.activeElement);
  box?.remove();
  if (held) ($("#notices .dismiss") ?? cameFrom)?.focus();
}

/** Goes by itself, but not while it is pointed at or holds the focus. */
function leaveAfter(box, wait) {
  let timer = 0;
  const leave = () => { timer = setTimeout(() => box.remove(), wait); };
  for (const event of ["pointerenter", "focusin"]) {
    box.addEventListener(event, () => clearTimeout(timer));
  }
  for (const event of ["pointerleave", "focusout"]) {
    box.addEventListener(event, () => { clearTimeout(timer); leave(); });
  }
  leave();
}

/** Escape takes the newest message away, unless something else is open that it closes. */
export function listenToKeys() {
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || event.defaultPrevented || $("dialog[open]")) return;
    dismiss($("#notices").firstChild);
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
