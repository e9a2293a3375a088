// What a dropped file is, where its name alone does not tell, and where it belongs.

/** Names of what the service reads, as in engine/formats/readers.py; the content decides. */
export const RECORDINGS = ".csv,.txt,.tsv,.dat,.asc,.mf4,.mdf,.mf3,.mat,.h5,.hdf5,.hdf,.tdms,.uff,.unv,.uf58,"
  + ".rsp,.rpc,.tim,.drv,.parquet,.erg,.zip,text/csv";

/** A file that is of no use where it was put, in words for a person. */
export class Misplaced extends Error {}

const has = (data, ...keys) => keys.every((key) => data[key] !== undefined);
const isObject = (data) => data !== null && typeof data === "object" && !Array.isArray(data);
const everyHas = (list, key) => Array.isArray(list) && list.length > 0
  && list.every((one) => isObject(one) && has(one, key));

/** JSON by what it holds: how to tell it, what it is, and where that belongs; null: it is taken here. */
const JSON_KINDS = [
  [(data) => everyHas(data.columns, "channel"), "mapping", null],
  [(data) => has(data, "plant", "sensors"), "the truth of a campaign, what its sensors and its car were",
    "it is there to compare a fit with by hand; the car is in the vehicle.json beside it"],
  [(data) => isObject(data.vehicle) || has(data, "chassis", "front", "rear"), "vehicle", null],
  [(data) => everyHas(data, "kind"), "steps of conditioning",
    "choose them under Conditioning of a recording"],
  [(data) => isObject(data.front ?? data.rear) && has(data.front ?? data.rear, "distance", "angle"),
    "the geometry of the pivots", "type it under Validation, beside the runs"],
  [(data) => has(data, "sensors"), "the sensors of a campaign",
    "choose it under Measurements, Drive a campaign, Roads, sensors, format"],
  [(data) => has(data, "kind", "duration") || has(data, "kind", "name"), "a manoeuvre",
    "call it NAME.manoeuvre.json after the recording NAME.csv that it tells of"],
  [(data) => Object.keys(data).some((key) => /^(front|rear|chassis)\b/.test(key)), "part of a car",
    "a vehicle file names chassis, front and rear"],
];

/** "vehicle" or "mapping" with the data of a JSON file; Misplaced says where anything else belongs. */
export async function kindOfJson(file) {
  let data;
  try {
    data = JSON.parse(await file.text());
  } catch {
    throw new Misplaced("It is not JSON, whatever its name says; open it in an editor and mend it.");
  }
  const [, what, where] = JSON_KINDS.find(([fits]) => data !== null && typeof data === "object" && fits(data))
    ?? [null, "JSON of another program", "the page takes vehicles, mappings and NAME.manoeuvre.json"];
  if (where) throw new Misplaced(`It seems to be ${what}; ${where}.`);
  return { kind: what, data };
}

/** TOML that is not notes on a recording is told where it belongs; what is neither, the service reads. */
export async function requireNotes(file) {
  const text = await file.text();
  if (/^\s*(\[\s*noise\b|noise\s*(\.|=\s*\{))/m.test(text)) return;
  if (/^\s*\[\s*(sensors|points)\b/m.test(text)) {
    throw new Misplaced("It seems to be the sensors of a campaign; choose it under Measurements, Drive a campaign, " +
      "Roads, sensors, format.");
  }
  if (/^\s*\[?\s*(chassis|front|rear|brakes)\b/m.test(text)) {
    throw new Misplaced("It seems to be a car; a vehicle file is JSON, as Save file of the Car tab writes it.");
  }
}
