// Page of one fit: follows its progress until the fit ends, then shows the result.

import { call, hasEnded, showProblem, showProgress, wireEnds } from "/static/calls.js";

// Repeated calls in place of an event stream: a browser opens six connections to a service, and the streams
// of six pages would leave none to other pages.
const WATCH_MS = 1000;
const page = document.getElementById("fit-page");
const path = `/fits/${page.dataset.fit}`;
// A screen reader hears each stage once, and not each percent.
const stage = document.createElement("p");
stage.className = "hidden";
stage.setAttribute("role", "status");
let isCut = false;
let isLeaving = false;
let timer = 0;

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

/** Shows the state as the service has it now, again and again while the page can be seen. */
async function watch() {
  try {
    const fit = await call("GET", path);
    if (hasEnded(fit.status)) return reload();
    show(fit);
  } catch (error) {
    if (error.status === 404) return reload();
    isCut = true;
    showProblem("The service does not respond; this page continues when it does.");
  }
  clearTimeout(timer);
  if (!document.hidden) timer = setTimeout(watch, isCut ? 3 * WATCH_MS : WATCH_MS);
}

wireEnds((_, isRemoval) => (isRemoval ? location.assign("/") : reload()));
if (!hasEnded(page.dataset.status)) {
  page.append(stage);
  watch();
  document.addEventListener("visibilitychange", () => document.hidden || watch());
}
