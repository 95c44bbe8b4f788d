// Start page: shows the progress of fits and batches.

import { call, hasEnded, showBatch, showProblem, showProgress, wireEnds } from "/static/calls.js";

const WATCH_MS = 1000;

/** Updates the unfinished rows with the attribute `data-KIND`; returns their number. */
async function look(kind, path, show, mayReload) {
  const rows = [...document.querySelectorAll(`[data-${kind}]`)].filter((row) => !hasEnded(row.dataset.status));
  if (rows.length === 0) return 0;
  const { items } = await call("GET", path);
  const found = new Map(items.map((item) => [item.id, item]));
  let ended = 0;
  for (const row of rows) {
    const now = found.get(row.dataset[kind]);
    if (!now || hasEnded(now.status)) ended += 1;
    if (now) show(row, now);
  }
  if (ended && mayReload) location.reload();
  return rows.length;
}

let isCut = false;

async function watch() {
  try {
    const batches = await look("batch", "/batches?limit=50", showBatch, true);
    // The fits of a running batch end often, so the page reloads only after the batch has ended.
    const fits = await look("fit", "/fits?limit=100", showProgress, batches === 0);
    if (isCut) showProblem();
    isCut = false;
    if (batches + fits) setTimeout(watch, WATCH_MS);
  } catch (error) {
    // The service may be restarting, and its fits continue after that.
    isCut = true;
    showProblem(error.message);
    setTimeout(watch, 3 * WATCH_MS);
  }
}

wireEnds("/");
watch();
