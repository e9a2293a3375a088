// The time of the ride: one clock for 3D, charts and the slider under the view.

import { $, h } from "../common/dom.js";
import * as units from "../common/units.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];
const listeners = [];

export const clock = {
  time: 0,
  start: 0,
  end: 20,
  playing: false,
  speed: 1,
  magnification: 5,
};

/** Call `fn(clock)` whenever the time or the magnification changes. */
export const onTime = (fn) => listeners.push(fn);

let parts = null;
let last = 0;

/** Build the controls. */
export function build() {
  const play = h("button", {
    type: "button", id: "play", className: "play", "aria-label": "Play", title: "Play (Space)",
    on: { click: toggle },
  }, "▶");
  const slider = h("input", {
    type: "range", id: "time", min: 0, max: 20, step: 0.01, value: 0, "aria-label": "Time, s",
    on: {
      input: () => seek(Number(slider.value)),
      keydown: (event) => {
        if (event.key.startsWith("Arrow")) event.preventDefault();
      },
    },
  });
  const readout = h("output", { className: "readout", htmlFor: "time" });
  const speed = h("select", {
    id: "speed", title: "Speed of playing",
    on: { change: () => { clock.speed = Number(speed.value); } },
  }, SPEEDS.map((x) => h("option", { value: x, selected: x === 1 }, `${x}×`)));
  const magnify = h("input", {
    type: "range", id: "magnification", min: 1, max: 20, step: 1, value: clock.magnification,
    on: {
      input: () => {
        clock.magnification = Number(magnify.value);
        changed();
      },
    },
  });
  const factor = h("output", { className: "factor", htmlFor: "magnification" });
  parts = { play, slider, readout, factor, magnify };
  $("#transport").append(
    play, slider, readout, h("label", { className: "inline" }, "Speed ", speed));
  $(".view-tools").append(
    h("label", { className: "inline", title: "Motion is drawn this many times larger than it is" },
      "Motion ", magnify, factor));
  changed();
}

/** The ride's first and last instant; the time stays where it is if it can. */
export function setRange(start, end) {
  if (clock.start === start && clock.end === end) return;
  Object.assign(clock, { start, end });
  parts.slider.min = start;
  parts.slider.max = end;
  seek(clock.time);
}

export function seek(time) {
  clock.time = Math.min(Math.max(time, clock.start), clock.end);
  changed();
}

export function toggle() {
  clock.playing = !clock.playing;
  if (clock.playing && clock.time >= clock.end - 1e-3) clock.time = clock.start;
  parts.play.textContent = clock.playing ? "❚❚" : "▶";
  parts.play.setAttribute("aria-label", clock.playing ? "Pause" : "Play");
  parts.play.title = clock.playing ? "Pause (Space)" : "Play (Space)";
  last = 0;
  if (clock.playing) requestAnimationFrame(step);
}

function step(now) {
  if (!clock.playing) return;
  if (last) clock.time += (clock.speed * Math.min(now - last, 250)) / 1000;
  last = now;
  if (clock.time >= clock.end) clock.time = clock.start;
  changed();
  requestAnimationFrame(step);
}

function changed() {
  parts.slider.value = clock.time;
  parts.slider.setAttribute("aria-valuetext", `${clock.time.toFixed(2)} seconds`);
  parts.readout.value = `${clock.time.toFixed(2)} / ${units.number(clock.end, 3)} s`;
  parts.factor.value = `×${clock.magnification}`;
  for (const fn of listeners) fn(clock);
}

/** Space, arrows, Home and End, unless a control with keys of its own has the focus. */
export function listenToKeys() {
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.defaultPrevented) return;
    const target = document.activeElement;
    const range = target?.type === "range";
    if (target?.closest?.("dialog, [role=tablist], [role=separator]")) return;
    if (target?.matches?.("input, select, textarea") && !range) return;
    if (event.key === " ") {
      if (target?.matches?.("button, summary, a")) return;
      event.preventDefault();
      toggle();
      return;
    }
    if (range && target.id !== "time") return;
    if (target?.matches?.(".scrolls") && !event.key.startsWith("Arrow")) return;
    const by = event.shiftKey ? 1 : 0.1;
    const to = {
      ArrowLeft: clock.time - by,
      ArrowRight: clock.time + by,
      Home: clock.start,
      End: clock.end,
    }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    seek(to);
  });
}
