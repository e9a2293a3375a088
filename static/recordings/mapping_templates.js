// Mappings kept by name, for the next files whose columns are the same.

import * as api from "../common/api.js";
import { h } from "../common/dom.js";
import { entriesOf } from "./mapping_entries.js";

/**
 * The row of templates above the columns of a file: choose, delete, save.
 * `take(mapping, sentences)` takes one for what is on show, `mapping()` gives what is on show and
 * `reload()` looks at the file again.
 */
export function build(host, at, { take, mapping, reload }) {
  const box = h("div", { className: "templates", role: "group", "aria-label": "Templates" });
  const show = () => box.replaceChildren(...controls());

  function controls() {
    const named = at.mapping ? "" : at.template ?? "";
    const choice = h("select", { id: "template", "aria-label": "Begin with",
      on: { change: () => begin(choice.value) } },
    h("option", { value: "", selected: !at.chosen }, at.mapping ? "as applied" : named ? `proposed: ${named}` : "as guessed"),
    at.kept.map(({ name }) => h("option", { value: name, selected: at.chosen === name }, name)));
    const name = h("input", { type: "text", id: "template-name", maxLength: 100, placeholder: "Name",
      "aria-label": "Name of the template",
      on: { keydown: (event) => { if (event.key === "Enter") save(name.value); } } });
    const known = at.chosen || named;
    return [h("label", { className: "inline" }, "Begin with", choice),
      known ? h("button", { type: "button", className: "danger", "aria-label": `Delete template ${known}`,
        on: { click: (event) => remove(known, event.currentTarget) } }, "Delete") : null,
      name,
      h("button", { type: "button", id: "save-template", on: { click: () => save(name.value) } }, "Save as template"),
    ].filter(Boolean);
  }

  function begin(name) {
    at.chosen = name;
    const chosen = name ? at.kept.find((one) => one.name === name).mapping : at.mapping ?? at.proposed;
    const { lost } = entriesOf(chosen, at.columns);
    take(chosen, lost.length ? [`The file has no column ${lost.slice(0, 5).join(", ")}` +
      `${lost.length > 5 ? ` and ${lost.length - 5} more` : ""}, which ${name} maps; all else is taken from it.`] : []);
    show();
  }

  async function save(text) {
    const name = text.trim();
    if (!name) {
      host.say("problem", "Give the template a name, such as that of the car or of the logger.");
      return;
    }
    try {
      await api.keepMapping(name, mapping());
      at.kept = await api.mappings();
    } catch (error) {
      host.refused(error);
      return;
    }
    host.say("", `Kept as ${name}; it is proposed for the next file with these columns.`);
    at.chosen = name;
    show();
  }

  async function remove(name, button) {
    if (button.dataset.sure !== "yes") {
      button.dataset.sure = "yes";
      button.textContent = "Really delete?";
      return;
    }
    try {
      await api.deleteMapping(name);
      at.kept = await api.mappings();
      await reload();
    } catch (error) {
      host.refused(error);
      return;
    }
    at.chosen = "";
    host.say("", `${name} is deleted; what is mapped with it stays so.`);
    show();
  }

  show();
  return box;
}
