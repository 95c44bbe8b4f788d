// All pages: times in the reader's time zone, and problems that end with the next success.

function showLocalTimes(root) {
  for (const time of root.querySelectorAll("time[datetime]")) {
    const at = new Date(time.dateTime);
    time.title = `${time.dateTime.slice(0, 16).replace("T", " ")} UTC`;
    // The Swedish form is ISO 8601, which no reader mistakes for month and day exchanged.
    time.textContent = at.toLocaleString("sv-SE", { dateStyle: "short", timeStyle: "short" });
  }
}

showLocalTimes(document);
document.addEventListener("htmx:load", (event) => showLocalTimes(event.detail.elt.parentElement ?? document));
document.addEventListener("htmx:afterRequest", (event) => {
  const { successful, requestConfig } = event.detail;
  if (successful && requestConfig.verb !== "get") document.getElementById("problem").replaceChildren();
});
