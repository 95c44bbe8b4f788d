// Start page: typed options of a fit outlive a reload and the end of a session, until the fit is started.

const NAME = "fit-options";

/** The options, unless the page has none, as before the first run. */
function part() {
  return document.getElementById("start");
}

function fields() {
  return [...part().querySelectorAll("[name]")];
}

/** Keeps the options of this workspace; those that have their default are not kept. */
function keep() {
  const chosen = fields().flatMap((field) => {
    if (field.type === "checkbox") return field.checked === field.defaultChecked ? [] : [[field.name, field.checked]];
    return field.value === standard(field) ? [] : [[field.name, field.value]];
  });
  sessionStorage.setItem(NAME, JSON.stringify({ workspace: part().dataset.workspace, chosen }));
}

function standard(field) {
  if (field.tagName !== "SELECT") return field.defaultValue;
  return ([...field.options].find((option) => option.defaultSelected) ?? field.options[0]).value;
}

function restore() {
  const { workspace, chosen } = JSON.parse(sessionStorage.getItem(NAME) ?? "{}");
  if (!part() || "isRestored" in part().dataset || workspace !== part().dataset.workspace) return;
  part().dataset.isRestored = "";
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
  if (xhr.status === 204 && elt.id === "fit") sessionStorage.removeItem(NAME);
});
restore();
