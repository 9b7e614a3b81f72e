// Strip charts of the last 30 seconds.

import { colour, find, fitted, make, setText } from "./dom.js";
import { degrees, shown } from "./numbers.js";

const SPAN_S = 30;
const GAP_S = 0.6;

const best = (state, name) => {
  const edge = state.edge;
  return edge && edge.best !== null ? edge[name][edge.best] : null;
};
const estimated = (name) => (state) => degrees((state.gaze ?? state.seen)?.[name]);
const commanded = (name) => (state) => degrees(state.wanted?.[name]);
const angleChart = (title, name) => ({
  title, unit: "°", digits: 2, least: 1,
  lines: [{ name: "measured", value: estimated(name) }, { name: "commanded", value: commanded(name) }],
});

const CHARTS = [
  angleChart("Vergence", "vergence_rad"),
  angleChart("Version", "version_rad"),
  angleChart("Tilt", "tilt_rad"),
  {
    title: "Edge metric", unit: " px", digits: 2, least: 2, floor: 0,
    lines: [
      { name: "left to right", value: (state) => best(state, "left_to_right_px") },
      { name: "right to left", value: (state) => best(state, "right_to_left_px") },
    ],
  },
  { title: "Contrast", unit: "", digits: 2, least: 0.5, floor: 0, lines: [{ name: "1 is unrelated", value: (state) => best(state, "contrast") }] },
  {
    title: "Disparity at the fovea", unit: " px", digits: 2, least: 2,
    lines: [{ name: "± 2 σ", value: (state) => state.error?.horizontal_px ?? null, band: disparityBand }],
  },
  {
    title: "Distance", unit: " m", digits: 2, least: 0.1, floor: 0,
    lines: [{ name: "95 % interval", value: (state) => state.gaze?.distance_m ?? null, band: distanceBand }],
  },
];

function disparityBand(state) {
  const error = state.error;
  if (!error || error.horizontal_px === null || error.sigma_px === null) return null;
  return [error.horizontal_px - 2 * error.sigma_px, error.horizontal_px + 2 * error.sigma_px];
}

function distanceBand(state) {
  const gaze = state.gaze;
  if (!gaze || gaze.distance_low_m === null || gaze.distance_high_m === null) return null;
  return [gaze.distance_low_m, gaze.distance_high_m === "infinite" ? Infinity : gaze.distance_high_m];
}

export class Charts {
  constructor() {
    this.samples = [];
    const place = find("charts").querySelector(".charts");
    this.views = CHARTS.map((chart) => {
      const keys = chart.lines.map((line, i) => make("span", { class: i ? "key b" : "key" }, line.name));
      const value = make("span");
      const canvas = make("canvas", { role: "img", "aria-label": chart.title });
      place.append(make("div", { class: "chart", "data-chart": chart.title }, make("div", { class: "title" }, make("b", {}, chart.title), value, ...keys), canvas));
      return { chart, canvas, value };
    });
  }

  /** Add one sample of every chart. */
  add(state, now) {
    const values = CHARTS.map((chart) => chart.lines.map((line) => ({ at: line.value(state), band: line.band?.(state) ?? null })));
    this.samples.push({ s: now, values });
    while (this.samples.length && now - this.samples[0].s > SPAN_S) this.samples.shift();
  }

  draw(now) {
    const colours = { a: colour("chart-a"), b: colour("chart-b"), line: colour("line"), soft: colour("soft") };
    this.views.forEach((view, index) => this.drawOne(view, index, now, colours));
  }

  drawOne({ chart, canvas, value }, index, now, colours) {
    const last = this.samples.at(-1)?.values[index].map((one) => shown(one.at, chart.digits, chart.unit)).join(" / ");
    setText(value, last ?? "–");
    const context = fitted(canvas);
    const width = canvas.clientWidth;
    const height = canvas.clientHeight;
    const [low, high] = this.range(chart, index);
    const x = (s) => width - ((now - s) / SPAN_S) * width;
    const y = (v) => 4 + (1 - (v - low) / (high - low)) * (height - 8);
    grid(context, width, height, low, high, y, chart, colours);
    chart.lines.forEach((line, i) => {
      const points = this.samples.map((sample) => ({ s: sample.s, ...sample.values[index][i] }));
      const stroke = i ? colours.b : colours.a;
      if (line.band) band(context, points, x, y, high, stroke);
      plot(context, points, x, y, stroke);
    });
  }

  /** The smallest and largest value shown: of the lines, and a little of the bands. */
  range(chart, index) {
    let low = Infinity;
    let high = -Infinity;
    for (const sample of this.samples) {
      for (const { at } of sample.values[index]) {
        if (at === null) continue;
        low = Math.min(low, at);
        high = Math.max(high, at);
      }
    }
    if (low > high) [low, high] = [0, chart.least];
    const missing = chart.least - (high - low);
    if (missing > 0) [low, high] = [low - missing / 2, high + missing / 2];
    const margin = 0.12 * (high - low);
    return [Math.max(low - margin, chart.floor ?? -Infinity), high + margin];
  }
}

function grid(context, width, height, low, high, y, chart, colours) {
  context.strokeStyle = colours.line;
  context.lineWidth = 1;
  context.fillStyle = colours.soft;
  context.font = "11px system-ui, sans-serif";
  for (const value of ticks(low, high)) {
    context.beginPath();
    context.moveTo(0, Math.round(y(value)) + 0.5);
    context.lineTo(width, Math.round(y(value)) + 0.5);
    context.stroke();
    context.fillText(`${+value.toFixed(6)}${chart.unit}`, 2, Math.min(Math.max(y(value) - 3, 10), height - 2));
  }
}

function ticks(low, high) {
  const raw = (high - low) / 3;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= raw) * power;
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high; value += step) found.push(value);
  return found;
}

function plot(context, points, x, y, stroke) {
  context.strokeStyle = stroke;
  context.lineWidth = 1.6;
  context.beginPath();
  let before = null;
  for (const point of points) {
    if (point.at === null) {
      before = null;
      continue;
    }
    const joined = before !== null && point.s - before < GAP_S;
    if (joined) context.lineTo(x(point.s), y(point.at));
    else context.moveTo(x(point.s), y(point.at));
    before = point.s;
  }
  context.stroke();
}

function band(context, points, x, y, high, fill) {
  context.fillStyle = fill;
  context.globalAlpha = 0.18;
  for (let i = 1; i < points.length; i += 1) {
    const [a, b] = [points[i - 1], points[i]];
    if (!a.band || !b.band || b.s - a.s > GAP_S) continue;
    const top = (one) => y(Math.min(one.band[1], high));
    context.beginPath();
    context.moveTo(x(a.s), y(a.band[0]));
    context.lineTo(x(a.s), top(a));
    context.lineTo(x(b.s), top(b));
    context.lineTo(x(b.s), y(b.band[0]));
    context.fill();
  }
  context.globalAlpha = 1;
}
