// HTTP calls of the pages, with readable error messages.

const PREFIX = "/api/v1";
export const UNREACHABLE = "The service does not respond; check your connection, and that motorid serve is running.";

const LONGEST_CALL_MS = 20_000;
const PATIENCE_MS = 10_000;
const IMPATIENCE_MS = 2_000;
const MOST_LOOKS = 60;

let isLost = false;

/** Fetches what the service has at once; a network that is gone responds with nothing, not even an error. */
export function promptly(address, options) {
  const limit = new AbortController();
  setTimeout(() => limit.abort(), LONGEST_CALL_MS);
  options?.signal?.addEventListener("abort", () => limit.abort());
  return fetch(address, { ...options, signal: limit.signal });
}

/** Whether the service responds to a new request. */
async function responds() {
  // A proxy responds in place of a service that is gone.
  isLost = !(await promptly("/healthz", { cache: "no-store" }).then(({ status }) => status < 500, () => false));
  return !isLost;
}

/** Aborts a request that gets no answer and calls `lost`.  While the service responds to others, the request
 *  goes on: the service may compute for minutes, and a large upload takes its time. */
export function guard(request, lost) {
  let looks = 0;
  let timer = 0;
  const rest = () => {
    clearTimeout(timer);
    timer = setTimeout(look, isLost ? IMPATIENCE_MS : PATIENCE_MS);
  };
  const look = async () => {
    const mine = timer;
    looks += 1;
    const isWorking = looks < MOST_LOOKS && (await responds());
    // The request has ended or made progress in between.
    if (timer !== mine) return;
    if (isWorking) return rest();
    request.abort();
    lost?.();
  };
  for (const part of [request, request.upload]) part.addEventListener("progress", rest);
  request.addEventListener("load", () => (isLost = false));
  request.addEventListener("loadend", () => (timer = clearTimeout(timer)));
  rest();
}

/** Calls the service; returns the content of the response or throws a readable error. */
export async function call(method, path) {
  let answer;
  try {
    answer = await promptly(PREFIX + path, { method });
  } catch {
    throw new Error(UNREACHABLE);
  }
  if (answer.status === 401) {
    location.assign(`/login?ended&next=${encodeURIComponent(location.pathname + location.search)}`);
    throw new Error("The session has expired; sign in again.");
  }
  // A proxy in between answers with a page of its own.
  const content = await answer.json().catch(() => null);
  if (!answer.ok) {
    const request = answer.status >= 500 && content?.request_id ? ` (request ${content.request_id})` : "";
    const text = content?.detail ? content.detail + request : `The service responded with HTTP status ${answer.status}.`;
    throw Object.assign(new Error(text), { status: answer.status });
  }
  if (!content && answer.status !== 204) throw new Error(UNREACHABLE);
  return content;
}

/** Shows a problem at the top of the page; without text, that there is none. */
export function showProblem(text) {
  const line = document.createElement("p");
  line.className = "notice bad";
  line.textContent = text ?? "";
  document.getElementById("problem").replaceChildren(...(text ? [line] : []));
}

function duration(seconds) {
  const whole = Math.max(1, Math.round(seconds));
  if (whole < 120) return `${whole} s`;
  const minutes = Math.floor(whole / 60);
  return minutes < 60 ? `${minutes} min ${whole % 60} s` : `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** Stage, percent and time left, as the server writes them in the page. */
function progressText({ stage, fraction, remaining_s: remaining }) {
  const parts = [stage, `${Math.round(100 * fraction)} %`];
  if (remaining != null) parts.push(`about ${duration(remaining)} left`);
  return parts.join(" · ");
}

/** Shows status and progress of a fit in the elements of `place` with the attribute `data-part`. */
export function showProgress(place, fit, text = progressText(fit.progress)) {
  const status = place.querySelector("[data-part=status] .state");
  status.className = `state ${fit.status}`;
  status.textContent = fit.status;
  const part = place.querySelector("[data-part=progress]");
  const bar = part.querySelector("progress");
  if (!bar) return;
  bar.value = fit.progress.fraction;
  part.querySelector(".stage").textContent = text;
}

/** Shows status, progress and the number of fits in each state of a batch. */
export function showBatch(place, batch) {
  const counts = Object.entries(batch.counts).map(([state, number]) => `${number} ${state}`).join(", ");
  showProgress(place, batch, counts);
}

/** Whether a fit or a batch has ended. */
export function hasEnded(status) {
  return ["succeeded", "failed", "cancelled", "partial"].includes(status);
}

/** Lets each button with `data-end` cancel or remove its fit, each with `data-end-batch` its batch.
 *  Then `done` is called with the button and whether it was a removal. */
export function wireEnds(done) {
  document.addEventListener("click", ({ target }) => {
    const button = target.closest("[data-end], [data-end-batch]");
    if (!button) return;
    const { end: fit, endBatch: batch } = button.dataset;
    if (fit) end(button, `/fits/${fit}`, "this fit, its report and its posterior", done);
    else end(button, `/batches/${batch}`, "this batch and all its fits", done);
  });
}

async function end(button, path, words, done) {
  const isRemoval = button.textContent.trim() === "Remove";
  if (isRemoval && !confirm(`Remove ${words}?`)) return;
  button.disabled = true;
  try {
    // What is cancelled here may have ended meanwhile; it is not removed.
    await call("DELETE", isRemoval ? path : `${path}?remove=false`);
  } catch (error) {
    // 404: removed in another tab.
    if (error.status !== 404) {
      button.disabled = false;
      alert(error.message);
      return;
    }
  }
  done(button, isRemoval);
}
