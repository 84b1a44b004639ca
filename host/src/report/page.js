// Draws the page from the data inside it; computes nothing that is shown as a number.
"use strict";
(() => {
  // Okabe and Ito's vermilion and blue: told apart by all common kinds of colour vision, and in grey by their dash.
  const COLOURS = { measured: "#333c48", before: "#d55e00", after: "#0072b2" };
  const HELD_OUT = "rgba(86, 96, 110, 0.11)";
  const REGION = "rgba(230, 171, 2, 0.22)";
  // uPlot scales the width of lines for dense screens, but not their dashes.
  const DASH = [6, 3].map((length) => length * uPlot.pxRatio);
  const drawn = [];

  function element(parent, tag, className, text) {
    const node = document.createElement(tag);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    parent.append(node);
    return node;
  }

  function list(parent, points) {
    const node = element(parent, "ul");
    points.forEach((point) => element(node, "li", "", point));
  }

  function head(parent, page) {
    const header = element(parent, "header");
    element(header, "h1", "", page.title);
    if (page.verdict) {
      const verdict = element(header, "div", "verdict");
      element(verdict, "span", "badge " + page.verdict.word, page.verdict.word);
      element(verdict, "p", "", page.verdict.text);
      if (page.verdict.points.length) list(header, page.verdict.points);
    }
    if (page.warnings.length) {
      const warnings = element(header, "div", "warnings");
      element(warnings, "p", "", "Before the numbers are trusted:");
      list(warnings, page.warnings);
    }
    const facts = element(header, "dl", "facts");
    for (const [what, value] of page.facts) {
      element(facts, "dt", "", what);
      element(facts, "dd", "", value);
    }
    const figures = element(header, "div", "figures");
    for (const figure of page.figures) {
      const box = element(figures, "div", "figure");
      element(box, "div", "label", figure.label);
      if (figure.before !== null) element(box, "div", "before", "before: " + figure.before);
      element(box, "div", "after", figure.after);
      element(box, "div", "note", figure.note);
    }
    element(header, "p", "note", page.figures_note);
    element(header, "p", "note screen", "Plots: drag across one to zoom in, double-click it to see all again; click a name in its key to hide that series.");
  }

  const ITEMS = {
    heading: (parent, item) => element(parent, "h3", "", item.text),
    text: (parent, item) => element(parent, "p", "", item.text),
    list: (parent, item) => list(parent, item.points),
    table: (parent, item) => {
      const table = element(element(parent, "div", "table"), "table");
      const top = element(element(table, "thead"), "tr");
      item.columns.forEach((text) => element(top, "th", "", text));
      const body = element(table, "tbody");
      for (const row of item.rows) {
        const line = element(body, "tr");
        row.forEach((text) => element(line, "td", "", text));
      }
    },
    plots: (parent, item) => {
      const row = element(parent, "div", item.plots.length > 1 ? "plots two" : "plots");
      item.plots.forEach((plot) => draw(row, plot));
    },
  };

  function within(u, paint) {
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    paint(u.ctx, uPlot.pxRatio);
    u.ctx.restore();
  }

  // Shades the bands below the grid and the series.
  function bands(u, plot) {
    within(u, (ctx, pixels) => {
      for (const band of plot.bands) {
        const [from, to] = [u.valToPos(band.from, "x", true), u.valToPos(band.to, "x", true)];
        ctx.fillStyle = band.held_out ? HELD_OUT : REGION;
        ctx.fillRect(from, u.bbox.top, Math.max(to - from, pixels), u.bbox.height);
      }
    });
  }

  // The line of zero, and the instants of restarts.
  function rulers(u, plot) {
    within(u, (ctx, pixels) => {
      const { left, top, width, height } = u.bbox;
      const zero = u.valToPos(0, "y", true);
      ctx.fillStyle = "#aab3be";
      ctx.fillRect(left, Math.round(zero), width, pixels);
      ctx.strokeStyle = "#7a8592";
      ctx.lineWidth = pixels;
      ctx.setLineDash([2 * pixels, 3 * pixels]);
      ctx.beginPath();
      for (const mark of plot.marks) {
        const x = u.valToPos(mark, "x", true);
        ctx.moveTo(x, top);
        ctx.lineTo(x, top + height);
      }
      ctx.stroke();
    });
  }

  // Bars of the series that have them.
  function bars(u, plot) {
    plot.series.forEach((series, k) => {
      if (series.style !== "bars" || !u.series[k + 1].show) return;
      within(u, (ctx, pixels) => {
        ctx.strokeStyle = COLOURS[series.role];
        ctx.lineWidth = 1.2 * pixels;
        ctx.beginPath();
        series.y.forEach((y, i) => {
          if (y === null) return;
          const x = u.valToPos(plot.x[i], "x", true);
          ctx.moveTo(x, u.valToPos(y - series.bar[i], "y", true));
          ctx.lineTo(x, u.valToPos(y + series.bar[i], "y", true));
        });
        ctx.stroke();
      });
    });
  }

  function seriesOptions(series) {
    const colour = COLOURS[series.role];
    if (series.style === "line") {
      const dash = series.role === "before" ? DASH : undefined;
      const width = series.role === "measured" ? 2 : 1.6;
      return { label: series.label, stroke: colour, width, dash, spanGaps: true, points: { show: false } };
    }
    const big = series.style === "bars";
    const fill = big ? colour : colour + (series.role === "measured" ? "48" : "68");
    return { label: series.label, stroke: colour, paths: () => null, points: { show: true, size: big ? 7 : 4.5, width: 0, stroke: fill, fill } };
  }

  // The ordinate: all of the data in view, and all bars, with a margin, within the limit of the plot.
  function ordinate({ limit, series }) {
    const ends = series.flatMap((s) => s.bar.flatMap((bar, i) => (s.y[i] === null || bar === null ? [] : [s.y[i] - bar, s.y[i] + bar])));
    return (u, low, high) => {
      if (low === null || high === null) return [0, 1];
      low = Math.min(low, ...ends);
      high = Math.max(high, ...ends);
      if (limit) {
        low = Math.min(Math.max(low, limit[0]), limit[1]);
        high = Math.max(Math.min(high, limit[1]), limit[0]);
      }
      const margin = 0.06 * (high - low) || 1e-12 + 0.1 * Math.abs(high);
      return [low - margin, high + margin];
    };
  }

  const plain = (value) => String(Number(value.toPrecision(12))).replace("-", "−");

  // Names what is drawn, in the way it is drawn; a click hides a series.
  function key(parent, plot, toggle) {
    const node = element(parent, "div", "key");
    plot.series.forEach((series, k) => {
      const name = element(node, "button");
      name.type = "button";
      element(name, "span", `sign ${series.role} ${series.style}`);
      name.append(series.label);
      name.addEventListener("click", () => name.classList.toggle("off", !toggle(k + 1)));
    });
    const shaded = new Map(plot.bands.map((band) => [band.label, band]));
    for (const [label, band] of shaded) {
      const name = element(node, "span");
      element(name, "span", "sign " + (band.held_out ? "held" : "region"));
      name.append(label);
    }
  }

  // The values under the cursor.
  function readout(u, plot) {
    const index = u.cursor.idx;
    if (index === null || index === undefined) return "";
    const number = (value) => plain(Number(value.toPrecision(4)));
    const values = plot.series.map((series) => {
      const y = series.y[index];
      return y === null ? "" : ` · ${series.label} ${number(y)}`;
    });
    const [name, unit] = plot.x_label.replace("]", "").split(" [");
    return `${name} ${plain(plot.x[index])} ${unit}${values.join("")} ${plot.y_label.match(/\[.*\]/)}`;
  }

  function draw(parent, plot) {
    const figure = element(parent, "figure");
    const caption = element(figure, "figcaption");
    element(caption, "span", "", plot.title);
    const values = element(caption, "span", "values screen", "");
    key(figure, plot, (k) => {
      chart.setSeries(k, { show: !chart.series[k].show });
      return chart.series[k].show;
    });
    const place = element(figure, "div");
    if (plot.caption) element(figure, "p", "note", plot.caption);
    const axis = {
      stroke: "#3a4350",
      grid: { stroke: "#e6e9ee", width: 1 },
      ticks: { stroke: "#c3cad3", width: 1, size: 6 },
      values: (u, splits) => splits.map((v) => (v === null ? "" : plain(v))),
    };
    const x = { time: false };
    const dots = plot.series.some((series) => series.style !== "line");
    if (plot.x.length > 1) {
      // Dots on the very edge stay whole.
      x.range = (u, low, high) => (dots ? [low - 0.01 * (high - low), high + 0.01 * (high - low)] : [low, high]);
    }
    const options = {
      width: Math.max(place.clientWidth, 200),
      height: plot.height,
      legend: { show: false },
      scales: { x, y: { range: ordinate(plot) } },
      axes: [
        { ...axis, space: Math.abs(plot.x[0]) < 1e5 ? 50 : 90, label: plot.x_label, labelSize: 18, labelGap: 0, size: 30 },
        { ...axis, label: plot.y_label, labelSize: 20, size: 56 },
      ],
      series: [{}, ...plot.series.map(seriesOptions)],
      cursor: { drag: { x: true, y: false }, points: { show: !dots }, ...(plot.group ? { sync: { key: plot.group } } : {}) },
      hooks: {
        drawClear: [(u) => bands(u, plot)],
        drawAxes: [(u) => rulers(u, plot)],
        draw: [(u) => bars(u, plot)],
        setCursor: [(u) => { values.textContent = readout(u, plot); }],
      },
    };
    const chart = new uPlot(options, [plot.x, ...plot.series.map((s) => s.y)], place);
    drawn.push({ chart, place, height: plot.height });
  }

  // Gives every plot its width: the page's, or that of a sheet of paper in CSS pixels.
  function fit(paper) {
    for (const { chart, place, height } of drawn) {
      const two = place.closest(".two") !== null;
      const width = paper ? (two ? paper / 2 - 9 : paper) : place.clientWidth;
      const tall = paper ? Math.round(0.75 * height) : height;
      if (width > 0 && (chart.width !== width || chart.height !== tall)) chart.setSize({ width, height: tall });
    }
  }

  const page = JSON.parse(document.getElementById("data").textContent);
  const main = document.getElementById("page");
  main.replaceChildren();
  head(main, page);
  for (const section of page.sections) {
    const node = element(main, "section");
    element(node, "h2", "", section.title);
    section.items.forEach((item) => ITEMS[item.kind](node, item));
  }
  fit();
  let printing = false;
  new ResizeObserver(() => printing || fit()).observe(main);
  // An A4 page less its margins is 182 mm wide, 688 CSS pixels.
  addEventListener("beforeprint", () => { printing = true; fit(686); });
  addEventListener("afterprint", () => { printing = false; fit(); });
})();
