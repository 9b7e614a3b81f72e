// The head from above: both eyes, their axes, where they meet, and the target with its 95 % ellipse.

import { colour, find, fitted, setText } from "./dom.js";
import { metres } from "./numbers.js";

const NEAREST_M = 0.35;
const FARTHEST_M = 8;
const MARGIN = 22;

export class HeadView {
  constructor() {
    this.canvas = find("head");
    this.span = NEAREST_M;
  }

  draw(state) {
    const context = fitted(this.canvas);
    const head = state?.head;
    if (!head) {
      setText(find("head-words"), "No joint angles arrive: the head cannot be drawn.");
      return;
    }
    const width = this.canvas.clientWidth;
    const height = this.canvas.clientHeight;
    this.zoom(head);
    const scale = (height - 2 * MARGIN) / this.span;
    // x forward is up, y left is left.
    const at = ([x, y]) => [width / 2 - y * scale, height - MARGIN - x * scale];
    rings(context, at, scale, width, this.span);
    for (const [i, name] of ["left", "right"].entries()) this.drawEye(context, head, i, colour(name), at, scale);
    if (head.target && head.ellipse) ellipse(context, at(head.target), head.ellipse, scale, colour("target"));
    if (head.target) dot(context, at(head.target), colour("target"), 4);
    if (head.fixation) ring(context, at(head.fixation), colour("text"));
    words(head, state.gaze);
  }

  /** Let what is looked at fit, and change the scale smoothly. */
  zoom(head) {
    const far = [head.fixation, head.target].filter((point) => point && !point.includes(null)).map((point) => Math.hypot(...point));
    const wanted = Math.min(Math.max(1.25 * Math.max(0, ...far), NEAREST_M), FARTHEST_M);
    this.span *= (wanted / this.span) ** 0.35;
  }

  drawEye(context, head, i, stroke, at, scale) {
    const lens = head.lenses[i];
    const axis = head.axes[i];
    if (lens.includes(null) || axis.includes(null)) return;
    const end = [lens[0] + 2 * this.span * axis[0], lens[1] + 2 * this.span * axis[1]];
    context.strokeStyle = stroke;
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(...at(lens));
    context.lineTo(...at(end));
    context.stroke();
    dot(context, at(lens), stroke, Math.max(0.012 * scale, 5));
  }
}

function rings(context, at, scale, width, span) {
  context.strokeStyle = colour("line");
  context.fillStyle = colour("soft");
  context.font = "11px system-ui, sans-serif";
  context.lineWidth = 1;
  const step = [0.1, 0.2, 0.5, 1, 2].find((one) => span / one <= 5) ?? 5;
  const [x, y] = at([0, 0]);
  for (let radius = step; radius <= span; radius += step) {
    context.beginPath();
    context.arc(x, y, radius * scale, Math.PI, 2 * Math.PI);
    context.stroke();
    context.fillText(`${+radius.toFixed(2)} m`, x + 4, y - radius * scale - 3);
  }
}

function dot(context, [x, y], fill, radius) {
  context.fillStyle = fill;
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function ring(context, [x, y], stroke) {
  context.strokeStyle = stroke;
  context.lineWidth = 2;
  context.beginPath();
  context.arc(x, y, 7, 0, 2 * Math.PI);
  context.stroke();
}

function ellipse(context, [x, y], { long_m: long, short_m: short, angle_rad: angle }, scale, fill) {
  const limit = 4000;
  context.fillStyle = fill;
  context.strokeStyle = fill;
  context.lineWidth = 1;
  context.beginPath();
  // An angle from x forward to y left: on the canvas counter-clockwise from upwards.
  context.ellipse(x, y, Math.min(long * scale, limit), Math.min(Math.max(short * scale, 1), limit), -Math.PI / 2 - angle, 0, 2 * Math.PI);
  context.globalAlpha = 0.2;
  context.fill();
  context.globalAlpha = 1;
  context.stroke();
}

function words(head, gaze) {
  const meet = head.fixation ? `Ring: the axes meet ${metres(Math.hypot(...head.fixation))} ahead.` : "The axes do not meet.";
  const target = head.target ? " Dot: the target, with its 95 % ellipse." : " No target.";
  const far = gaze?.distance_m != null ? ` Distance ${metres(gaze.distance_m)}, 95 % from ${metres(gaze.distance_low_m)} to ${metres(gaze.distance_high_m)}.` : "";
  setText(find("head-words"), meet + target + far);
}
