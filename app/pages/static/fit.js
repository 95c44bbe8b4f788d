// Page of one fit: follows its server-sent events until the fit ends, then shows the result.

import { hasEnded, showProgress, wireEnds } from "/static/calls.js";

const page = document.getElementById("fit-page");

wireEnds("/");
if (!hasEnded(page.dataset.status)) {
  const events = new EventSource(`/api/v1/fits/${page.dataset.fit}/events`);
  events.addEventListener("progress", (event) => showProgress(page, JSON.parse(event.data)));
  events.addEventListener("end", () => {
    events.close();
    location.reload();
  });
}
