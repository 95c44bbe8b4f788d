// Start page: changes are sent one after the other, as they were made, because of two at once the service might
// keep the earlier.  An answer does not replace what the user is about to press, to select or to type in.

import { showProblem, UNREACHABLE } from "/static/calls.js";
import { hasUnsaved, keep, note, sendAgain } from "/static/unsaved.js";

const ADDRESSES = {
  pending: () => "/pending",
  choice: () => `/choice?motor=${encodeURIComponent(motor())}`,
  work: () => location.href,
};
const ACTS = "#fit, #pending-confirm";
const ENTRIES = "form:not(#fit), input, select";
const FILTER = "#choice-motor";
const HAS_OPEN = CSS.supports("selector(select:open)");

const ends = {};
const waiting = [];
const sending = new Set();
const stale = new Set();
let open = 0;
let failures = 0;
let isEnded = false;
let granted = null;
let typed = null;
let pressed = null;

/** The motor whose runs are shown. */
export function motor() {
  return document.querySelector(FILTER)?.value ?? "*";
}

/** Counts the tasks; while there are any, the document has the attribute `data-busy`. */
function count(more) {
  open += more;
  document.documentElement.toggleAttribute("data-busy", open > 0);
}

/** Runs a task after those before it that concern one of these lists. */
export function inTurn(lists, task) {
  count(1);
  const mine = Promise.all(lists.map((list) => ends[list])).then(task);
  const end = mine.catch(console.warn).then(() => showStale(lists)).finally(() => count(-1));
  for (const list of lists) ends[list] = end;
  return mine;
}

/** Shows a list as the service has it now; only in its turn. */
export function renew(id) {
  const part = `#${id}`;
  const shown = htmx.ajax("GET", ADDRESSES[id](), { source: part, target: part, select: part, swap: "outerHTML" });
  // htmx gives no reason.
  return shown.catch(() => Promise.reject(new Error(UNREACHABLE)));
}

/** Whether the service lacks a change. */
export function hasChanges() {
  return !isEnded && (waiting.length > 0 || hasUnsaved());
}

function isInUse(part) {
  const isChanged = waiting.some((element) => part.contains(element) && !element.matches(ACTS));
  const isOpen = HAS_OPEN && part.querySelector("select:open") !== null;
  return isChanged || isOpen || part.contains(typed) || part.contains(pressed);
}

/** Shows those of the lists of which an answer was held back. */
async function showStale(lists) {
  for (const id of lists) {
    if (!stale.has(id) || isInUse(document.getElementById(id))) continue;
    stale.delete(id);
    await renew(id).catch(() => stale.add(id));
  }
}

function release({ type }) {
  if (type === "focusout") typed = null;
  else pressed = null;
  for (const id of stale) inTurn([id], () => {});
}

const ENDS = ["htmx:afterRequest", "htmx:validation:halted"];

/** Whether the request of an element that `begin` issues succeeds; of a press without an answer the page says so. */
function sent(element, begin) {
  return new Promise((resolve) => {
    const end = ({ detail }) => {
      if ((detail.requestConfig ?? detail).elt !== element) return;
      for (const name of ENDS) document.removeEventListener(name, end);
      // htmx calls no answer successful that leads to another page.
      resolve(Math.floor((detail.xhr?.status ?? 0) / 100) === 2);
      // The page of the sign-in says that the session has ended.
      isEnded = detail.xhr?.status === 401;
      if (detail.xhr?.status === 0 && !element.matches(ENTRIES)) setTimeout(showLost, 0, element);
    };
    for (const name of ENDS) document.addEventListener(name, end);
    begin();
  });
}

function showLost(element) {
  const button = buttonOf(element);
  showProblem(`No answer to “${button.ariaLabel ?? button.textContent.trim()}”; press it again later. ${UNREACHABLE}`);
}

function leave(element) {
  waiting.splice(waiting.indexOf(element), 1);
}

async function change(element, issueRequest) {
  leave(element);
  if (!element.isConnected) return;
  sending.add(element);
  const isSaved = await sent(element, () => issueRequest(true));
  sending.delete(element);
  if (!isSaved) failures += 1;
  if (element.matches(FILTER)) return isSaved || showFilter(element);
  if (element.matches(ENTRIES)) note(element, isSaved);
}

/** Shows the motor of the runs in the table. */
function showFilter(menu) {
  for (const option of menu.options) option.selected = option.defaultSelected;
}

function buttonOf(act) {
  return act.matches("form") ? act.querySelector("[type=submit]") : act;
}

/** Starts a fit or adds runs, unless one of the changes before it has failed. */
async function act(element, failuresBefore) {
  leave(element);
  // A form is not submitted again while the events of its submission are handled.
  await new Promise((resolve) => setTimeout(resolve));
  // An answer may have replaced it.
  const now = document.getElementById(element.id);
  const button = now && buttonOf(now);
  if (!button) return;
  button.disabled = button.dataset.new === "0";
  if (button.disabled || failures !== failuresBefore || !now.reportValidity()) return;
  granted = now;
  const success = sent(granted, () => button.click());
  // After a success another page is loaded, which may take a while.
  button.disabled = true;
  button.disabled = await success;
}

document.addEventListener("htmx:confirm", (event) => {
  const { elt, target, question, issueRequest } = event.detail;
  if (!elt.closest("#upload, #pending, #fit") || elt.id in ADDRESSES || elt.id === "prospects") return;
  if (elt === granted) {
    granted = null;
    return;
  }
  event.preventDefault();
  // What waits is sent with the values that it has then, and a button in its second press does nothing new;
  // but the order of a change and another one counts.
  const isLast = waiting.length > 0 ? waiting.at(-1) === elt : sending.has(elt) && elt.matches("button");
  if (isLast || (question && !confirm(question))) return;
  if (elt.matches(`${ACTS}, ${FILTER}`)) sendAgain();
  waiting.push(elt);
  if (!elt.matches(ACTS)) {
    inTurn([elt.closest("#fit") && target.id !== "pending" ? "choice" : "pending"], () => change(elt, issueRequest));
    return;
  }
  const before = failures;
  const isAddition = elt.id === "pending-confirm";
  buttonOf(elt).disabled = true;
  // All files that were dropped are added.
  Promise.resolve(isAddition && ends.files).then(() => inTurn(isAddition ? ["pending", "choice"] : ["choice"], () => act(elt, before)));
});

function hold(detail, id) {
  if (!id || !detail.shouldSwap) return;
  if (!isInUse(detail.target)) return keep(detail.target, sending);
  detail.shouldSwap = false;
  if (id in ADDRESSES) stale.add(id);
}
document.addEventListener("htmx:beforeSwap", ({ detail }) => {
  hold(detail, detail.target.id === "runs-panel" ? "choice" : detail.target.closest("#pending, #choice, #work")?.id);
});
document.addEventListener("htmx:oobBeforeSwap", ({ detail }) => hold(detail, detail.target.id));

document.addEventListener("input", ({ target }) => {
  if (target.matches(":is(#choice, #pending, #labels) input")) typed = target;
});
document.addEventListener("change", () => (typed = null), true);
for (const name of ["pointerdown", "keydown"]) document.addEventListener(name, ({ target }) => (pressed = target), true);
for (const name of ["pointerup", "pointercancel", "dragend", "keyup", "focusout"]) document.addEventListener(name, release);
window.addEventListener("blur", release);

// Enter in a field of the table is not the request for a fit.
document.addEventListener("keydown", (event) => {
  if (event.key !== "Enter" || !event.target.matches("#choice input")) return;
  event.preventDefault();
  typed = null;
  if (event.target.id === "choice-pattern") document.getElementById("choice-by-pattern").click();
  else event.target.dispatchEvent(new Event("change", { bubbles: true }));
});
