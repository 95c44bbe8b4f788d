// Start page: typed options of a fit outlive a reload, the end of a session, and the fit itself: after a
// refused or failed fit its motor is fitted again with other runs or one other option.

import { motor } from "/static/changes.js";

const NAME = "fit-options";

/** The options, unless the page has none, as before the first run. */
function part() {
  return document.getElementById("start");
}

function fields() {
  return [...part().querySelectorAll("[name]")];
}

/** Keeps the options that are not the default; once a fit was started with them, for its motor only. */
function keep(ofMotor) {
  const chosen = fields().flatMap((field) => {
    if (field.type === "checkbox") return field.checked === field.defaultChecked ? [] : [[field.name, field.checked]];
    return field.value === standard(field) ? [] : [[field.name, field.value]];
  });
  sessionStorage.setItem(NAME, JSON.stringify({ workspace: part().dataset.workspace, ofMotor, chosen }));
}

function standard(field) {
  if (field.tagName !== "SELECT") return field.defaultValue;
  return ([...field.options].find((option) => option.defaultSelected) ?? field.options[0]).value;
}

function restore() {
  const { workspace, ofMotor, chosen } = JSON.parse(sessionStorage.getItem(NAME) ?? "{}");
  if (!part() || "isRestored" in part().dataset || workspace !== part().dataset.workspace) return;
  part().dataset.isRestored = "";
  if (ofMotor !== undefined && ofMotor !== motor()) return;
  const kept = new Map(chosen);
  for (const field of fields().filter(({ name }) => kept.has(name))) {
    const value = kept.get(field.name);
    if (field.type === "checkbox") field.checked = value;
    else field.value = value;
    // An option that is not the default must not act unseen.
    field.closest("details")?.setAttribute("open", "");
  }
}

document.addEventListener("input", ({ target }) => {
  if (part()?.contains(target)) keep();
});
document.addEventListener("htmx:afterSettle", restore);
document.addEventListener("htmx:afterRequest", ({ detail: { elt, xhr } }) => {
  // htmx calls no answer successful that leads to another page.
  if (xhr.status === 204 && elt.id === "fit") keep(motor());
});

// The answer to the request for a fit may be lost; the same request again leads to the same fit.
let request = { text: "", key: "" };
document.addEventListener("htmx:configRequest", ({ detail: { elt, headers, parameters } }) => {
  if (elt.id !== "fit") return;
  const text = JSON.stringify(parameters);
  if (text !== request.text) request = { text, key: `${Date.now()}-${Math.random()}` };
  headers["Idempotency-Key"] = request.key;
});
restore();
