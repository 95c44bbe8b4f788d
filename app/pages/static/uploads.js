// Start page: sends dropped or selected files one by one; the page then shows what was understood.

const form = document.getElementById("upload");
const drop = document.getElementById("drop");
const files = document.getElementById("files");
const received = document.getElementById("received");

let unsent = 0;
let isAwaited = false;

function notice(kind, name, text) {
  const line = document.createElement("li");
  const file = document.createElement("strong");
  line.className = kind;
  file.textContent = name;
  line.append(file, ` ${text}`);
  received.append(line);
  return line;
}

/** Shows a file that was received below the others; a change of the list meanwhile has shown it. */
function add(text) {
  const pending = document.getElementById("pending");
  const { id } = new DOMParser().parseFromString(text, "text/html").querySelector("article");
  if (!document.getElementById(id)) htmx.swap(pending, text, { swapStyle: "beforeend" });
  pending.hidden = false;
}

async function send(file, position) {
  const line = notice("busy", file.name, `is read (${position}) …`);
  const body = new FormData(form);
  body.append("file", file);
  let problem = "could not be sent; check that motorid serve is running, and that this is a file and has not changed since you selected it";
  try {
    const answer = await fetch("/pending", { method: "POST", body, headers: { "HX-Request": "true" } });
    if (answer.headers.has("HX-Redirect")) location.assign(answer.headers.get("HX-Redirect"));
    const text = await answer.text();
    const part = new DOMParser().parseFromString(text, "text/html");
    problem = answer.ok ? "" : part.body.textContent.trim();
    if (answer.ok) add(text);
  } catch (error) {
    console.warn(error);
  }
  line.remove();
  if (problem) notice("bad", file.name, problem);
}

/** Counts the new files; shows all again if a change of the list meanwhile has lost one. */
async function count() {
  const part = (id) => htmx.ajax("GET", "/pending", { target: id, select: id, swap: "outerHTML" });
  await part("#pending-head");
  const shown = document.querySelectorAll("#pending article").length;
  if (shown !== Number(document.getElementById("pending-head").dataset.runs)) await part("#pending");
}

async function sendAll(list) {
  if (unsent === 0) received.replaceChildren();
  unsent += list.length;
  // Sequential, sorted by name, because the order of upload counts as the order of recording.
  const sorted = [...list].sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
  for (const [index, file] of sorted.entries()) await send(file, `${index + 1} of ${sorted.length}`);
  await count().catch(console.warn);
  unsent -= sorted.length;
  files.value = "";
  addAwaited(true);
}

// Corrections of one file are sent one after the other, since of two at once the service might keep the
// earlier.  Its answer does not replace a form that has changed meanwhile and is sent again.
document.addEventListener("change", ({ target }) => target.closest("#pending form")?.setAttribute("data-unsent", ""), true);
for (const name of ["htmx:beforeRequest", "htmx:validation:halted"]) {
  document.addEventListener(name, ({ target }) => target.removeAttribute("data-unsent"));
}
document.addEventListener("htmx:beforeSwap", ({ detail }) => {
  if (detail.requestConfig.elt.hasAttribute("data-unsent")) detail.shouldSwap = false;
});

// Adding runs waits for the files that are still sent, and for the correction or the motor that was typed
// just before the click.
const BUSY = "#upload.htmx-request, #pending form.htmx-request, #pending form[data-unsent]";
function isBusy() {
  return unsent > 0 || document.querySelector(BUSY) !== null;
}

function addAwaited(isRight) {
  if (!isAwaited || (isRight && isBusy())) return;
  isAwaited = false;
  const button = document.getElementById("pending-confirm");
  if (!button) return;
  button.disabled = button.dataset.new === "0";
  if (isRight) button.click();
}

document.addEventListener("htmx:confirm", (event) => {
  if (event.target.id !== "pending-confirm" || !isBusy()) return;
  event.preventDefault();
  isAwaited = true;
  event.target.disabled = true;
});
document.addEventListener("htmx:afterRequest", ({ detail }) => {
  if (detail.requestConfig.verb !== "get") addAwaited(detail.successful || detail.xhr.status === 0);
});
window.addEventListener("beforeunload", (event) => {
  if (unsent > 0) event.preventDefault();
});

files.addEventListener("change", () => sendAll(files.files));
for (const name of ["dragenter", "dragover"]) {
  drop.addEventListener(name, (event) => {
    event.preventDefault();
    drop.classList.add("over");
  });
}
for (const name of ["dragleave", "drop"]) {
  drop.addEventListener(name, () => drop.classList.remove("over"));
}
drop.addEventListener("drop", (event) => {
  event.preventDefault();
  sendAll(event.dataTransfer.files);
});
