// Start page: fields and forms whose values the service does not have, because a request failed.  They keep what
// was typed when an answer replaces them, and are sent again before a fit starts or runs are added.

const unsaved = new Set();
const kept = new Map();
let next = "";

function fieldsOf(element) {
  const fields = element.matches("form") ? [...element.elements] : [element];
  return fields.filter(({ id, type }) => id && type !== "file");
}

function elements() {
  return [...unsaved].map((id) => document.getElementById(id)).filter(Boolean);
}

/** Whether there is such a field. */
export function hasUnsaved() {
  return elements().length > 0;
}

/** Sends them again, in the order in which they failed. */
export function sendAgain() {
  const fields = elements().map((element) => fieldsOf(element)[0]);
  next = fields[0]?.id;
  for (const field of fields) htmx.trigger(field, "change");
}

function show() {
  const place = document.getElementById("unsaved");
  const names = elements().map((element) => element.ariaLabel);
  const text = names.length > 0 ? `Not saved: ${names.join(", ")}. ` : "";
  if (place.textContent.startsWith(text) && (text || !place.textContent)) return;
  const hasFocus = place.contains(document.activeElement);
  const line = document.createElement("p");
  const button = document.createElement("button");
  line.className = "notice bad";
  button.type = "button";
  button.textContent = "Send again";
  button.addEventListener("click", sendAgain);
  line.append(text, button);
  place.replaceChildren(...(text ? [line] : []));
  if (hasFocus) (text ? button : document.getElementById(next) ?? document.getElementById("runs-title")).focus();
}

/** Notes whether the service has the values of a field or form. */
export function note(element, isSaved) {
  if (isSaved) unsaved.delete(element.id);
  else unsaved.add(element.id);
  show();
}

/** Remembers the values of those in a part that an answer replaces, except of those that were just sent. */
export function keep(part, sending) {
  for (const element of elements().filter((one) => part.contains(one) && !sending.has(one))) {
    for (const { id, value } of fieldsOf(element)) kept.set(id, value);
  }
}

document.addEventListener("htmx:afterSettle", () => {
  for (const [id, value] of kept) {
    const field = document.getElementById(id);
    if (field) field.value = value;
  }
  kept.clear();
  show();
});
