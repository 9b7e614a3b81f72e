// The state in words and figures, and what can be chosen to look at.

import { find, make, setClass, setText } from "./dom.js";
import { angle, metres, shown, signedAngle } from "./numbers.js";

const PHASES = { idle: "", search: "warn", saccade: "", verge: "", fixate: "good", lost: "bad" };

export class Words {
  /** onLook(request) is called with what was chosen. */
  constructor(onLook) {
    this.onLook = onLook;
    this.offered = "";
    this.classes = null;
    this.figures = new Map();
  }

  show(state) {
    const gaze = state.gaze;
    setText(find("phase"), gaze ? gaze.phase : "no state");
    setClass(find("phase"), `chip ${gaze ? PHASES[gaze.phase] ?? "" : "bad"}`.trim());
    find("verged").hidden = !gaze?.verged;
    setClass(find("verged"), "chip good");
    setText(find("reason"), gaze ? sentence(gaze) : "gaze_controller_node sends no state: it does not run, or has stopped.");
    this.showFigures(state);
    this.offer(state);
  }

  showFigures({ gaze, edge, error, track, box }) {
    const best = edge && edge.best !== null ? edge.best : null;
    const rows = [
      ["Vergence", gaze && `${angle(gaze.vergence_rad)}, to turn ${signedAngle(gaze.vergence_residual_rad)}`],
      ["Version", gaze && `${angle(gaze.version_rad)}, to turn ${signedAngle(gaze.version_residual_rad)}`],
      ["Tilt", gaze && `${angle(gaze.tilt_rad)}, to turn ${signedAngle(gaze.tilt_residual_rad)}`],
      ["Distance", gaze && `${metres(gaze.distance_m)} (${metres(gaze.distance_low_m)} to ${metres(gaze.distance_high_m)})`],
      ["Metric", best !== null && `${shown(edge.left_to_right_px[best], 2)} and ${shown(edge.right_to_left_px[best], 2)} px in ${edge.windows_px[best]} px, contrast ${shown(edge.contrast[best], 2)}`],
      ["Disparity", error && (error.reason || `${shown(error.horizontal_px, 2)} ± ${shown(error.sigma_px, 2)} px, ${shown(100 * error.confidence, 0)} % sure`)],
      ["Target", track && (track.reason || `followed, ${shown(track.disparity_px, 2)} px, ${shown(100 * track.confidence, 0)} % alike`)],
      ["Boxes", box && (box.reason || box.class || "none")],
      ["Control", gaze && `${gaze.law}, ${gaze.mode.replaceAll("_", " ")}`],
    ];
    for (const [name, text] of rows) this.figure(name, text || "–");
  }

  figure(name, text) {
    if (!this.figures.has(name)) {
      const value = make("dd");
      find("figures").append(make("dt", {}, name), value);
      this.figures.set(name, value);
    }
    setText(this.figures.get(name), text);
  }

  setClasses(classes) {
    this.classes = classes;
  }

  /** Offer the detected things as buttons; they are made anew only when the list changes. */
  offer({ detections }) {
    const things = detections ? ["left", "right"].flatMap((eye) => detections[eye].map((box) => ({ ...box, eye }))) : [];
    const seen = oneOfEach(things);
    const key = JSON.stringify([seen.map((one) => [one.class, one.eye, one.number]), this.classes]);
    this.now = { seen, stamp: detections?.stamp };
    if (key === this.offered) return;
    this.offered = key;
    const buttons = seen.map((one, i) => make("button", { "data-detected": one.class, onclick: () => this.choose(i) }, one.of > 1 ? `${one.class} ${one.number}` : one.class));
    const finds = (this.classes ?? []).map((name) => make("button", { "data-class": name, title: "Wherever it is", onclick: () => this.onLook({ do: "class", name }) }, name));
    const label = (text) => make("span", { class: "label" }, text);
    find("detected").replaceChildren(
      ...(buttons.length ? [label("Detected:"), ...buttons] : []),
      ...(finds.length ? [label("Look for:"), ...finds] : []),
    );
  }

  /** Look at a detected thing: by its class where it is the only one of it, by its box otherwise. */
  choose(i) {
    const { seen, stamp } = this.now;
    const one = seen[i];
    if (!one) return;
    const [left, top, right, bottom] = one.xyxy;
    if (one.of === 1) this.onLook({ do: "class", name: one.class });
    else this.onLook({ do: "pixel", eye: one.eye, stamp, x: (left + right) / 2, y: (top + bottom) / 2, width: Math.max(right - left, 1), height: Math.max(bottom - top, 1) });
  }
}

/** The left eye's detections, and of the right eye's those of classes that the left one does not see, from left to right. */
function oneOfEach(things) {
  const inLeft = new Set(things.filter((one) => one.eye === "left").map((one) => one.class));
  const kept = things.filter((one) => !one.xyxy.includes(null) && (one.eye === "left" || !inLeft.has(one.class)));
  kept.sort((a, b) => a.class.localeCompare(b.class) || a.xyxy[0] - b.xyxy[0]);
  return kept.map((one) => {
    const alike = kept.filter((other) => other.class === one.class);
    return { ...one, number: alike.indexOf(one) + 1, of: alike.length };
  });
}

function sentence(gaze) {
  const moving = gaze.moving ? "The target moves. " : "";
  const reason = gaze.reason ? gaze.reason[0].toUpperCase() + gaze.reason.slice(1) : "No reason is given";
  return `${moving}${reason}.`;
}
