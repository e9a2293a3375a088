// Names of recordings, told apart where two files are called the same.

import { get } from "./store.js";

/** The names, numbered from the second that is the same, as the engine numbers its runs. */
export const distinct = (names) => names.map((name, k) => {
  const alike = names.slice(0, k).filter((earlier) => earlier === name).length;
  return alike ? `${name} (${alike + 1})` : name;
});

/** What stands for the data of a recording: the first one with the same. */
export const dataOf = ({ id, same_data_as: first }) => first ?? id;

/** The recording before this one that holds the same data, or nothing. */
export function original(run) {
  const rows = get("measurements");
  return rows.slice(0, rows.findIndex(({ id }) => id === run.id))
    .find((one) => dataOf(one) === dataOf(run));
}

/** What the page calls a recording, or null for one that is gone. */
export function nameOf(id) {
  const rows = get("measurements");
  const at = rows.findIndex((row) => row.id === id);
  return at < 0 ? null : distinct(rows.map(({ name }) => name))[at];
}

/** Whether a recording is known to be of another car than the one of that name. */
export const ofAnotherCar = ({ vehicle }, name) => Boolean(vehicle) && vehicle !== name;

/** Whether two recordings may be of different cars, whatever their vehicle is called. */
export const ofAnotherPlant = (run, other) => (run.plant ?? "") !== (other.plant ?? "");

/** What drove in a recording. */
export const drivenBy = ({ plant }) => (plant ? `driven by the ${plant} car of a campaign` : "nothing tells what drove it");

/** Why a recording is of no use for identification. */
export const lacks = (row) => row.needs_mapping
  ? "Its columns are not mapped to channels yet"
  : `It lacks ${row.missing.join(", ")} for identification`;
