// Page of the keys: a key whose secret nobody saw, because the answer to its creation was lost.

import { showProblem } from "/static/calls.js";

const STORED = "key that is created";
const RETRY_MS = 3000;

/** Asks whether the key exists, until the service responds; the answer takes the place of the page. */
async function look() {
  const id = sessionStorage.getItem(STORED);
  if (!id) return;
  await htmx.ajax("GET", `/keys?lost=${id}`, { source: "#keys", target: "#keys", select: "#keys", swap: "outerHTML" }).catch(() => {});
  if (sessionStorage.getItem(STORED)) setTimeout(look, RETRY_MS);
}

document.addEventListener("htmx:beforeRequest", ({ detail: { elt } }) => {
  if (elt.id === "create") sessionStorage.setItem(STORED, elt.elements.key.value);
});
document.addEventListener("htmx:afterRequest", ({ detail: { requestConfig: { elt }, xhr } }) => {
  const isKnown = xhr.status > 0 && xhr.status < 500;
  if (elt.id === "create" && !isKnown) look();
  if (!isKnown || !["create", "keys"].includes(elt.id)) return;
  sessionStorage.removeItem(STORED);
  if (elt.id === "keys") showProblem();
});
look();
