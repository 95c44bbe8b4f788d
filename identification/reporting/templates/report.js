/* Draws the charts and the measured and simulated runs with uPlot.  No eval, network or storage. */
(function () {
  "use strict";

  var root = document.documentElement;
  var printing = false;

  function colour(name) {
    return getComputedStyle(root).getPropertyValue("--" + name).trim();
  }

  function digits(value) {
    return value == null || isNaN(value) ? "–" : Number(value.toPrecision(5)).toString().replace(/-/g, "−");
  }

  function element(kind, name, text) {
    var made = document.createElement(kind);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return made;
  }

  /* Paper has more pixels than a screen: a chart for paper is drawn larger and shown smaller. */
  function sharpness() { return printing ? 2 : 1; }

  function font(size) { return size * sharpness() + "px system-ui, sans-serif"; }

  function axis(label, side) {
    var k = sharpness();
    var made = {
      stroke: colour("muted"), font: font(11), ticks: { stroke: colour("rule"), width: k, size: 4 * k },
      grid: { stroke: colour("grid"), width: k }, gap: 4 * k
    };
    if (side === "y") Object.assign(made, { size: widest, space: 28 * k });
    else Object.assign(made, { size: 24 * k, space: 56 * k });
    if (label) Object.assign(made, { label: label, labelSize: 18 * k, labelFont: font(12), labelGap: 0 });
    made.values = function (plot, marks) {
      return marks.map(function (value) { return value == null ? "" : String(Number(value.toPrecision(6))).replace("-", "−"); });
    };
    return made;
  }

  /* Width of the vertical axis: that of its longest label. */
  function widest(plot, labels, index, cycle) {
    var axis = plot.axes[index];
    if (cycle > 1) return axis._size;
    var longest = (labels || []).reduce(function (a, b) { return b.length > a.length ? b : a; }, "");
    plot.ctx.font = axis.font[0];
    return Math.max(Math.ceil(plot.ctx.measureText(longest).width / devicePixelRatio) + 12 * sharpness(), 44 * sharpness());
  }

  /* Title and key; the readings follow the cursor. */
  function heading(title, series, time) {
    var head = element("div", "panelhead");
    if (title) head.append(element("span", "title", title));
    var values = series.map(function (one) {
      if (!one.label) return null;
      var item = element("span", "reading"), value = element("span", "num", "");
      item.append(element("span", "swatch " + one.kind + (one.mark === "dashed" ? " dashed" : "")), one.label + " ", value);
      head.append(item);
      return value;
    });
    var clock = element("span", "reading num", "");
    head.append(clock);
    return { head: head, show: function (at, read) {
      values.forEach(function (value, i) { if (value) value.textContent = at == null ? "" : digits(read(i)); });
      clock.textContent = at == null ? "" : "at " + digits(at) + time;
    } };
  }

  /* ---------------------------------------------------------------- charts */

  var charts = Array.from(document.querySelectorAll(".chart"), function (block) {
    var chart = { block: block, spec: JSON.parse(block.firstElementChild.textContent), plot: null };
    block.style.minHeight = chart.spec.height + 24 + "px";
    return chart;
  });

  var MARKS = {
    line: function (k) { return { width: 1.8 * k, points: { show: false } }; },
    thin: function (k) { return { width: 1.1 * k, points: { show: false } }; },
    dashed: function (k) { return { width: 1.6 * k, dash: [6 * k, 4 * k], points: { show: false } }; },
    dots: function (k) { return { paths: function () { return null; }, points: { show: true, size: 3 * k, width: 0 } }; },
    few: function (k) { return { paths: function () { return null; }, points: { show: true, size: 5.5 * k, width: 0 } }; },
    stems: function (k) { return { paths: uPlot.paths.bars({ size: [0.5, 5 * k] }), width: 0, points: { show: false } }; },
    bars: function (k) { return { paths: uPlot.paths.bars({ size: [1, Infinity] }), width: 0, points: { show: false }, scale: "share" }; }
  };

  function drawn(line) {
    var made = MARKS[line.mark](sharpness()), tint = colour(line.kind);
    var isSolid = line.mark === "stems" || line.mark === "bars";
    Object.assign(made, { label: line.label, stroke: tint });
    if (isSolid) made.fill = line.mark === "bars" ? tint + "66" : tint;
    if (line.mark === "dots" || line.mark === "few") made.points.fill = tint + "b0";
    return made;
  }

  /* One table over all abscissae: two hidden series for each band, then the lines. */
  function table(spec) {
    var parts = [], series = [{}], bands = [];
    spec.bands.forEach(function (band) {
      var hidden = { stroke: "transparent", width: 0, points: { show: false } };
      parts.push([band.x, band.high, band.low]);
      bands.push({ series: [series.length, series.length + 1], fill: colour(band.kind) + "38" });
      series.push(Object.assign({}, hidden), Object.assign({}, hidden));
    });
    spec.lines.forEach(function (line) {
      parts.push([line.x, line.y]);
      series.push(drawn(line));
    });
    return { data: joined(parts), series: series, bands: bands };
  }

  /* uPlot.join keeps one value for each abscissa; repeated ones, as of dots, need the simple form. */
  function joined(parts) {
    var rows = [];
    parts.forEach(function (part, p) {
      part[0].forEach(function (x, i) { if (x !== null) rows.push([x, p, i]); });
    });
    rows.sort(function (a, b) { return a[0] - b[0]; });
    var columns = parts.map(function (part) { return part.slice(1).map(function () { return []; }); });
    var abscissa = [], last = {};
    rows.forEach(function (row) {
      var at = abscissa.length - 1;
      if (at < 0 || abscissa[at] !== row[0] || last[row[1]] === at) abscissa[++at] = row[0];
      last[row[1]] = at;
      columns[row[1]].forEach(function (column, c) { column[at] = parts[row[1]][c + 1][row[2]]; });
    });
    var flat = [].concat.apply([], columns);
    flat.forEach(function (column) { column.length = abscissa.length; });
    return [abscissa].concat(flat);
  }

  function drawChart(chart, width) {
    var spec = chart.spec, k = sharpness();
    if (chart.plot) chart.plot.destroy();
    if (chart.head) chart.head.remove();
    var made = table(spec);
    var first = spec.bands.length * 2 + 1;
    var key = heading("", spec.lines, "");
    chart.head = key.head;
    chart.head.setAttribute("aria-hidden", "true");
    chart.block.append(key.head);
    chart.plot = new uPlot({
      width: width * k, height: spec.height * k, legend: { show: false }, padding: [8 * k, 10 * k, 0, 0],
      scales: { x: { time: false }, y: spec.range ? { range: fixed(spec.range) } : {}, share: { range: [0, 7] } },
      cursor: { drag: { x: true, y: false }, points: { size: 6 } },
      axes: [axis(spec.x, "x"), axis(spec.y, "y")], series: made.series, bands: made.bands,
      hooks: { setCursor: [function (plot) {
        var at = plot.cursor.idx;
        key.show(at == null ? null : plot.data[0][at], function (i) { return plot.data[first + i][at]; });
      }] }
    }, made.data, chart.block);
    chart.plot.root.style.zoom = 1 / k;
    chart.block.style.minHeight = "";
    chart.width = width;
  }

  function fixed(range) { return function () { return range; }; }

  function fill(chart) {
    var width = chart.block.clientWidth;
    if (width > 0) drawChart(chart, width);
  }

  var sight = new IntersectionObserver(function (entries) {
    entries.forEach(function (entry) {
      var chart = charts.find(function (one) { return one.block === entry.target; });
      if (entry.isIntersecting && !chart.plot) fill(chart);
    });
  }, { rootMargin: "400px" });

  /* ---------------------------------------------------------------- runs */

  var runs = Array.from(document.querySelectorAll("script.run"), function (block) {
    return { block: block, spec: null, columns: null };
  });
  var place = document.getElementById("panels");
  var shown = null;
  var THINNING = 16;

  async function inflated(text) {
    var raw = atob(text), packed = new Uint8Array(raw.length);
    for (var i = 0; i < raw.length; i++) packed[i] = raw.charCodeAt(i);
    var stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  /* The inverse of `encoded` in columns.py. */
  async function column(packed, Kind) {
    var planes = await inflated(packed.data), size = planes.length / 4, words = new Int32Array(size), i;
    for (i = 0; i < size; i++) {
      var zigzag = planes[i] | planes[i + size] << 8 | planes[i + 2 * size] << 16 | planes[i + 3 * size] << 24;
      words[i] = zigzag >>> 1 ^ -(zigzag & 1);
    }
    for (var turn = 0; turn < packed.order; turn++) {
      for (i = 1; i < size; i++) words[i] += words[i - 1];
    }
    var values = new Kind(size);
    for (i = 0; i < size; i++) values[i] = packed.low + packed.step * words[i];
    for (var m = 0; m < packed.missing.length; m += 2) {
      values.fill(NaN, packed.missing[m], packed.missing[m] + packed.missing[m + 1]);
    }
    return values;
  }

  async function decoded(run) {
    if (run.columns) return run;
    run.spec = run.spec || JSON.parse(run.block.textContent);
    var names = Object.keys(run.spec.columns), columns = {};
    var all = await Promise.all(names.map(function (name) {
      return column(run.spec.columns[name], name === "time" ? Float64Array : Float32Array);
    }));
    names.forEach(function (name, i) { columns[name] = all[i]; });
    names.forEach(function (name) {
      var other = columns[run.spec.columns[name].plus], values = columns[name];
      if (other) for (var i = 0; i < values.length; i++) values[i] += other[i];
    });
    run.columns = columns;
    run.spec.panels.forEach(function (panel) {
      panel.values = panel.series.map(function (one) {
        var minuend = columns[one.column], other = columns[one.minus];
        return other ? minuend.map(function (value, i) { return value - other[i]; }) : minuend;
      });
      panel.coarse = thinned(columns.time, panel.values);
    });
    return run;
  }

  /* Time and channels with the extremes of every 16 samples, which are those of many more. */
  function thinned(time, channels) {
    var made = rows(time, channels, time[0], time[time.length - 1], Math.ceil(time.length / THINNING));
    return [Float64Array.from(made[0])].concat(made.slice(1).map(function (values) {
      return Float32Array.from(values, function (v) { return v === null ? NaN : v; });
    }));
  }

  /* First index whose time is not before the given one. */
  function index(time, value) {
    var low = 0, high = time.length;
    while (low < high) {
      var middle = low + high >> 1;
      if (time[middle] < value) low = middle + 1; else high = middle;
    }
    return low;
  }

  /* Rows of the samples between two times: extremes while there are more samples than pixels. */
  function rows(time, channels, from, to, pixels) {
    var first = Math.max(index(time, from) - 1, 0), end = Math.min(index(time, to) + 2, time.length);
    var count = end - first, i;
    if (count <= 2 * pixels) {
      return [Array.from(time.subarray(first, end))].concat(channels.map(function (values) {
        return Array.from(values.subarray(first, end), function (v) { return isFinite(v) ? v : null; });
      }));
    }
    var made = [new Array(2 * pixels)].concat(channels.map(function () { return new Array(2 * pixels); }));
    for (var b = 0; b < pixels; b++) {
      var start = first + Math.floor(count * b / pixels), stop = first + Math.floor(count * (b + 1) / pixels);
      made[0][2 * b] = time[start];
      made[0][2 * b + 1] = (time[start] + time[stop - 1]) / 2;
      for (var c = 0; c < channels.length; c++) {
        var values = channels[c], low = Infinity, high = -Infinity, atLow = start, atHigh = start;
        for (i = start; i < stop; i++) {
          var v = values[i];
          if (v < low) { low = v; atLow = i; }
          if (v > high) { high = v; atHigh = i; }
        }
        var known = low <= high;
        made[c + 1][2 * b] = known ? (atLow <= atHigh ? low : high) : null;
        made[c + 1][2 * b + 1] = known ? (atLow <= atHigh ? high : low) : null;
      }
    }
    return made;
  }

  function noiseLines(panel) {
    return function (plot) {
      if (!panel.noise) return;
      var pen = plot.ctx, box = plot.bbox;
      pen.save();
      pen.strokeStyle = colour("muted");
      pen.lineWidth = devicePixelRatio * sharpness();
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

  /* All panels of one run over one time axis. */
  function View(run, target, width) {
    var view = this;
    view.run = run;
    view.time = run.columns.time;
    view.range = [view.time[0], view.time[view.time.length - 1]];
    if (!(view.range[1] > view.range[0])) view.range[1] = view.range[0] + 1;
    view.plots = run.spec.panels.map(function (panel, i) {
      return view.panel(panel, target, width, i === run.spec.panels.length - 1);
    });
    view.show(view.range[0], view.range[1]);
  }

  View.prototype.panel = function (panel, target, width, isLast) {
    var view = this, k = sharpness(), block = element("div", "panel");
    var key = heading(panel.label, panel.series, " s");
    block.append(key.head);
    target.append(block);
    var blank = axis("", "x");
    Object.assign(blank, { size: 6 * k, ticks: { show: false }, values: function () { return []; } });
    var plot = new uPlot({
      width: width * k, height: ((panel.tall ? 180 : 100) + (isLast ? 42 : 6)) * k,
      legend: { show: false }, padding: [6 * k, 8 * k, 0, 0], scales: { x: { time: false, auto: false } },
      cursor: {
        drag: { x: true, y: false, setScale: false }, points: { size: 6 },
        bind: { dblclick: function () { return function () { view.show(view.range[0], view.range[1]); return null; }; } },
        sync: { key: "run", scales: ["x", null], filters: { pub: function (type) {
          return type === "mousemove" || type === "mouseleave";
        } } }
      },
      axes: [isLast ? axis("time [s]", "x") : blank,
             Object.assign(axis("", "y"), { size: 58 * k })],
      series: [{}].concat(panel.series.map(function (one) {
        return { stroke: colour(one.kind), width: k, spanGaps: false };
      })),
      hooks: {
        draw: [noiseLines(panel)],
        setCursor: [function (plot) {
          var left = plot.cursor.left, at = left == null || left < 0 ? null : plot.posToVal(left, "x");
          if (at === null) return key.show(null);
          var near = Math.min(index(view.time, at), view.time.length - 1);
          if (near > 0 && at - view.time[near - 1] < view.time[near] - at) near--;
          key.show(view.time[near], function (i) { return panel.values[i][near]; });
        }],
        setSelect: [function (plot) {
          var box = plot.select;
          if (box.width < 4) return;
          var from = plot.posToVal(box.left, "x"), to = plot.posToVal(box.left + box.width, "x");
          plot.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
          view.show(from, to);
        }]
      }
    }, [[]].concat(panel.series.map(function () { return []; })), block);
    plot.root.style.zoom = 1 / k;
    plot.root.setAttribute("aria-hidden", "true");
    return plot;
  };

  View.prototype.show = function (from, to) {
    var view = this;
    view.seen = [from, to];
    view.plots.forEach(function (plot, i) {
      var pixels = Math.max(Math.floor(plot.bbox.width / devicePixelRatio), 50);
      var panel = view.run.spec.panels[i], count = index(view.time, to) - index(view.time, from);
      var isWide = count > 4 * THINNING * pixels;
      var data = isWide ? rows(panel.coarse[0], panel.coarse.slice(1), from, to, pixels)
        : rows(view.time, panel.values, from, to, pixels);
      /* A browser draws lines of one pixel ten times as fast as wider ones. */
      var isDense = data[0].length > pixels;
      panel.series.forEach(function (one, s) {
        plot.series[s + 1].width = (isDense ? 1 : one.kind === "trace" ? 3 : 1.4) * sharpness();
      });
      plot.batch(function () {
        plot.setData(data, false);
        plot.setScale("x", { min: from, max: to });
      });
    });
  };

  View.prototype.zoom = function (how) {
    var whole = this.range[1] - this.range[0], width = this.seen[1] - this.seen[0];
    var middle = (this.seen[0] + this.seen[1]) / 2;
    if (how === "in") width = Math.max(width / 2, 1e-9 * whole);
    if (how === "out") width = width * 2;
    if (how === "earlier") middle -= width / 2;
    if (how === "later") middle += width / 2;
    width = how === "all" ? whole : Math.min(width, whole);
    middle = Math.min(Math.max(middle, this.range[0] + width / 2), this.range[1] - width / 2);
    this.show(middle - width / 2, middle + width / 2);
  };

  View.prototype.destroy = function () {
    this.plots.forEach(function (plot) { plot.destroy(); });
  };

  function title(run) { return run.spec.name + " (" + run.spec.role + ")"; }

  function present(run) {
    if (shown) shown.destroy();
    place.replaceChildren();
    document.getElementById("detail-title").textContent = title(run);
    document.getElementById("detail-note").textContent = run.spec.note;
    shown = new View(run, place, place.clientWidth);
  }

  async function choose(number) {
    document.querySelectorAll("[data-run]").forEach(function (button) {
      button.setAttribute("aria-pressed", String(Number(button.dataset.run) === number));
    });
    document.getElementById("detail").hidden = false;
    try {
      present(await decoded(runs[number]));
    } catch (error) {
      place.textContent = "This browser cannot decode the samples (" + error.message + "); use a current one.";
    }
  }

  document.querySelectorAll("[data-run]").forEach(function (button) {
    button.addEventListener("click", function () { choose(Number(button.dataset.run)); });
  });
  document.querySelectorAll("[data-zoom]").forEach(function (button) {
    button.addEventListener("click", function () { if (shown) shown.zoom(button.dataset.zoom); });
  });

  /* ---------------------------------------------------------------- theme, size and paper */

  function redraw() {
    charts.forEach(function (chart) { if (chart.plot) fill(chart); });
    if (!shown) return;
    var seen = shown.seen;
    present(shown.run);
    shown.show(seen[0], seen[1]);
  }

  var dark = matchMedia("(prefers-color-scheme: dark)");
  var theme = document.getElementById("theme");
  theme.hidden = false;
  theme.addEventListener("click", function () {
    var isDark = root.dataset.theme ? root.dataset.theme === "dark" : dark.matches;
    root.dataset.theme = isDark ? "light" : "dark";
    redraw();
  });
  dark.addEventListener("change", redraw);

  var PAPER = 680;
  var sheets = document.getElementById("sheets");
  var views = [];
  var before = null;

  addEventListener("beforeprint", function () {
    if (printing) return;
    printing = true;
    before = root.dataset.theme;
    root.dataset.theme = "light";
    root.classList.add("paper");
    charts.forEach(function (chart) {
      drawChart(chart, chart.block.closest(".pair, .first") ? PAPER / 2 - 16 : PAPER);
    });
    views = runs.filter(function (run) { return run.columns; }).map(function (run) {
      sheets.append(element("h3", "", title(run)), element("p", "muted small", run.spec.note));
      return new View(run, sheets, PAPER);
    });
  });

  addEventListener("afterprint", function () {
    printing = false;
    views.forEach(function (view) { view.destroy(); });
    views = [];
    sheets.replaceChildren();
    root.classList.remove("paper");
    if (before) root.dataset.theme = before; else delete root.dataset.theme;
    redraw();
  });

  new ResizeObserver(function () {
    if (printing) return;
    charts.forEach(function (chart) {
      if (chart.plot && chart.block.clientWidth !== chart.width) fill(chart);
    });
    if (shown && place.clientWidth > 0 && place.clientWidth !== shown.plots[0].width) {
      shown.plots.forEach(function (plot) { plot.setSize({ width: place.clientWidth, height: plot.height }); });
      shown.show(shown.seen[0], shown.seen[1]);
    }
  }).observe(document.getElementById("content"));

  /* The address has ?help where the service that sends the report has the documentation, too. */
  if (new URLSearchParams(location.search).has("help")) {
    document.querySelectorAll(".warnings .code").forEach(function (code) {
      var link = element("a", "");
      link.href = "/help/troubleshooting.html#" + code.textContent;
      link.target = "_blank";
      link.rel = "noopener";
      code.replaceWith(link);
      link.append(code);
    });
  }

  charts.forEach(function (chart) { sight.observe(chart.block); });
  (async function () {
    if (!runs.length) return;
    var first = runs.findIndex(function (run) { return run.block.dataset.role === "validation"; });
    await choose(Math.max(first, 0));
    /* The browser compiles on the second drawing what the first zoom would otherwise wait for. */
    await new Promise(function (done) { setTimeout(done); });
    if (shown) shown.show(shown.seen[0], shown.seen[1]);
    /* The other runs are decoded after the first is drawn, so that they can be printed. */
    for (var run of runs) {
      await new Promise(function (done) { setTimeout(done); });
      await decoded(run).catch(function () {});
    }
    root.dataset.ready = "";
  })();
})();
