// Small helpers around the document.

export const $ = (selector, root = document) => root.querySelector(selector);

/** An element: properties, `dataset`, `on` listeners and attributes with a dash; then children. */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (value === undefined || value === null) continue;
    if (name === "dataset") Object.assign(element.dataset, value);
    else if (name === "on") {
      for (const [event, listener] of Object.entries(value)) {
        element.addEventListener(event, listener);
      }
    } else if (name in element && !name.includes("-")) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined));
  return element;
}

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

/** "1 step", "2 steps". */
export const counted = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;

/** An instant of the service as this browser tells date and time. */
export const when = (instant) => new Date(instant).toLocaleString([], { dateStyle: "medium", timeStyle: "short" });

/** Hand a file to the visitor: a blob, or data to be written as JSON. */
export function saveFile(content, name) {
  const blob = content instanceof Blob ? content
    : new Blob([`${JSON.stringify(content, null, 1)}\n`], { type: "application/json" });
  const link = h("a", { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** Words as the stem of a file's name. */
export const fileName = (text) =>
  text.replace(/\.\w+$/, "").replace(/\W+/g, "-").toLowerCase().slice(0, 60) || "ridetune";

/** A file's or a column's name that may break after its underscores, and the latter at its dots. */
export const breakable = (name) => name.split(/(?<=[_-]|\w\.(?=\w))/).flatMap((part) => [part, h("wbr")]);

/** A parameter's symbol such as `K_F` or `phi_R`, with its index set low. */
export function symbol(text) {
  const [base, index] = text.split("_");
  const greek = { phi: "φ", rho: "ρ" }[base] ?? base;
  return h("span", { className: "symbol" }, greek, index ? h("sub", {}, index) : null);
}

/** A part that opens under its summary, into sight; `memory.open` outlives its being built anew. */
export function fold(memory, summary, ...children) {
  const part = h("details", { className: "fold", open: memory.open,
    on: { toggle: () => { memory.open = part.open; } } }, summary, ...children);
  summary.addEventListener("click", () => setTimeout(() => part.scrollIntoView({ block: "nearest" })));
  return part;
}

const KEYED = "button, input, select, summary";
const keyOf = (element) => element.id || element.getAttribute("aria-label") || element.textContent;

/**
 * Build a panel anew without losing the reader's place: what scrolls and what has the focus.
 * `successor` selects what takes the focus of a control that is no more.
 */
export function inPlace(panel, rebuild, successor = null) {
  const boxes = () => [panel, ...panel.querySelectorAll(".scrolls")];
  const tops = new Map(boxes().map((box) => [box.className, box.scrollTop]));
  const focused = panel.contains(document.activeElement) ? keyOf(document.activeElement) : null;
  rebuild();
  for (const box of boxes()) box.scrollTop = tops.get(box.className) ?? 0;
  if (!focused) return;
  const again = [...panel.querySelectorAll(KEYED)].find((element) => keyOf(element) === focused);
  (again ?? (successor && $(successor, panel)))?.focus({ preventScroll: true });
}

/** Tabs by the ARIA pattern: arrows move, one panel shows. Returns `select(id)`. */
export function tabs(list, onSelect = () => {}) {
  const buttons = [...list.querySelectorAll('[role="tab"]')];
  const panelOf = (button) => document.getElementById(button.getAttribute("aria-controls"));
  const select = (id, focus = false) => {
    for (const button of buttons) {
      const chosen = button.id === id;
      button.setAttribute("aria-selected", chosen);
      button.tabIndex = chosen ? 0 : -1;
      const panel = panelOf(button);
      if (panel && panel.getAttribute("role") === "tabpanel") panel.hidden = !chosen;
      if (chosen && focus) button.focus();
    }
    onSelect(id);
  };
  for (const [i, button] of buttons.entries()) {
    button.addEventListener("click", () => select(button.id));
    button.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      event.preventDefault();
      event.stopPropagation();
      select(buttons[(i + step + buttons.length) % buttons.length].id, true);
    });
  }
  if (buttons.length) select(buttons[0].id);
  return select;
}

/** `fn` after the calls have paused for `wait` ms. */
export function debounced(fn, wait) {
  let timer = 0;
  return (...args) => {
    clearTimeout(timer);
    timer = setTimeout(() => fn(...args), wait);
  };
}
