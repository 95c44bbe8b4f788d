// Page of one fit: follows its server-sent events until the fit ends, then shows the result.

import { call, hasEnded, showProblem, showProgress, wireEnds } from "/static/calls.js";

const AGAIN_MS = 3000;
const page = document.getElementById("fit-page");
// A screen reader hears each stage once, and not each percent.
const stage = document.createElement("p");
stage.className = "hidden";
stage.setAttribute("role", "status");
let isCut = false;

function follow() {
  const events = new EventSource(`/api/v1/fits/${page.dataset.fit}/events`);
  events.addEventListener("progress", (event) => {
    const fit = JSON.parse(event.data);
    showProgress(page, fit);
    if (stage.textContent !== fit.progress.stage) stage.textContent = fit.progress.stage;
    if (isCut) showProblem();
    isCut = false;
  });
  events.addEventListener("end", () => {
    events.close();
    location.reload();
  });
  events.addEventListener("error", () => {
    isCut = true;
    showProblem("The service does not respond; this page continues when it does.");
    // The browser connects again after a lost connection, but not after a refusal.
    if (events.readyState === EventSource.CLOSED) setTimeout(again, AGAIN_MS);
  });
}

async function again() {
  try {
    const { status } = await call("GET", `/fits/${page.dataset.fit}`);
    if (hasEnded(status)) location.reload();
    else follow();
  } catch (error) {
    if (error.status === 404) location.reload();
    else setTimeout(again, AGAIN_MS);
  }
}

wireEnds((_, isRemoval) => (isRemoval ? location.assign("/") : location.reload()));
if (!hasEnded(page.dataset.status)) {
  page.append(stage);
  follow();
}
