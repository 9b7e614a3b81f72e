// The page: what arrives is drawn once for each frame of the screen, and reported back as drawn.

import { Charts } from "./charts.js";
import { Control } from "./control.js";
import { Details } from "./details.js";
import { find, setClass, setText } from "./dom.js";
import { Eyes } from "./eyes.js";
import { HeadView } from "./head.js";
import { Link } from "./link.js";
import { Parameters } from "./parameters.js";
import { Words } from "./words.js";

const EYES = ["left", "right"];
const SAME_CLOCK_S = 60;
const CHART_PERIOD_S = 0.18;

const link = new Link(onUpdate, onStatus);
const control = new Control(link);
const look = (request, clickedAt) => control.look(request, clickedAt);
const eyes = new Eyes(look, showEdges);
const words = new Words(look);
const charts = new Charts();
const head = new HeadView();
const details = new Details();
new Parameters(link);

// For tests and measurements: what the page has done so far.
const figures = { updates: 0, latencies: [], images: { left: 0, right: 0, edges: 0 }, samples: 0, chartsAt: 0, control };
window.vergence = figures;

function showEdges(edges) {
  const request = { do: "show", edges };
  link.greeting = edges ? [request] : [];
  link.ask(request);
}

function onStatus(connected, text) {
  setText(find("link"), text);
  setClass(find("link"), connected ? "link" : "link bad");
}

async function onUpdate(update) {
  const bitmaps = await Promise.all(update.images.map((image) => createImageBitmap(image.blob).catch(() => null)));
  requestAnimationFrame(() => {
    const now = performance.now() / 1000;
    update.images.forEach((image, i) => {
      if (!bitmaps[i]) return;
      eyes.setImage(image.name, bitmaps[i], image.stamp);
      figures.images[image.name] += 1;
    });
    if (update.state) eyes.setState(update.state);
    if (update.images.length || update.state) eyes.draw();
    if (update.state) showState(update.state, now);
    if (update.slow) showSlow(update.slow);
    if (update.available) control.setAvailable(update.available);
    figures.updates += 1;
    link.drawn(update.number, latency(update.images));
  });
}

/** Pictures before texts: a canvas's size is asked for, and after a change of texts that needs a new layout. */
function showState(state, now) {
  charts.add(state, now);
  if (now - figures.chartsAt > CHART_PERIOD_S) {
    figures.chartsAt = now;
    charts.draw(now);
    head.draw(state);
  }
  words.show(state);
  figures.samples += 1;
  figures.state = state;
}

function showSlow(slow) {
  words.setClasses(slow.classes);
  details.show(slow);
  figures.slow = slow;
}

/** The time [s] from the left image's stamp, or the right one's where it is alone, to now; NaN for another clock's. */
function latency(images) {
  const image = EYES.map((eye) => images.find((one) => one.name === eye)).find(Boolean);
  if (!image) return NaN;
  const seconds = (performance.timeOrigin + performance.now() - Number(image.stamp) / 1e6) / 1000;
  if (Math.abs(seconds) > SAME_CLOCK_S) return NaN;
  details.latency = seconds;
  figures.latencies = [...figures.latencies.slice(-999), { eye: image.name, stamp: image.stamp, seconds }];
  return seconds;
}
