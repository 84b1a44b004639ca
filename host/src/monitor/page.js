"use strict";
// Draws what the monitor sends, and asks for what a person wants. It decides nothing: limits, ramps and the order of
// things are the monitor's and the board's.

const $ = (id) => document.getElementById(id);
const make = (tag, properties = {}, ...children) => {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
};

const COLOURS = { input: "#d55e00", position: "#0072b2", velocity: "#00735c", current: "#8e3a80", bus: "#56606e", error: "#c1121f", friction: "#b37400", coulomb: "#333c48" };
const SHOWN = new Set(["position", "velocity", "input", "coulomb"]);
const MODES = ["off", "input", "torque", "velocity", "position"];
const WINDOWS = [2, 10, 60];
// The monitor speaks twenty times a second.
const SILENT = 600;

let about = null;
let seconds = 10;
let frozen = false;
let mode = "velocity";
let status = null;
let heard = performance.now();
let ended = false;

// --- samples ---------------------------------------------------------------------------------------------------

// Twice what is kept, so that the older half is dropped seldom.
const ROOM = 131072;
const KEPT = 61000;
const times = new Float64Array(ROOM);
let columns = [];
let fresh = false;
let length = 0;

function take(periods, values) {
  if (!about || periods.length === 0) return;
  if (length + periods.length > ROOM) {
    const from = Math.max(0, length - KEPT);
    times.copyWithin(0, from, length);
    for (const column of columns) column.copyWithin(0, from, length);
    length -= from;
  }
  for (let k = 0; k < periods.length; k += 1) {
    const t = periods[k] / about.rate;
    // A board that has restarted counts anew.
    if (length > 0 && t <= times[length - 1]) length = 0;
    times[length] = t;
    for (let s = 0; s < columns.length; s += 1) columns[s][length] = values[s][k] ?? NaN;
    length += 1;
  }
  fresh = true;
}

// The first sample of the window.
function first() {
  const from = times[length - 1] - seconds;
  let [low, high] = [0, length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] < from) low = middle + 1;
    else high = middle;
  }
  return Math.max(0, low - 1);
}

// --- plots -----------------------------------------------------------------------------------------------------

let plots = [];

function arrange() {
  for (const plot of plots) {
    plot.chart.destroy();
    plot.box.remove();
  }
  const shown = about.signals.map((signal, k) => ({ signal, k })).filter(({ signal }) => SHOWN.has(signal.id));
  fresh = true;
  plots = shown.map(({ signal, k }, row) => {
    const now = make("output");
    const box = make("div", { className: "plot" }, make("h3", {}, make("span", { textContent: label(signal) }), now));
    $("plots").append(box);
    const last = row === shown.length - 1;
    const axis = { stroke: "#56606e", grid: { stroke: "#e8ecf0", width: 1 }, ticks: { stroke: "#d9dee5", width: 1 }, font: "11px system-ui, sans-serif" };
    const chart = new uPlot({
      width: Math.max(200, $("plots").clientWidth - 30),
      height: tall(shown.length) + (last ? LABELS : 0),
      legend: { show: false },
      cursor: { sync: { key: "monitor" }, drag: { x: false, y: false } },
      scales: { x: { time: false, range: () => span() }, y: { range: (_, low, high) => padded(low, high) } },
      series: [{}, { stroke: COLOURS[signal.id], width: 1.4, points: { show: false } }],
      axes: [{ ...axis, size: last ? 38 : 18, labelSize: 14, values: last ? undefined : (_, ticks) => ticks.map(() => ""), label: last ? "time of the board, s" : undefined, labelFont: axis.font }, { ...axis, size: 62 }],
    }, [[], []], box);
    return { chart, k, now, signal, box };
  });
}

// The plots share the height of the window, but none is too flat to read.
const tall = (count) => Math.max(110, (innerHeight - 190) / count - 34);
const LABELS = 20;

function span() {
  if (length === 0) return [0, seconds];
  // Until there is enough to fill the window, it fills from the left.
  const end = Math.max(times[length - 1], times[0] + seconds);
  return [end - seconds, end];
}

// What stands still is drawn in the middle and not as noise over the whole height.
function padded(low, high) {
  if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
  const least = Math.max(1e-3 * Math.max(Math.abs(low), Math.abs(high)), 1e-4);
  const pad = Math.max(0.08 * (high - low), least);
  return [low - pad, high + pad];
}

function draw() {
  if (frozen || length === 0 || !fresh) return;
  fresh = false;
  const from = first();
  const t = times.subarray(from, length);
  for (const { chart, k, now, signal } of plots) {
    chart.setData([t, columns[k].subarray(from, length)]);
    now.textContent = `${number(columns[k][length - 1])} ${signal.unit}`;
  }
}

// --- what stands there -----------------------------------------------------------------------------------------

const label = (signal) => (signal.unit ? `${signal.name}, ${signal.unit}` : signal.name);
const number = (x) => (Number.isFinite(x) ? (Math.abs(x) < 1e-6 ? "0.0000" : x.toPrecision(5)).replace("-", "−") : "–");

function pill(id, text, kind) {
  $(id).textContent = text;
  $(id).className = `pill ${kind}`;
}

function introduce(news) {
  if (!news) return;
  about = news;
  columns = about.signals.map(() => new Float64Array(ROOM));
  length = 0;
  $("axis").textContent = about.axis || "bristle monitor";
  $("board").textContent = `${about.board} · ${about.place} · firmware ${about.firmware} · ${Math.round(about.rate)} control periods a second`;
  $("frequency").textContent = `${Math.round(about.rate / about.every)} samples a second × ${about.signals.length} signals`;
  $("values").replaceChildren(...about.signals.map((signal) => {
    const tick = make("input", { type: "checkbox", checked: SHOWN.has(signal.id) });
    tick.addEventListener("change", () => {
      if (tick.checked) SHOWN.add(signal.id);
      else SHOWN.delete(signal.id);
      arrange();
    });
    return make("tr", {},
      make("td", {}, make("label", {}, tick, signal.name)),
      make("td", { className: "number" }, make("output", { id: `v-${signal.id}`, textContent: "–" })),
      make("td", { className: "unit", textContent: signal.unit }));
  }));
  // A stream that broke and came back introduces the board again: what a person was typing stays.
  const typed = $("value").value;
  choose(mode);
  $("value").value = $("slider").value = typed;
  arrange();
}

function show(now) {
  status = now.status;
  const up = status.link && now.silence < 1;
  pill("link", up ? "up" : "lost", up ? "good" : "bad");
  const state = status.stopping ? "stopping" : status.state ? status.state.toLowerCase() : "unknown";
  pill("state", state, { Running: "warn", Faulted: "bad" }[status.state] ?? "");
  const { telemetry, damaged, commands } = status.losses;
  const lost = telemetry + damaged + now.skipped;
  pill("lost", String(lost), lost > 0 ? "warn" : "");
  $("lost").title = `${telemetry} telemetry frames found the line busy, ${damaged} frames came damaged, the board missed ${commands} commands`;
  alarm(up ? (about?.harmless ? "This board was never set up and cannot move: put a model on it with bristle deploy." : "") : `The link to the board is lost (${status.why || "silent"}). It turns its bridge off by itself; nothing asked for here reaches it until the link is back.`);
  $("enable").disabled = !up || !about || status.state !== "Off" || status.armed;
  $("clear").disabled = !up || status.faults.length === 0;
  for (const element of $("ask").elements) element.disabled = !up || !status.armed;
  for (const button of $("modes").children) button.disabled = !up || !status.armed;
  const asked = status.aim === "off" ? "nothing (u = 0)" : Object.entries(status.aim).map(([name, value]) => `${name} ${number(value)}`).join();
  $("asked").textContent = status.armed ? `Asked for: ${asked}` : "The axis is off. Turning it on asks for nothing yet.";
  const recording = status.recording !== null;
  $("record").dataset.on = String(recording);
  $("record").textContent = recording ? "Stop and save" : "Record";
  $("recorded").textContent = recording ? `${status.recording} rows` : "";
  faults(status.faults);
  level(now.coulomb);
  for (const note of now.notes) tell(note);
  if (about && length > 0) about.signals.forEach((signal, k) => { $(`v-${signal.id}`).textContent = number(columns[k][length - 1]); });
}

function alarm(text) {
  $("alarm").hidden = text === "";
  $("alarm").textContent = text;
}

let latched = "";
function faults(ids) {
  if (ids.join() === latched && $("faults").children.length > 0) return;
  latched = ids.join();
  const pages = (about?.faults ?? []).filter((fault) => ids.includes(fault.id));
  $("faults").replaceChildren(...pages.map((fault) => make("div", { className: "fault" },
    make("b", { textContent: `${fault.id} (${fault.number})` }),
    make("p", { textContent: `Raised as ${fault.detection}.` }),
    make("p", { className: "quiet", textContent: fault.remedy }))));
  if (pages.length === 0) $("faults").append(make("p", { className: "quiet", textContent: "none" }));
}

function level(coulomb) {
  const unit = about?.torque_unit ?? "";
  const learned = about?.learned_range;
  $("level").textContent = coulomb ? `${number(coulomb.mean)} ± ${coulomb.spread.toPrecision(2)} ${unit}` : "…";
  $("level-note").textContent = learned
    ? `Learned by the board, between ${number(learned[0])} and ${number(learned[1])}: mean and spread over ${coulomb ? coulomb.over.toFixed(1) : "–"} s. The spread says how much it wanders, not how far it is from the truth.`
    : "As deployed: this board does not learn it.";
}

function tell(note) {
  const kind = { fault: "fault-note", warning: "warning", link: "link" }[note.kind] ?? "";
  const text = note.kind === "fault" ? `fault: ${note.text}` : note.text;
  $("notes").prepend(make("li", { className: kind }, make("time", { textContent: `${note.t.toFixed(1)} s` }), text));
  while ($("notes").children.length > 200) $("notes").lastChild.remove();
}

// --- asking ----------------------------------------------------------------------------------------------------

async function post(path, body) {
  try {
    const answer = await fetch(path, { method: "POST", body: body && JSON.stringify(body), keepalive: true });
    if (!answer.ok) tell({ t: 0, kind: "warning", text: await answer.text() });
  } catch {
    alarm("The monitor does not answer: it was closed, and has turned the axis off, or the board will by itself.");
  }
}

const stop = () => post("stop");
$("stop").addEventListener("click", stop);
addEventListener("keydown", (event) => {
  const writing = event.target instanceof HTMLInputElement && event.target.type === "number";
  if (event.key === "Escape" || (event.key === " " && !writing)) {
    event.preventDefault();
    stop();
  }
}, true);

$("enable").addEventListener("click", () => post("do", "enable"));
$("clear").addEventListener("click", () => post("do", "clear"));
$("record").addEventListener("click", () => post("do", status?.recording === null ? "record" : "save"));

function limit() {
  return { input: about?.command_limit, torque: about?.torque_limit, velocity: about?.speed }[mode];
}

function choose(next) {
  mode = next;
  for (const button of $("modes").children) button.setAttribute("aria-pressed", String(button.textContent === mode));
  const most = limit();
  $("slider").hidden = most === undefined;
  $("slider").max = most ?? 1;
  $("slider").min = -(most ?? 1);
  $("slider").value = 0;
  $("value").value = "0";
  const signal = about?.signals.find(({ id }) => id === mode);
  const own = { input: about?.command_unit, torque: about?.torque_unit }[mode];
  $("unit").textContent = own ?? signal?.unit ?? "";
  $("ask").hidden = mode === "off";
}

const aim = (value) => post("do", { aim: { [mode]: value } });

for (const name of MODES) {
  // Like all that asks for something, until the board has said what it is.
  const button = make("button", { type: "button", textContent: name, disabled: true });
  button.addEventListener("click", () => {
    choose(name);
    // A position is gone to when it is applied, and a velocity of zero holds still at once.
    if (name === "off") post("do", { aim: "off" });
    else if (name !== "position") aim(0);
  });
  $("modes").append(button);
}

$("ask").addEventListener("submit", (event) => {
  event.preventDefault();
  $("slider").value = $("value").value;
  aim($("value").valueAsNumber);
});
$("zero").addEventListener("click", () => {
  $("value").value = "0";
  $("slider").value = 0;
  aim(0);
});
let sent = 0;
$("slider").addEventListener("input", () => {
  $("value").value = Number($("slider").value).toPrecision(4);
  const now = performance.now();
  if (now - sent > 50) {
    sent = now;
    aim(Number($("slider").value));
  }
});
$("slider").addEventListener("change", () => aim(Number($("slider").value)));

for (const length of WINDOWS) {
  const button = make("button", { type: "button", textContent: `${length} s` });
  button.setAttribute("aria-pressed", String(length === seconds));
  button.addEventListener("click", () => {
    seconds = length;
    for (const other of $("window").children) other.setAttribute("aria-pressed", String(other === button));
  });
  $("window").append(button);
}
$("freeze").addEventListener("click", () => {
  frozen = !frozen;
  $("freeze").setAttribute("aria-pressed", String(frozen));
});
addEventListener("resize", () => {
  plots.forEach(({ chart }, row) => {
    const height = tall(plots.length) + (row === plots.length - 1 ? LABELS : 0);
    chart.setSize({ width: Math.max(200, $("plots").clientWidth - 30), height });
  });
});

// --- listening -------------------------------------------------------------------------------------------------

const events = new EventSource("events");
events.addEventListener("about", (event) => introduce(JSON.parse(event.data)));
events.addEventListener("now", (event) => {
  heard = performance.now();
  const now = JSON.parse(event.data);
  take(now.periods, now.values);
  show(now);
});
events.addEventListener("closed", (event) => {
  const left = JSON.parse(event.data);
  ended = true;
  events.close();
  pill("link", "closed", "bad");
  alarm(left === "unconfirmed"
    ? "The monitor was closed without an answer from the board. Without it the board turns its bridge off by itself."
    : "The monitor was closed. The axis is off.");
});
setInterval(() => {
  if (ended) return;
  if (performance.now() - heard > SILENT) {
    pill("link", "lost", "bad");
    alarm("The monitor does not answer: it was closed or killed. Without it the board turns its bridge off by itself.");
  }
}, 100);
(function frame() {
  draw();
  requestAnimationFrame(frame);
})();
