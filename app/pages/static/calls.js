// The calls that the pages make, and how their refusals read.

const PREFIX = "/api/v1";

/** Calls the service; gives the content of the answer, or throws an error with a readable message. */
export async function call(method, path, body) {
  const options = { method, headers: {} };
  if (body instanceof FormData) {
    options.body = body;
  } else if (body !== undefined) {
    options.body = JSON.stringify(body);
    options.headers["Content-Type"] = "application/json";
  }
  let answer;
  try {
    answer = await fetch(PREFIX + path, options);
  } catch {
    throw new Error("The service does not answer. Is it running?");
  }
  if (answer.status === 401) {
    location.assign("/login");
    throw new Error("The session has ended; sign in again.");
  }
  const content = answer.status === 204 ? null : await answer.json();
  if (!answer.ok) {
    throw new Error(content.detail || `The service answered ${answer.status}.`);
  }
  return { content, isNew: answer.status === 201 };
}

/** Shows status and progress of a fit in the elements of `place` that are marked for them. */
export function showProgress(place, fit) {
  const status = document.createElement("span");
  status.className = `state ${fit.status}`;
  status.textContent = fit.status;
  place.querySelector("[data-part=status]").replaceChildren(status);
  const bar = document.createElement("progress");
  bar.max = 1;
  bar.value = fit.progress.fraction;
  bar.setAttribute("aria-label", "Progress");
  const stage = document.createElement("span");
  stage.className = "muted stage";
  stage.textContent = fit.progress.stage;
  place.querySelector("[data-part=progress]").replaceChildren(bar, stage);
}

/** Shows status, progress and the number of fits in each state of a batch. */
export function showBatch(place, batch) {
  const told = Object.entries(batch.counts).map(([state, number]) => `${number} ${state}`).join(", ");
  showProgress(place, {
    status: batch.status,
    progress: { fraction: batch.progress.fraction, stage: told },
  });
}

/** Whether a fit or a batch has come to its end. */
export function hasEnded(status) {
  return ["succeeded", "failed", "cancelled", "partial"].includes(status);
}

/** Has each button marked with `data-end` cancel or remove its fit, then go on to `next`; and each
 *  marked with `data-end-batch` its batch. */
export function wireEnds(next) {
  const kinds = [
    ["[data-end]", (button) => `/fits/${button.dataset.end}`, "this fit with its report and posterior"],
    ["[data-end-batch]", (button) => `/batches/${button.dataset.endBatch}`, "this batch with all its fits"],
  ];
  for (const [marked, path, words] of kinds) {
    for (const button of document.querySelectorAll(marked)) {
      button.addEventListener("click", () => end(button, path(button), words, next));
    }
  }
}

async function end(button, path, words, next) {
  const isRemoval = button.textContent.trim() === "Remove";
  if (isRemoval && !confirm(`Remove ${words}?`)) return;
  button.disabled = true;
  try {
    await call("DELETE", path);
    if (isRemoval) location.assign(next);
    else location.reload();
  } catch (error) {
    button.disabled = false;
    alert(error.message);
  }
}
