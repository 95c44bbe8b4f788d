// Start page: selects runs for a fit, starts fits and shows their progress.

import { call, hasEnded, showBatch, showProgress, wireEnds } from "/static/calls.js";
import { knownWords, list } from "/static/words.js";

const WATCH_MS = 1000;

const fit = document.getElementById("fit");

function chosen(role) {
  // The table starts with the newest run; a fit takes the runs in the order of upload.
  const rows = [...document.querySelectorAll("#runs tr")].reverse();
  return rows.filter((row) => row.querySelector("select").value === role);
}

function showChoice() {
  const training = chosen("training");
  const validation = chosen("validation");
  fit.querySelector("button[type=submit]").disabled = training.length === 0;
  const motors = new Set([...training, ...validation].map((row) => row.dataset.motor));
  let text = `Training runs: ${training.length}, validation runs: ${validation.length}.`;
  if (training.length === 0) text = "Select at least one training run.";
  else if (motors.size > 1) text += " Warning: these runs belong to different motors.";
  document.getElementById("chosen").textContent = text;
}

function request() {
  const ids = (role) => chosen(role).map((row) => row.dataset.run);
  const field = fit.elements;
  const motor = chosen("training")[0].dataset.motor;
  return {
    training: ids("training"),
    validation: ids("validation"),
    motor: motor || null,
    options: {
      posterior: field.posterior.checked,
      effects: field.effects.checked,
      hold: field.hold.value,
      effort: field.effort.value,
      set_aside: field.contradicting.value === "set_aside",
      force: field.contradicting.value === "force",
      temperatures: list(field.temperatures.value.replaceAll(",", " ")).map(Number),
      controllers: list(field.controllers.value),
      known: knownWords(field.known.value),
      nameplate: field.nameplate.value.trim(),
      seed: Number(field.seed.value),
    },
  };
}

if (fit) {
  fit.addEventListener("change", showChoice);
  fit.addEventListener("submit", async (event) => {
    event.preventDefault();
    const problem = document.getElementById("fit-problem");
    problem.hidden = true;
    try {
      const { content } = await call("POST", "/fits", request());
      location.assign(`/fits/${content.id}`);
    } catch (error) {
      problem.textContent = error.message;
      problem.hidden = false;
    }
  });
  for (const button of document.querySelectorAll("[data-delete]")) {
    button.addEventListener("click", async () => {
      if (!confirm("Delete this run?")) return;
      try {
        await call("DELETE", `/runs/${button.dataset.delete}`);
        location.reload();
      } catch (error) {
        alert(error.message);
      }
    });
  }
  const filter = document.getElementById("show-motor");
  filter?.addEventListener("change", () => {
    for (const row of document.querySelectorAll("#runs tr")) {
      row.hidden = filter.value !== "" && row.dataset.motor !== filter.value;
      if (row.hidden) row.querySelector("select").value = "";
    }
    showChoice();
  });
}

/** Updates the unfinished rows with the attribute `data-KIND`; returns their number. */
async function look(kind, path, show, mayReload) {
  const rows = [...document.querySelectorAll(`[data-${kind}]`)].filter((row) => !hasEnded(row.dataset.status));
  if (rows.length === 0) return 0;
  const { content } = await call("GET", path);
  const found = new Map(content.items.map((item) => [item.id, item]));
  let ended = 0;
  for (const row of rows) {
    const now = found.get(row.dataset[kind]);
    if (!now || hasEnded(now.status)) ended += 1;
    if (now) show(row, now);
  }
  // A reload would discard the selected roles, so the page reloads only if none is selected.
  if (ended && mayReload && chosen("training").length + chosen("validation").length === 0) location.reload();
  return rows.length;
}

async function watch() {
  const batches = await look("batch", "/batches?limit=50", showBatch, true);
  // The fits of a running batch end often, so the page reloads only after the batch has ended.
  const fits = await look("fit", "/fits?limit=100", showProgress, batches === 0);
  if (batches + fits) setTimeout(watch, WATCH_MS);
}

wireEnds("/");
watch();
