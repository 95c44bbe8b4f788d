// Pages of an analysis: the state of a computation of seconds, which the user can cancel.

const form = document.querySelector("form[hx-get]");
const line = document.querySelector(".busy");
const cancel = line.querySelector("button");

function show(isBusy) {
  line.hidden = !isBusy;
  document.getElementById("answer").classList.toggle("stale", isBusy);
}

form.addEventListener("htmx:beforeRequest", () => {
  document.getElementById("problem").replaceChildren();
  show(true);
});
form.addEventListener("htmx:afterRequest", () => show(false));
form.addEventListener("htmx:sendAbort", () => {
  show(false);
  form.querySelector("[type=submit]").focus();
});
document.addEventListener("htmx:afterSettle", ({ target }) => target.querySelector("h2")?.focus());
// The service ends the computation when the request ends.
cancel.addEventListener("click", () => htmx.trigger(form, "htmx:abort"));
