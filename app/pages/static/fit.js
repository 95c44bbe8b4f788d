// Page of one fit: follows its progress until the fit ends, then shows the result.

import { call, hasEnded, showProblem, showProgress, wireEnds } from "/static/calls.js";

const AGAIN_MS = 3000;
const page = document.getElementById("fit-page");
const path = `/fits/${page.dataset.fit}`;
// A screen reader hears each stage once, and not each percent.
const stage = document.createElement("p");
stage.className = "hidden";
stage.setAttribute("role", "status");
let isCut = false;
let events = null;
let timer = 0;

let isLeaving = false;

/** Loads the page again, once: the end of a fit that is cancelled here comes twice. */
function reload() {
  if (!isLeaving) location.reload();
  isLeaving = true;
}

function show(fit) {
  showProgress(page, fit);
  if (stage.textContent !== fit.progress.stage) stage.textContent = fit.progress.stage;
  if (isCut) showProblem();
  isCut = false;
}

function cut() {
  isCut = true;
  showProblem("The service does not respond; this page continues when it does.");
}

function follow() {
  events?.close();
  events = new EventSource(`/api/v1${path}/events`);
  events.addEventListener("progress", ({ data }) => show(JSON.parse(data)));
  events.addEventListener("end", () => {
    events.close();
    reload();
  });
  events.addEventListener("error", () => {
    // The browser connects again after a lost connection, but not after a refusal, as at the limit of
    // event streams.
    if (events.readyState === EventSource.CLOSED) look(wait);
    else cut();
  });
}

function wait() {
  clearTimeout(timer);
  timer = setTimeout(look, AGAIN_MS, wait);
}

/** Shows the state as the service has it now, then goes on as `next` does. */
async function look(next) {
  try {
    const fit = await call("GET", path);
    if (hasEnded(fit.status)) return reload();
    show(fit);
  } catch (error) {
    if (error.status === 404) return reload();
    cut();
    next = wait;
  }
  if (!document.hidden) next();
}

wireEnds((_, isRemoval) => (isRemoval ? location.assign("/") : reload()));
if (!hasEnded(page.dataset.status)) {
  page.append(stage);
  if (!document.hidden) follow();
  // A browser opens six connections to a service, and each stream occupies one: six pages in the
  // background would leave none to other pages.
  document.addEventListener("visibilitychange", () => {
    events?.close();
    clearTimeout(timer);
    if (!document.hidden) look(follow);
  });
}
