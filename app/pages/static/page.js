// All pages: times in the reader's time zone, lost connections, clicks on buttons that are replaced while
// they are pressed, and problems that end with the next success.

import { showProblem, UNREACHABLE } from "/static/calls.js";

function localTime(text) {
  // The Swedish form is ISO 8601, which no reader mistakes for month and day exchanged.
  return new Date(text).toLocaleString("sv-SE", { dateStyle: "short", timeStyle: "short" });
}

/** Dates on the axis of a drawing; times of the day if all are of one day. */
function showLocalAxis(labels) {
  const times = labels.map((label) => localTime(label.dataset.time).split(" "));
  const isOneDay = new Set(times.map(([date]) => date)).size === 1;
  labels.forEach((label, index) => (label.textContent = times[index][isOneDay ? 1 : 0]));
}

function showLocalTimes(root) {
  for (const time of root.querySelectorAll("time[datetime]")) {
    time.title = `${time.dateTime.slice(0, 16).replace("T", " ")} UTC`;
    time.textContent = localTime(time.dateTime);
  }
  for (const option of root.querySelectorAll("option[data-time]")) {
    option.text = option.text.replace(/[-\d]+ [:\d]+ UTC/, localTime(option.dataset.time));
  }
  for (const drawing of root.querySelectorAll("svg")) {
    showLocalAxis([...drawing.querySelectorAll("text[data-time]")]);
  }
}

// A selection that overtakes another aborts its request, which htmx would report as two errors.  After
// a request that did fail, "sendError" or "timeout" follows "afterRequest".
htmx.logger = (_, name, detail) => {
  if (name === "htmx:sendAbort" || name === "htmx:afterRequest") delete detail.error;
};

document.addEventListener("htmx:sendError", () => showProblem(UNREACHABLE));

// Who signs in next in this tab does not get what was typed.
document.querySelector("form.who")?.addEventListener("submit", () => sessionStorage.clear());

// A press of the mouse takes longer than an answer of the service.  The answer to a value that was typed just
// before may replace the pressed button, and the browser then sends its click to no button.
let pressed = null;
document.addEventListener("pointerdown", (event) => {
  const button = event.pointerType === "mouse" && event.button === 0 && event.target.closest("button[id]");
  pressed = button ? { button, x: event.clientX, y: event.clientY } : null;
}, true);
document.addEventListener("pointerup", ({ clientX, clientY }) => {
  const isStill = pressed && Math.hypot(clientX - pressed.x, clientY - pressed.y) < 8;
  if (isStill && !pressed.button.isConnected) document.getElementById(pressed.button.id)?.click();
  pressed = null;
});

showLocalTimes(document);
document.addEventListener("htmx:load", (event) => showLocalTimes(event.detail.elt.parentElement ?? document));
document.addEventListener("htmx:afterRequest", (event) => {
  const { elt, successful, requestConfig } = event.detail;
  // The prospects are requested by the page itself.
  const isOfUser = requestConfig.verb !== "get" && elt.id !== "prospects";
  if (successful && isOfUser) document.getElementById("problem").replaceChildren();
});
