// Plots of the channels of a run over time, with a common cursor.

import { promptly } from "/static/calls.js";

const CHANNELS = [
  ["voltage_V", "Voltage [V]"],
  ["current_A", "Current [A]"],
  ["speed_rad_s", "Speed [rad/s]"],
  ["temperature_degC", "Temperature [°C]"],
];
const HEIGHT = 120;

const signed = (plot, values) => values.map((value) => uPlot.fmtNum(value).replace("-", "−"));

function options(label, width, key) {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(`--${name}`).trim();
  const axis = {
    stroke: colour("muted"), font: "11px system-ui", grid: { stroke: colour("rule"), width: 1 },
    ticks: { show: false },
  };
  return {
    width, height: HEIGHT, title: label,
    legend: { show: false },
    cursor: { sync: { key }, y: false, drag: { x: true, y: false } },
    scales: { x: { time: false } },
    axes: [{ ...axis, size: 26, space: 60 }, { ...axis, size: 48, space: 18, values: signed }],
    series: [{}, { stroke: colour("link"), width: 1.2, points: { show: false } }],
  };
}

const loads = new Set();

async function draw(place) {
  place.dataset.drawn = "";
  const load = new AbortController();
  loads.add(load);
  const samples = await promptly(place.dataset.samples, { signal: load.signal })
    .then((answer) => (answer.ok ? answer.json() : null)).catch(() => null);
  loads.delete(load);
  if (load.signal.aborted) {
    delete place.dataset.drawn;
    return;
  }
  place.replaceChildren();
  if (!samples) {
    delete place.dataset.drawn;
    place.textContent = "The plots could not be loaded; reload the page to see them.";
    return;
  }
  const plots = [];
  for (const [name, label] of CHANNELS) {
    if (!samples[name]) continue;
    const box = document.createElement("div");
    place.append(box);
    plots.push(new uPlot(options(label, box.clientWidth, place.dataset.samples), [samples.time_s, samples[name]], box));
  }
  new ResizeObserver(() => {
    for (const plot of plots) plot.setSize({ width: plot.root.parentElement.clientWidth, height: HEIGHT });
  }).observe(place);
}

function drawAll(root) {
  root.querySelectorAll("[data-samples]:not([data-drawn])").forEach(draw);
}

// A file that is added or discarded has no samples any more.
document.addEventListener("htmx:beforeRequest", ({ detail }) => {
  if (detail.elt.matches("#pending-confirm, #pending [hx-delete]")) loads.forEach((load) => load.abort());
});
for (const refusal of ["htmx:responseError", "htmx:sendError"]) document.addEventListener(refusal, () => drawAll(document));

drawAll(document);
document.addEventListener("htmx:load", (event) => drawAll(event.detail.elt));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const place of document.querySelectorAll("[data-samples]")) delete place.dataset.drawn;
  drawAll(document);
});
