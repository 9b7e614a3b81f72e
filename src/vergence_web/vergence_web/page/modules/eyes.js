// Both eyes' images in the chosen view, and the clicks and boxes on them.

import { find, fitted, setText } from "./dom.js";
import { drawMarks } from "./marks.js";

const LEAST_BOX_PX = 4;
const LEAST_DRAG = 10; // CSS pixels: a finger moves a little while it taps
const HINTS = {
  side: "Click where both eyes are to look, or drag a box around a thing.",
  anaglyph: "Left eye red, right eye cyan, foveas on each other: what is fixated has its own colours and no fringe. Clicks count as the left eye's.",
  blend: "Both eyes half and half, foveas on each other: what is fixated is sharp. Clicks count as the left eye's.",
  edges: "As the metric sees it: edges of the left eye green, of the right one blue, of both white.",
};

export class Eyes {
  /** onLook(request) is called with what was clicked or boxed; onShow(edges) when the view of the edges comes or goes. */
  constructor(onLook, onShow) {
    this.onLook = onLook;
    this.onShow = onShow;
    this.mode = "side";
    this.shown = { fovea: true, windows: false, track: true, boxes: true };
    this.images = {};
    this.state = null;
    this.drag = null;
    this.figures = {};
    for (const figure of document.querySelectorAll("#eyes figure")) this.connect(figure);
    this.connectButtons();
  }

  connect(figure) {
    const eye = figure.dataset.eye;
    const screen = figure.querySelector(".screen");
    const marks = figure.querySelector(".marks");
    this.figures[eye] = { figure, screen, marks, image: figure.querySelector(".image"), caption: figure.querySelector("figcaption") };
    marks.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || this.mode === "edges" || !this.images[eye]) return;
      const at = this.pixel(eye, event);
      this.drag = { eye, stamp: this.images[eye].stamp, from: at, to: at, begun: [event.clientX, event.clientY] };
      marks.setPointerCapture(event.pointerId);
    });
    marks.addEventListener("pointermove", (event) => {
      if (!this.drag) return;
      this.drag.to = this.pixel(this.drag.eye, event);
      this.drawMarks();
    });
    marks.addEventListener("pointerup", (event) => {
      if (!this.drag) return;
      const drag = { ...this.drag, to: this.pixel(this.drag.eye, event) };
      const moved = Math.hypot(event.clientX - drag.begun[0], event.clientY - drag.begun[1]);
      this.drag = null;
      this.onLook(lookRequest(drag, moved >= LEAST_DRAG), event.timeStamp);
    });
    marks.addEventListener("pointercancel", () => { this.drag = null; });
  }

  connectButtons() {
    const press = (buttons, chosen) => {
      for (const button of buttons) button.setAttribute("aria-pressed", String(chosen(button)));
    };
    const modes = document.querySelectorAll("#modes button");
    for (const button of modes) {
      button.addEventListener("click", () => {
        this.setMode(button.dataset.mode);
        press(modes, (one) => one.dataset.mode === this.mode);
      });
    }
    const marks = document.querySelectorAll("#marks button");
    for (const button of marks) {
      button.addEventListener("click", () => {
        this.shown[button.dataset.mark] = !this.shown[button.dataset.mark];
        press(marks, (one) => this.shown[one.dataset.mark]);
        this.drawMarks();
      });
    }
    const box = find("draw-box");
    box.addEventListener("click", () => {
      const on = box.getAttribute("aria-pressed") !== "true";
      box.setAttribute("aria-pressed", String(on));
      for (const { screen } of Object.values(this.figures)) screen.classList.toggle("boxing", on);
    });
  }

  setMode(mode) {
    const edgesBefore = this.mode === "edges";
    this.mode = mode;
    find("eyes").classList.toggle("single", mode !== "side");
    this.figures.right.figure.hidden = mode !== "side";
    this.figures.left.screen.classList.toggle("no-click", mode === "edges");
    setText(find("view-hint"), HINTS[mode]);
    if (edgesBefore !== (mode === "edges")) this.onShow(mode === "edges");
    this.draw();
  }

  /** Keep a newly decoded image of "left", "right" or "edges". */
  setImage(name, bitmap, stamp) {
    this.images[name]?.bitmap.close();
    this.images[name] = { bitmap, stamp, arrived: performance.now() };
  }

  setState(state) {
    this.state = state;
  }

  /** Draw the newest images and what is known about them. */
  draw() {
    if (this.mode === "side") {
      for (const eye of ["left", "right"]) if (this.images[eye]) this.paint(eye, (context) => plain(context, this.images[eye].bitmap));
    } else if (this.mode === "edges") {
      this.paint("left", (context) => this.images.edges && plain(context, this.images.edges.bitmap));
    } else if (this.images.left && this.images.right) {
      const shift = this.foveaShift();
      const combine = this.mode === "anaglyph" ? anaglyph : blend;
      this.paint("left", (context) => combine(context, this.images.left.bitmap, this.images.right.bitmap, shift));
    }
    this.drawMarks();
  }

  paint(eye, draw) {
    const canvas = this.figures[eye].image;
    const source = (this.mode === "edges" && this.images.edges) || this.images[eye];
    if (!source) return;
    const { width, height } = source.bitmap;
    if (canvas.width !== width || canvas.height !== height) {
      canvas.width = width;
      canvas.height = height;
      this.figures[eye].screen.style.aspectRatio = `${width} / ${height}`;
    }
    draw(canvas.getContext("2d"));
  }

  /** The shift [px] of the right image that lays its fovea on the left one's. */
  foveaShift() {
    const eyes = this.state?.eyes;
    if (!eyes || eyes[0].fovea.includes(null) || eyes[1].fovea.includes(null)) return [0, 0];
    return [eyes[0].fovea[0] - eyes[1].fovea[0], eyes[0].fovea[1] - eyes[1].fovea[1]];
  }

  drawMarks() {
    for (const [index, eye] of ["left", "right"].entries()) {
      const { marks, figure } = this.figures[eye];
      if (figure.hidden) continue;
      const context = fitted(marks);
      const image = this.images[eye];
      if (!image || this.mode === "edges") continue;
      const scale = marks.clientWidth / image.bitmap.width;
      drawMarks(context, scale, index, this.state, this.shown, this.drag?.eye === eye ? this.drag : null);
    }
    this.caption();
  }

  caption() {
    const names = { side: "Left eye", anaglyph: "Both eyes, red and cyan", blend: "Both eyes, blended", edges: "Edges of both eyes" };
    const now = performance.now();
    for (const eye of ["left", "right"]) {
      const image = this.images[this.mode === "edges" ? "edges" : eye];
      const name = eye === "right" ? "Right eye" : names[this.mode];
      const old = image && now - image.arrived > 1500 ? ` · no image for ${((now - image.arrived) / 1000).toFixed(0)} s` : "";
      setText(this.figures[eye].caption, image ? name + old : `${name} · no image yet`);
    }
  }

  /** The pixel of the raw image under a pointer; pixel centres are whole numbers. */
  pixel(eye, event) {
    const box = this.figures[eye].marks.getBoundingClientRect();
    const { width, height } = this.images[eye].bitmap;
    const across = Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
    const down = Math.min(Math.max((event.clientY - box.top) / box.height, 0), 1);
    return [across * width - 0.5, down * height - 0.5];
  }
}

/** A box about what was dragged over, or the pixel that was clicked. */
function lookRequest({ eye, stamp, from, to }, isBox) {
  const request = { do: "pixel", eye, stamp };
  if (!isBox) return { ...request, x: from[0], y: from[1] };
  const [width, height] = [0, 1].map((i) => Math.max(Math.abs(to[i] - from[i]), LEAST_BOX_PX));
  return { ...request, x: (from[0] + to[0]) / 2, y: (from[1] + to[1]) / 2, width, height };
}

function plain(context, bitmap) {
  context.drawImage(bitmap, 0, 0);
}

function blend(context, left, right, shift) {
  context.globalAlpha = 1;
  context.drawImage(left, 0, 0);
  context.globalAlpha = 0.5;
  context.drawImage(right, shift[0], shift[1]);
  context.globalAlpha = 1;
}

const scratch = document.createElement("canvas");

/** The red of the left image, the green and the blue of the right one: what is fixated keeps its colours. */
function anaglyph(context, left, right, shift) {
  const { width, height } = context.canvas;
  scratch.width = width;
  scratch.height = height;
  const cyan = scratch.getContext("2d");
  tinted(cyan, right, shift, "#00ffff");
  tinted(context, left, [0, 0], "#ff0000");
  context.globalCompositeOperation = "lighter";
  context.drawImage(scratch, 0, 0);
  context.globalCompositeOperation = "source-over";
}

function tinted(context, bitmap, shift, tint) {
  const { width, height } = context.canvas;
  context.globalCompositeOperation = "source-over";
  context.fillStyle = "#000";
  context.fillRect(0, 0, width, height);
  context.drawImage(bitmap, shift[0], shift[1]);
  context.globalCompositeOperation = "multiply";
  context.fillStyle = tint;
  context.fillRect(0, 0, width, height);
  context.globalCompositeOperation = "source-over";
}
