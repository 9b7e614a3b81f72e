// What the graph measures, drawn over one eye's image.

import { colour } from "./dom.js";

const CROSS = 9;
const TRACK_OK = 0;
const TRACK_AMBIGUOUS = 5;
const TRACK_OCCLUDED = 3;

/** Draw into a context in CSS pixels; `scale` is CSS pixels for one pixel of the image, `index` 0 left, 1 right. */
export function drawMarks(context, scale, index, state, shown, drag) {
  const at = ([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale];
  const eye = state?.eyes?.[index];
  const side = index === 0 ? "left" : "right";
  if (eye && shown.windows) for (const window of eye.windows) polygon(context, window.map(at), "#ffd54a", 1);
  if (state?.detections && shown.boxes) for (const box of state.detections[side]) drawBox(context, box, at);
  if (eye && shown.fovea && !eye.fovea.includes(null)) cross(context, at(eye.fovea), colour(side));
  if (state?.track && shown.track) drawTrack(context, state.track, side, at, scale);
  if (drag) rectangle(context, at(drag.from), at(drag.to));
}

function outlined(context, draw, stroke, width) {
  // A dark edge below, so that a line is visible on every image.
  context.lineJoin = "round";
  context.beginPath();
  draw();
  context.strokeStyle = "rgb(0 0 0 / 55%)";
  context.lineWidth = width + 2;
  context.stroke();
  context.strokeStyle = stroke;
  context.lineWidth = width;
  context.stroke();
}

function cross(context, [x, y], stroke) {
  outlined(context, () => {
    context.moveTo(x - CROSS, y);
    context.lineTo(x + CROSS, y);
    context.moveTo(x, y - CROSS);
    context.lineTo(x, y + CROSS);
  }, stroke, 2);
}

function polygon(context, corners, stroke, width) {
  if (corners.flat().some((value) => !Number.isFinite(value))) return;
  outlined(context, () => {
    corners.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
  }, stroke, width);
}

function drawBox(context, box, at) {
  if (box.xyxy.includes(null)) return;
  const [left, top] = at([box.xyxy[0], box.xyxy[1]]);
  const [right, bottom] = at([box.xyxy[2], box.xyxy[3]]);
  outlined(context, () => context.rect(left, top, right - left, bottom - top), "#7be07b", 1.5);
  label(context, `${box.class} ${box.score === null ? "" : box.score.toFixed(2)}`, left, top - 4);
}

function drawTrack(context, track, side, at, scale) {
  const point = track[side];
  const found = [TRACK_OK, TRACK_AMBIGUOUS, TRACK_OCCLUDED].includes(track.status);
  if (!found || point.includes(null)) return;
  const [x, y] = at(point);
  const stroke = track.status === TRACK_OK ? "#ffc83d" : "#ff9e4a";
  if (!track.extent.includes(null)) {
    const [width, height] = track.extent.map((value) => value * scale);
    context.setLineDash([5, 4]);
    outlined(context, () => context.rect(x - width / 2, y - height / 2, width, height), stroke, 1);
    context.setLineDash([]);
  }
  outlined(context, () => context.arc(x, y, 6, 0, 2 * Math.PI), stroke, 2);
  if (side === "right" && track.sigma_px !== null) {
    // The disparity is as uncertain as the point in the right image is to and fro: two standard deviations.
    const reach = Math.max(2 * track.sigma_px * scale, 1);
    outlined(context, () => {
      context.moveTo(x - reach, y);
      context.lineTo(x + reach, y);
      for (const end of [x - reach, x + reach]) {
        context.moveTo(end, y - 4);
        context.lineTo(end, y + 4);
      }
    }, stroke, 1.5);
    label(context, `σ ${track.sigma_px.toFixed(2)} px`, x + 10, y + 20);
  }
}

function rectangle(context, from, to) {
  context.setLineDash([6, 4]);
  outlined(context, () => context.rect(from[0], from[1], to[0] - from[0], to[1] - from[1]), "#ffffff", 1.5);
  context.setLineDash([]);
}

function label(context, text, x, y) {
  context.font = "12px system-ui, sans-serif";
  const left = Math.min(Math.max(x, 2), context.canvas.clientWidth - context.measureText(text).width - 4);
  const base = Math.max(y, 13);
  context.lineWidth = 3;
  context.strokeStyle = "rgb(0 0 0 / 70%)";
  context.strokeText(text, left, base);
  context.fillStyle = "#fff";
  context.fillText(text, left, base);
}
