/* Draws the chosen run: panels over one time axis that zoom together.
   Needs uPlot; the data lie in the block with id "traces". No eval, no network, no storage. */
(function () {
  "use strict";

  var runs = JSON.parse(document.getElementById("traces").textContent).runs;
  var panels = document.getElementById("panels");
  var plots = [];
  var shown = -1;
  var linking = false;
  var range = [0, 1];

  function bytes(text) {
    var raw = atob(text);
    var out = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out.buffer;
  }

  function times(packed) {
    return Array.from(new Float32Array(bytes(packed.data)), function (value) {
      return packed.start + value;
    });
  }

  function values(packed) {
    return Array.from(new Uint16Array(bytes(packed.data)), function (word) {
      return word === 65535 ? null : packed.low + packed.step * word;
    });
  }

  function colour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  }

  function digits(value) {
    return value == null ? "–" : Number(value.toPrecision(5)).toString().replace(/-/g, "−");
  }

  function element(kind, name, text) {
    var made = document.createElement(kind);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  /* Name, unit and key of a panel; the readings follow the cursor. */
  function heading(panel) {
    var head = element("div", "panelhead");
    head.append(element("span", "title", panel.label + " [" + panel.unit + "]"));
    var readings = panel.series.map(function (series) {
      var item = element("span", "reading");
      item.append(element("span", "swatch " + series.kind), series.label + " ");
      var value = element("span", "num", "");
      item.append(value);
      head.append(item);
      return value;
    });
    var clock = element("span", "reading num", "");
    head.append(clock);
    return { head: head, read: function (plot) {
      var at = plot.cursor.idx;
      readings.forEach(function (value, i) {
        value.textContent = at == null ? "" : digits(plot.data[i + 1][at]);
      });
      clock.textContent = at == null ? "" : "at " + digits(plot.data[0][at]) + " s";
    } };
  }

  function noiseLines(panel) {
    return function (plot) {
      if (!panel.noise) return;
      var pen = plot.ctx, box = plot.bbox;
      pen.save();
      pen.strokeStyle = colour("muted");
      pen.lineWidth = devicePixelRatio;
      pen.setLineDash([3 * devicePixelRatio, 3 * devicePixelRatio]);
      [-2.576, 2.576].forEach(function (factor) {
        var y = Math.round(plot.valToPos(factor * panel.noise, "y", true));
        if (y < box.top || y > box.top + box.height) return;
        pen.beginPath();
        pen.moveTo(box.left, y);
        pen.lineTo(box.left + box.width, y);
        pen.stroke();
      });
      pen.restore();
    };
  }

  function link(plot) {
    if (linking) return;
    linking = true;
    var scale = plot.scales.x;
    plots.forEach(function (other) {
      if (other !== plot) other.setScale("x", { min: scale.min, max: scale.max });
    });
    linking = false;
  }

  function options(panel, isLast, head) {
    var axis = {
      stroke: colour("muted"), font: "11px system-ui, sans-serif",
      grid: { stroke: colour("grid"), width: 1 }, ticks: { stroke: colour("rule"), width: 1, size: 4 }
    };
    return {
      width: panels.clientWidth, height: (panel.tall ? 190 : 96) + (isLast ? 38 : 12),
      legend: { show: false }, padding: [6, 8, isLast ? 0 : 6, 0],
      scales: { x: { time: false } },
      cursor: {
        drag: { x: true, y: false, setScale: true },
        points: { size: 6 },
        sync: { key: "run", scales: ["x", null], filters: { pub: function (type) {
          return type === "mousemove" || type === "mouseleave";
        } } }
      },
      axes: [
        Object.assign({}, axis, isLast ? { label: "time [s]", labelSize: 16, labelFont: "12px system-ui, sans-serif", size: 26 }
                                       : { size: 0, ticks: { show: false }, values: function () { return []; } }),
        Object.assign({}, axis, { size: 62, space: 26 })
      ],
      series: [{}].concat(panel.series.map(function (series) {
        return {
          stroke: colour(series.kind !== "measured" ? series.kind : panel.tall ? "trace" : "voltage"),
          width: series.kind === "measured" && panel.tall ? 3 : 1.2,
          points: { show: false }, spanGaps: false
        };
      })),
      hooks: {
        draw: [noiseLines(panel)],
        setCursor: [head.read],
        setScale: [function (plot, key) { if (key === "x" && plot.status === 1) link(plot); }]
      }
    };
  }

  function draw() {
    plots.forEach(function (plot) { plot.destroy(); });
    plots = [];
    panels.replaceChildren();
    var run = runs[shown];
    run.panels.forEach(function (panel, index) {
      if (!panel.data) {
        panel.data = [times(panel.time)].concat(panel.series.map(values));
      }
      var block = element("div", "panel");
      var head = heading(panel);
      block.append(head.head);
      panels.append(block);
      var isLast = index === run.panels.length - 1;
      plots.push(new uPlot(options(panel, isLast, head), panel.data, block));
    });
    var time = run.panels[0].data[0];
    range = [time[0], time[time.length - 1]];
    plots[0].setScale("x", { min: range[0], max: range[1] });
    plots.forEach(function (plot) { plot.root.setAttribute("aria-hidden", "true"); });
  }

  function redraw() {
    if (shown < 0) return;
    var scale = plots[0].scales.x, kept = { min: scale.min, max: scale.max };
    draw();
    plots[0].setScale("x", kept);
  }

  function choose(index) {
    shown = index;
    document.getElementById("detail").hidden = false;
    document.getElementById("detail-title").textContent = runs[index].name + " (" + runs[index].role + ")";
    document.querySelectorAll(".card").forEach(function (card) {
      card.setAttribute("aria-pressed", String(Number(card.dataset.run) === index));
    });
    draw();
  }

  function zoom(how) {
    var scale = plots[0].scales.x, width = scale.max - scale.min;
    var middle = (scale.min + scale.max) / 2;
    if (how === "in") width = Math.max(width / 2, 1e-9 * (range[1] - range[0]));
    if (how === "out") width = width * 2;
    if (how === "earlier") middle -= width / 2;
    if (how === "later") middle += width / 2;
    width = how === "all" ? range[1] - range[0] : Math.min(width, range[1] - range[0]);
    middle = Math.min(Math.max(middle, range[0] + width / 2), range[1] - width / 2);
    plots[0].setScale("x", { min: middle - width / 2, max: middle + width / 2 });
  }

  document.querySelectorAll(".card").forEach(function (card) {
    card.addEventListener("click", function () {
      choose(Number(card.dataset.run));
    });
  });
  document.querySelectorAll("[data-zoom]").forEach(function (button) {
    button.addEventListener("click", function () { zoom(button.dataset.zoom); });
  });

  var dark = matchMedia("(prefers-color-scheme: dark)");
  var theme = document.getElementById("theme");
  theme.hidden = false;
  theme.addEventListener("click", function () {
    var root = document.documentElement;
    var isDark = root.dataset.theme ? root.dataset.theme === "dark" : dark.matches;
    root.dataset.theme = isDark ? "light" : "dark";
    redraw();
  });
  dark.addEventListener("change", redraw);
  matchMedia("print").addEventListener("change", redraw);

  if (runs.length) {
    var first = runs.findIndex(function (run) { return run.role === "validation"; });
    choose(Math.max(first, 0));
    new ResizeObserver(function () {
      plots.forEach(function (plot) {
        if (plot.width !== panels.clientWidth && panels.clientWidth > 0) {
          plot.setSize({ width: panels.clientWidth, height: plot.height });
        }
      });
    }).observe(panels);
  }
})();
