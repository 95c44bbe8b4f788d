// Page of one fit: follows its server-sent events until the fit ends, then shows the result.

import { hasEnded, showProgress, wireEnds } from "/static/calls.js";

const page = document.getElementById("fit-page");

wireEnds("/");
if (!hasEnded(page.dataset.status)) {
  const events = new EventSource(`/api/v1/fits/${page.dataset.fit}/events`);
  // A screen reader hears each stage once, and not each percent.
  const stage = document.createElement("p");
  stage.className = "hidden";
  stage.setAttribute("role", "status");
  page.append(stage);
  events.addEventListener("progress", (event) => {
    const fit = JSON.parse(event.data);
    showProgress(page, fit);
    if (stage.textContent !== fit.progress.stage) stage.textContent = fit.progress.stage;
  });
  events.addEventListener("end", () => {
    events.close();
    location.reload();
  });
}
