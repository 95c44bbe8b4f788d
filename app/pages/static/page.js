// All pages: times in the reader's time zone, and problems that end with the next success.

function localTime(text) {
  // The Swedish form is ISO 8601, which no reader mistakes for month and day exchanged.
  return new Date(text).toLocaleString("sv-SE", { dateStyle: "short", timeStyle: "short" });
}

function showLocalTimes(root) {
  for (const time of root.querySelectorAll("time[datetime]")) {
    time.title = `${time.dateTime.slice(0, 16).replace("T", " ")} UTC`;
    time.textContent = localTime(time.dateTime);
  }
  for (const option of root.querySelectorAll("option[data-time]")) {
    option.text = option.text.replace(/[-\d]+ [:\d]+ UTC/, localTime(option.dataset.time));
  }
}

showLocalTimes(document);
document.addEventListener("htmx:load", (event) => showLocalTimes(event.detail.elt.parentElement ?? document));
document.addEventListener("htmx:afterRequest", (event) => {
  const { successful, requestConfig } = event.detail;
  if (successful && requestConfig.verb !== "get") document.getElementById("problem").replaceChildren();
});
