// Pages of an analysis: an answer that does not belong to the fields above it is marked, and the user can cancel
// a computation of seconds.

const form = document.querySelector("form[hx-get]");
const line = document.querySelector(".busy");
const part = form.getAttribute("hx-target");

const fields = () => new URLSearchParams(new FormData(form)).toString();

let answered = fields();
let sent = null;
let focused = null;

function mark() {
  if (line) line.hidden = sent === null;
  document.querySelector(part).classList.toggle("stale", sent !== null || fields() !== answered);
}

form.addEventListener("input", mark);
form.addEventListener("htmx:beforeRequest", () => {
  document.getElementById("problem").replaceChildren();
  sent = fields();
  focused = document.activeElement;
  mark();
});
form.addEventListener("htmx:afterRequest", ({ detail: { xhr } }) => {
  // A refusal is shown in the place of the answer.
  if (xhr.status === 200 || xhr.status === 422) answered = sent;
  sent = null;
  mark();
});
document.addEventListener("htmx:afterSettle", ({ target }) => {
  // Who types or is elsewhere by now goes on there.
  const isAway = ![focused, document.body].includes(document.activeElement) || fields() !== sent;
  if (!isAway) target.querySelector("h2[tabindex]")?.focus();
});
// The service ends the computation when the request ends.
line?.querySelector("button").addEventListener("click", () => {
  htmx.trigger(form, "htmx:abort");
  form.querySelector("[type=submit]").focus();
});
