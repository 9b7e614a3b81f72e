// The buttons, and what becomes of a goal.

import { find, setClass, setText } from "./dom.js";

const COMMANDS = ["stop", "hold", "centre", "park", "enable", "disable"];

export class Control {
  constructor(link) {
    this.link = link;
    this.newest = 0;
    this.titles = {};
    for (const name of COMMANDS) {
      this.titles[name] = find(name).title;
      find(name).addEventListener("click", () => this.ask({ do: name }, name));
    }
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") this.ask({ do: "stop" }, "stop");
    });
  }

  /** Send a goal; `clickedAt` is the time stamp of the event that asked for it. */
  look(request, clickedAt = performance.now()) {
    const what = request.do === "class" ? request.name : request.width ? "what is in the box" : `pixel ${request.x.toFixed(0)}, ${request.y.toFixed(0)} of the ${request.eye} eye`;
    this.ask(request, `look at ${what}`, clickedAt);
  }

  ask(request, what, clickedAt = performance.now()) {
    this.newest += 1;
    const mine = this.newest;
    this.tell("", `${what}: sent`);
    this.link.ask(request, (answer) => {
      if (!answer.last) this.acceptedAfterMs = performance.now() - clickedAt;
      if (mine !== this.newest) return;
      this.tell(answer.last ? (answer.ok ? "good" : "bad") : "", `${what}: ${answer.text}`);
      find("goal").dataset.result = answer.result ?? "";
    });
  }

  tell(kind, text) {
    setClass(find("goal"), `words goal ${kind}`.trim());
    setText(find("goal"), text[0].toUpperCase() + text.slice(1));
  }

  /** Disable what the graph does not serve. */
  setAvailable(available) {
    for (const name of COMMANDS) {
      const button = find(name);
      const there = available[name] !== false || name === "stop";
      button.disabled = !there;
      button.title = there ? this.titles[name] : "Not served in this graph";
    }
  }
}
