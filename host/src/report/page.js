// Draws the page from the data inside it; computes nothing that is shown as a number.
"use strict";
(() => {
  const COLOURS = { measured: "#333c48", before: "#d55e00", after: "#0072b2" };
  const HELD_OUT = "rgba(86, 96, 110, 0.10)";
  const REGION = "rgba(230, 171, 2, 0.22)";
  const drawn = [];

  function element(parent, tag, className, text) {
    const node = document.createElement(tag);
    if (className) node.className = className;
    if (text !== undefined) node.textContent = text;
    parent.append(node);
    return node;
  }

  function head(parent, page) {
    const header = element(parent, "header");
    element(header, "h1", "", page.title);
    if (page.verdict) {
      const verdict = element(header, "div", "verdict");
      element(verdict, "span", "badge " + page.verdict.word, page.verdict.word);
      element(verdict, "p", "", page.verdict.text);
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
  }

  const ITEMS = {
    heading: (parent, item) => element(parent, "h3", "", item.text),
    text: (parent, item) => element(parent, "p", "", item.text),
    list: (parent, item) => {
      const list = element(parent, "ul");
      item.points.forEach((point) => element(list, "li", "", point));
    },
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

  // Shades the bands below the series and writes their labels.
  function bands(u, plot) {
    const { left, top, width, height } = u.bbox;
    const pixels = uPlot.pxRatio;
    for (const band of plot.bands) {
      const from = Math.max(left, u.valToPos(band.from, "x", true));
      const to = Math.min(left + width, u.valToPos(band.to, "x", true));
      if (to < left || from > left + width) continue;
      u.ctx.save();
      u.ctx.fillStyle = band.held_out ? HELD_OUT : REGION;
      u.ctx.fillRect(from, top, Math.max(to - from, pixels), height);
      if (band.label && to - from > 60 * pixels) {
        u.ctx.fillStyle = "#56606e";
        u.ctx.font = 12 * pixels + "px system-ui, sans-serif";
        u.ctx.textAlign = "right";
        u.ctx.textBaseline = "top";
        u.ctx.fillText(band.label, to - 6 * pixels, top + 4 * pixels);
      }
      u.ctx.restore();
    }
  }

  // Bars of the series that have them.
  function bars(u, plot) {
    const pixels = uPlot.pxRatio;
    plot.series.forEach((series, k) => {
      if (series.style !== "bars" || !u.series[k + 1].show) return;
      u.ctx.save();
      u.ctx.beginPath();
      u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
      u.ctx.clip();
      u.ctx.strokeStyle = COLOURS[series.role];
      u.ctx.lineWidth = 1.2 * pixels;
      u.ctx.beginPath();
      series.y.forEach((y, i) => {
        if (y === null) return;
        const x = u.valToPos(plot.x[i], "x", true);
        u.ctx.moveTo(x, u.valToPos(y - series.bar[i], "y", true));
        u.ctx.lineTo(x, u.valToPos(y + series.bar[i], "y", true));
      });
      u.ctx.stroke();
      u.ctx.restore();
    });
  }

  function seriesOptions(series) {
    const colour = COLOURS[series.role];
    const options = { label: series.label, stroke: colour, value: (u, v) => (v == null ? "" : v.toPrecision(4)) };
    if (series.style === "line") {
      const dash = series.role === "before" ? [6, 3] : undefined;
      return { ...options, width: series.role === "measured" ? 2 : 1.5, dash, spanGaps: true, points: { show: false } };
    }
    const big = series.style === "bars";
    const faint = series.role === "measured" && !big ? "40" : "80";
    const fill = big ? colour : colour + faint;
    return { ...options, paths: () => null, points: { show: true, size: big ? 7 : 4, width: 0, stroke: fill, fill } };
  }

  // The ordinate: all of the data in view with a margin, within the limit of the plot.
  function ordinate(limit) {
    return (u, low, high) => {
      if (low === null || high === null) return [0, 1];
      if (limit) {
        low = Math.min(Math.max(low, limit[0]), limit[1]);
        high = Math.max(Math.min(high, limit[1]), limit[0]);
      }
      const margin = 0.06 * (high - low) || 1e-12 + 0.1 * Math.abs(high);
      return [low - margin, high + margin];
    };
  }

  function draw(parent, plot) {
    const figure = element(parent, "figure");
    element(figure, "figcaption", "", plot.title);
    const place = element(figure, "div");
    if (plot.caption) element(figure, "p", "note", plot.caption);
    const axis = { stroke: "#3a4350", grid: { stroke: "#e6e9ee", width: 1 }, ticks: { stroke: "#c3cad3", width: 1 } };
    const x = { time: false };
    if (plot.x.length > 1) x.range = (u, low, high) => [low, high];
    const options = {
      width: Math.max(place.clientWidth, 200),
      height: plot.height,
      scales: { x, y: { range: ordinate(plot.limit) } },
      axes: [
        { ...axis, label: plot.x_label, labelSize: 22, size: 34 },
        { ...axis, label: plot.y_label, labelSize: 22, size: 62 },
      ],
      series: [{ label: plot.x_label }, ...plot.series.map(seriesOptions)],
      cursor: { drag: { x: true, y: false }, ...(plot.group ? { sync: { key: plot.group } } : {}) },
      hooks: { drawClear: [(u) => bands(u, plot)], draw: [(u) => bars(u, plot)] },
    };
    const chart = new uPlot(options, [plot.x, ...plot.series.map((s) => s.y)], place);
    drawn.push({ chart, place, height: plot.height });
  }

  function fit(paper) {
    for (const { chart, place, height } of drawn) {
      const two = place.closest(".two") !== null;
      const width = paper ? (two ? paper / 2 - 9 : paper) : place.clientWidth;
      const tall = paper ? Math.round(0.72 * height) : height;
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
