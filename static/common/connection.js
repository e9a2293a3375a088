// Whether the service answers, where something that was open to it has broken off.

import * as api from "./api.js";
import { set } from "./store.js";

let asking = false;

/** An event stream or the 3D view's socket is lost: say so on the page, unless the service answers. */
export async function brokenOff() {
  if (asking) return;
  asking = true;
  try {
    if (!await api.answers()) set({ online: false });
  } finally {
    asking = false;
  }
}
