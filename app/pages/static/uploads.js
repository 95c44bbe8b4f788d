// Start page: sends dropped or selected files one by one; the page then shows what was understood.

import { guard, UNREACHABLE } from "/static/calls.js";
import { hasChanges, inTurn, renew } from "/static/changes.js";

const form = document.getElementById("upload");
const drop = document.getElementById("drop");
const files = document.getElementById("files");
const received = document.getElementById("received");

const RETRY_MS = 3000;

let unsent = 0;

function notice(kind, name, text) {
  const line = document.createElement("li");
  const file = document.createElement("strong");
  line.className = kind;
  file.textContent = name;
  line.append(file, ` ${text}`);
  received.append(line);
  return line;
}

/** Shows a file that was received below the others. */
function add(text) {
  const pending = document.getElementById("pending");
  htmx.swap(pending, text, { swapStyle: "beforeend" });
  pending.hidden = false;
}

/** Sends a form with a file; fetch would not tell whether the upload makes progress. */
function post(body) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    for (const end of ["error", "abort"]) request.addEventListener(end, () => reject(new Error(UNREACHABLE)));
    request.addEventListener("load", () => resolve(request));
    request.open("POST", "/pending");
    request.setRequestHeader("HX-Request", "true");
    guard(request);
    request.send(body);
  });
}

async function send(file, position) {
  const line = notice("busy", file.name, `is read (${position}) …`);
  const body = new FormData(form);
  body.append("file", file);
  let problem = "could not be sent; check your connection, that motorid serve is running, and that this is a file and has not changed since you selected it; then select it again";
  try {
    const answer = await post(body);
    const isRead = answer.status === 200;
    if (answer.getResponseHeader("HX-Redirect")) location.assign(answer.getResponseHeader("HX-Redirect"));
    problem = isRead ? "" : new DOMParser().parseFromString(answer.responseText, "text/html").body.textContent.trim();
    if (isRead) add(answer.responseText);
  } catch (error) {
    console.warn(error);
  }
  line.remove();
  if (problem) notice("bad", file.name, problem);
}

/** Counts the new files; shows all again if another tab has added or discarded some. */
async function count() {
  const head = "#pending-head";
  await htmx.ajax("GET", "/pending", { source: "#pending", target: head, select: head, swap: "outerHTML" });
  const shown = document.querySelectorAll("#pending article").length;
  if (shown !== Number(document.querySelector(head).dataset.runs)) await renew("pending");
}

/** Counts the new files until the service responds. */
function countAgain() {
  return inTurn(["pending"], count).catch(() => setTimeout(countAgain, RETRY_MS));
}

async function sendAll(list) {
  for (const [index, file] of list.entries()) await inTurn(["pending"], () => send(file, `${index + 1} of ${list.length}`));
  await countAgain();
  unsent -= list.length;
}

function take(list) {
  if (unsent === 0) received.replaceChildren();
  unsent += list.length;
  // Sequential, sorted by name, because the order of upload counts as the order of recording.
  const sorted = [...list].sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
  inTurn(["files"], () => sendAll(sorted));
}

window.addEventListener("beforeunload", (event) => {
  if (unsent > 0 || hasChanges()) event.preventDefault();
});

files.addEventListener("change", () => {
  take(files.files);
  files.value = "";
});
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
  take(event.dataTransfer.files);
});
