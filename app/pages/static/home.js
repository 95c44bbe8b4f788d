// Start page: shows the progress of fits and batches, and moves the focus from what is removed.

import { call, hasEnded, showBatch, showProblem, showProgress, wireEnds } from "/static/calls.js";
import { inTurn, renew } from "/static/changes.js";

const WATCH_MS = 1000;

/** Shows the fits and batches anew; the forms above keep what was typed. */
function renewWork() {
  return inTurn(["work"], () => renew("work"));
}

/** Updates the unfinished rows with the attribute `data-KIND`; counts them, and those that have ended. */
async function look(kind, path, show) {
  const rows = [...document.querySelectorAll(`[data-${kind}]`)].filter((row) => !hasEnded(row.dataset.status));
  if (rows.length === 0) return { open: 0, ended: 0 };
  const { items } = await call("GET", path);
  const found = new Map(items.map((item) => [item.id, item]));
  let ended = 0;
  for (const row of rows) {
    const now = found.get(row.dataset[kind]);
    if (!now || hasEnded(now.status)) ended += 1;
    if (now) show(row, now);
  }
  return { open: rows.length, ended };
}

let isCut = false;

async function watch() {
  try {
    const batches = await look("batch", "/batches?limit=50", showBatch);
    const { after } = document.getElementById("work").dataset;
    const path = `/fits?limit=100${after && `&after=${encodeURIComponent(after)}`}`;
    const fits = await look("fit", path, showProgress);
    // Before the list is renewed, which takes a while.
    if (isCut) showProblem();
    isCut = false;
    // The fits of a running batch end often, so the list is renewed only after the batch has ended.
    if (batches.ended || (fits.ended && !batches.open)) await renewWork();
    if (batches.open + fits.open) setTimeout(watch, WATCH_MS);
  } catch (error) {
    // The service may be restarting, and its fits continue after that.
    isCut = true;
    showProblem(error.message);
    setTimeout(watch, 3 * WATCH_MS);
  }
}

// What takes the focus when an entry of a list is removed: this part of the entry in its place, or
// the element with this ID if the list is empty.
const LISTS = {
  pending: ["article", "h3", "files"],
  choice: ["#runs tr", "select", "files"],
  work: ["tbody tr", "a", "fits-title"],
};

function entries(list) {
  return [...document.querySelectorAll(`#${list} ${LISTS[list][0]}`)];
}

function indexOf(list, button) {
  return entries(list).findIndex((entry) => entry.contains(button));
}

function focusIn(list, index) {
  const [, part, otherwise] = LISTS[list];
  const left = entries(list);
  const next = left[Math.min(index, left.length - 1)]?.querySelector(part);
  (next ?? document.getElementById(otherwise)).focus();
}

/** Whether nothing has the focus; htmx restores it if its element is still there. */
function isFocusLost() {
  return document.activeElement === document.body;
}

let moveFocus = null;
document.addEventListener("htmx:beforeSwap", ({ detail: { requestConfig, shouldSwap, target } }) => {
  const { elt, verb } = requestConfig;
  if (!shouldSwap) return;
  if (target.id in LISTS) {
    // The entry may be gone afterwards: deleted, discarded, or renamed to another motor.
    const index = indexOf(target.id, document.activeElement);
    if (index >= 0 || verb === "delete") moveFocus = () => isFocusLost() && focusIn(target.id, Math.max(index, 0));
  } else if (elt.id === "pending-confirm" && target.id === "runs-panel") {
    moveFocus = () => document.getElementById("runs-title").focus();
  }
});
document.addEventListener("htmx:afterSettle", () => {
  moveFocus?.();
  moveFocus = null;
});

// A run or a new file that is gone was removed in another tab or by another user.
document.addEventListener("htmx:afterRequest", ({ detail: { xhr, requestConfig } }) => {
  if (xhr.status !== 404 || requestConfig.verb === "get") return;
  inTurn(["pending", "choice"], async () => {
    await renew("choice");
    await renew("pending");
    showProblem("This was removed in the meantime, in another tab or by another user. The lists are now up to date.");
  });
});

// What is not computed must not seem to be computed still.
document.addEventListener("htmx:afterRequest", ({ detail: { elt, successful } }) => {
  if (elt.id !== "prospects" || successful) return;
  const line = document.createElement("p");
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "Compute again";
  button.addEventListener("click", () => {
    elt.tabIndex = -1;
    elt.focus();
    htmx.trigger(elt, "again");
  });
  line.append("What these runs can identify could not be computed. ", button);
  elt.replaceChildren(line);
});

wireEnds(async (button) => {
  const index = indexOf("work", button);
  try {
    await renewWork();
  } catch (error) {
    // The next press finds it removed.
    button.disabled = false;
    showProblem(error.message);
    return;
  }
  const same = document.getElementById(button.id);
  if (same) same.focus();
  else focusIn("work", index);
});
watch();
