// All pages: times in the reader's time zone, lost connections, double clicks, and problems that end with the
// next success.

import { guard, showProblem, UNREACHABLE } from "/static/calls.js";

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
document.addEventListener("htmx:beforeSend", ({ detail }) => guard(detail.xhr, () => showProblem(UNREACHABLE)));

// The answer to the first click of a double click may have put another button in its place.
document.addEventListener("click", (event) => {
  if (event.detail < 2 || !event.target.closest("button")) return;
  event.preventDefault();
  event.stopPropagation();
}, true);

// Who signs in next in this tab does not get what was typed.
document.querySelector("form.who")?.addEventListener("submit", () => sessionStorage.clear());

// A form of the browser is sent once, however late its answer comes.
document.addEventListener("submit", ({ target, submitter }) => {
  if (target.method === "post" && submitter) setTimeout(() => (submitter.disabled = true));
});
window.addEventListener("pageshow", ({ persisted }) => persisted && location.reload());

showLocalTimes(document);
document.addEventListener("htmx:load", (event) => showLocalTimes(event.detail.elt.parentElement ?? document));
// A problem ends with the success of what the user does after it.
let problemAt = 0;
document.addEventListener("htmx:afterRequest", ({ detail: { successful, requestConfig } }) => {
  if (!successful) problemAt = performance.now();
  const { triggeringEvent, verb } = requestConfig;
  const isOfUser = verb !== "get" && triggeringEvent?.type !== "load";
  if (successful && isOfUser && triggeringEvent?.timeStamp > problemAt) document.getElementById("problem").replaceChildren();
});
