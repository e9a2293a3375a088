// A campaign: let a car that is known drive manoeuvres, follow the job, take its recordings over.

import { take } from "../car/car.js";
import * as api from "../common/api.js";
import { fold, h, inPlace } from "../common/dom.js";
import { jobs, queued } from "../common/job.js";
import { nameOf, ofAnotherPlant } from "../common/names.js";
import { notice, refused } from "../common/notices.js";
import { get, on, set } from "../common/store.js";
import * as units from "../common/units.js";
import { fitToo, fitted } from "../fit/setup.js";
import { deleted } from "../recordings/measurements.js";
import * as form from "./campaign_form.js";

const STATES = { whole: "whole", partial: "broke off", missing: "missing" };
const memory = { open: false };
const parts = {};

/** What was wrong with the last request, a sentence. */
let problem = "";
const { now: current, busy, start: send, resume: takeUp, cancel } =
  jobs("campaigns", "campaign", { changed, ended });

export { current };

/** The form, folded, with what became of the newest campaign below it. */
export function build() {
  parts.tools = h("div", { className: "row-tools" });
  parts.outcome = h("div", { className: "campaign-outcome" });
  const fields = form.build({ onChange: showTools, onSubmit: start, tools: parts.tools });
  on("measurements", show);
  parts.fold = fold(memory, h("summary", {}, "Drive a campaign with virtual sensors"), fields, parts.outcome);
  return parts.fold;
}

/** Unfold the form with one manoeuvre chosen in it. */
export function propose(key) {
  problem = "";
  memory.open = parts.fold.open = true;
  form.choose(key);
  show();
  parts.fold.scrollIntoView({ block: "nearest" });
  parts.drive?.focus();
}

function start() {
  problem = "";
  send(form.request, (error) => {
    if (error.code === undefined) throw error;
    if (!error.lost) problem = error.message;
  });
}

/** Take up the newest campaign of a session that is opened again. */
export async function resume() {
  await takeUp();
  show();
}

async function ended() {
  if (absent()) await takeOver();
}

const whole = () => (current()?.result?.recordings ?? []).filter(({ state }) => state === "whole");

/** Whether a recording that can be read back is not among the measurements. */
function absent() {
  if (current().format !== "csv") return false;
  const held = new Set(get("measurements").map(({ sha256 }) => sha256));
  return whole().some(({ sha256 }) => !held.has(sha256));
}

async function takeOver() {
  try {
    await deleted(); // else the service may count a recording in that is about to go
    const rows = await api.takeOver(current().id);
    const held = new Set(get("measurements").map(({ id }) => id));
    const added = rows.filter(({ id }) => !held.has(id));
    set({ measurements: [...get("measurements"), ...added] });
    if (added.length) tell(added);
  } catch (error) {
    refused(error, "Adding the recordings");
  }
}

/** What is there now, and that the next fit takes it only where it is told to. */
function tell(added) {
  const them = added.length > 1 ? "them" : "it";
  const title = `${added.length} ${added.length > 1 ? "recordings are" : "recording is"} in`;
  const usable = added.filter((run) => run.usable_for_identification);
  const [first] = fitted();
  if (!usable.length || !first || usable.includes(first)) {
    notice("info", title, `The campaign drove ${them}.`);
  } else if (ofAnotherPlant(usable[0], first)) {
    notice("info", title, `The ${usable[0].plant} car drove ${them}, another car than that of ${nameOf(first.id)}: ` +
      `not in its fit.`);
  } else {
    notice("warning", title, `The campaign drove ${them}; the next fit is of ${fitted().map(({ id }) => nameOf(id)).join(", ")} alone.`,
      { label: `Fit ${them} too`, run: () => fitToo(usable) });
  }
}

/** What is known of the car that drove becomes the session's car. */
async function useCar() {
  try {
    await take(await api.campaignVehicle(current().id), "The car that drove is loaded");
  } catch (error) {
    refused(error, "Reading the car");
  }
}

/** What became of it is brought into view, below a form that fills the panel. */
function changed() {
  show();
  if (parts.outcome.childElementCount) parts.outcome.scrollIntoView({ block: "nearest" });
}

function show() {
  showTools();
  inPlace(parts.outcome, () => parts.outcome.replaceChildren(...outcome()));
}

/** The button to drive or to cancel, built anew only where one takes the place of the other. */
function showTools() {
  const running = busy();
  if (parts.running !== running) {
    parts.running = running;
    inPlace(parts.tools, () => parts.tools.replaceChildren(...tools(running)), "#drive, #cancel-campaign");
  }
  parts.state.textContent = running ? progress() : form.extent();
  if (running) {
    const { driven = 0, duration = 1 } = current().progress ?? {};
    Object.assign(parts.bar, { max: duration, value: driven });
  } else parts.drive.disabled = form.isEmpty();
}

function tools(running) {
  parts.state = h("span", { className: "hint", id: "campaign-state" });
  if (running) {
    parts.bar = h("progress", { "aria-label": "Seconds driven" });
    const stop = h("button", { type: "button", id: "cancel-campaign", className: "danger", on: { click: cancel } },
      "Cancel");
    return [stop, parts.bar, parts.state];
  }
  parts.drive = h("button", { type: "submit", id: "drive", className: "primary" }, "Drive");
  return [parts.drive, parts.state];
}

function progress() {
  const { runs, of, driven, duration, seconds, at_once: atOnce } = current().progress ?? {};
  if (current().state === "queued" || of === undefined) return queued(current());
  const left = driven > 0 ? (seconds * (duration - driven)) / driven / Math.max(atOnce, 1) : 0;
  return `${runs} of ${of} drives, ${units.fixed(driven, 1)} of ${units.plain(duration, 4)} s` +
    form.taking(left, "left");
}

/** What became of the newest campaign. */
function outcome() {
  const job = current();
  const alarm = (text) => h("div", { className: "problem", role: "alert" }, h("p", {}, text));
  if (problem) return [alarm(problem)];
  if (job?.error) return [alarm(job.error.detail)];
  if (!job || busy()) return [];
  if (!job.result) return [h("p", { className: "hint" }, "The campaign was cancelled before a drive ended.")];
  return [
    h("ul", { className: "campaign-recordings" }, job.result.recordings.map((one) =>
      h("li", {}, one.file
        ? h("a", { href: api.campaignFileUrl(job.id, one.file), download: one.file }, one.file) : one.name,
      h("span", { className: "badge", title: one.failure }, STATES[one.state]),
      one.failure ? h("span", { className: "hint" }, one.failure) : null))),
    h("div", { className: "row-tools" },
      h("a", { className: "button", id: "campaign-zip", download: "campaign.zip",
        href: api.campaignUrl(job.id) }, "Download all, with the truth"),
      absent() ? h("button", { type: "button", id: "take-over", on: { click: takeOver } },
        "Add to the measurements") : null,
      job.vehicle ? null : h("button", { type: "button", id: "use-car", on: { click: useCar },
        title: "What is known of the car that drove becomes the session's: sliders and baseline" }, "Use its car")),
  ];
}
