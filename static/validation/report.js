// The report: one file that holds its data, these modules and their styles, and needs no network.

import { $, h } from "../common/dom.js";
import * as units from "../common/units.js";
import { sections } from "./validation_view.js";

/** Width of a figure, px: that of an A4 page between its margins. */
const WIDTH = 680;

const { validation, tables } = JSON.parse($("#data").textContent);
units.learn(tables.channels, tables.parameters);
const car = validation.fit.vehicle.name;
document.title = `Validation of ${car}`;
$("main").replaceChildren(h("h1", {}, `Validation of ${car}`),
  h("p", { className: "soft" }, `ridetune, ${validation.made.date}`), ...sections(validation, WIDTH));
document.documentElement.dataset.drawn = "yes";
