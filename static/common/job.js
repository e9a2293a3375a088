// The newest job of one kind on the page: sent, followed to its end, cancelled, taken up again.

import * as api from "./api.js";
import { brokenOff } from "./connection.js";
import { refused } from "./notices.js";
import { on, set } from "./store.js";

const LOOK = 5000; // ms between two looks at why a job waits

/** What is said of a job that waits: the service's reason, as long as workers are out of its reach. */
export const queued = ({ state, reason }) => (state === "queued" && reason) || "Waiting for a worker …";

/**
 * Jobs of a kind ("identifications", "profiles", "validations", "campaigns"), called `what` to a person.
 * changed() is called when the job or its state has changed, progressed() when its progress has;
 * ended() once it has ended and is read as a whole.
 */
export function jobs(kind, what, { changed, progressed = changed, ended }) {
  let job = null;
  let starting = false;
  let unfollow = () => {};

  const busy = () => job !== null && !api.isFinal(job.state);

  /**
   * Send what `request()` gives, nothing if it gives null; `told` of what is refused. Whether it
   * was taken; a second press while the first is being sent is not.
   */
  async function start(request, told = (error) => refused(error, `Starting the ${what}`)) {
    if (starting || busy()) return false;
    starting = true;
    try {
      const body = await request();
      if (body) {
        job = await api.submit(kind, body);
        watch();
      }
    } catch (error) {
      if (error.lost) set({ online: false });
      told(error);
    } finally {
      starting = false;
    }
    changed();
    return busy();
  }

  /** Take up one of a session that is opened again, of all of them from the newest on. */
  async function resume(choose = ([newest]) => newest) {
    const all = (await api.jobs(kind)).sort((one, other) => (one.created < other.created ? 1 : -1));
    const chosen = choose(all);
    if (!chosen) return;
    job = await api.job(kind, chosen.id);
    if (busy()) watch();
  }

  function watch() {
    const { id } = job;
    unfollow();
    unfollow = api.follow(kind, id, (progress) => {
      if (job.id !== id) return;
      job.progress = progress;
      progressed();
    }, async (state) => {
      if (job.id !== id) return;
      job = { ...job, ...state };
      if (!busy()) await read();
      changed();
    }, brokenOff);
  }

  async function read() {
    try {
      job = await api.job(kind, job.id);
    } catch (error) {
      refused(error, `Reading the ${what}`);
      return;
    }
    await ended();
  }

  async function cancel() {
    try {
      await api.cancelJob(kind, job.id);
    } catch (error) {
      refused(error, "Cancelling");
    }
  }

  /** Find why it waits; that is known of the service, not of one job. */
  async function explain() {
    if (job?.state !== "queued") return;
    const { state, message } = await api.readiness().catch(() => ({}));
    const reason = state === "degraded" ? message : undefined;
    if (job.state !== "queued" || job.reason === reason) return;
    job.reason = reason;
    changed();
  }

  setInterval(explain, LOOK);
  on("online", ({ online }) => { if (online && busy()) watch(); });
  return { now: () => job, busy, sending: () => starting, start, resume, cancel };
}
