// Rates and ages of the topics, and the diagnostics of the nodes.

import { find, make } from "./dom.js";
import { shown } from "./numbers.js";

const LEVELS = ["ok", "warn", "error", "stale"];
const OLD_S = 1.5;

export class Details {
  constructor() {
    this.open = new Set();
    this.latency = null;
    for (const tab of document.querySelectorAll("#tabs button")) tab.addEventListener("click", () => this.choose(tab));
  }

  choose(tab) {
    for (const one of document.querySelectorAll("#tabs button")) {
      one.setAttribute("aria-selected", String(one === tab));
      find(one.dataset.tab).hidden = one !== tab;
    }
    tab.dispatchEvent(new CustomEvent("chosen", { bubbles: true }));
  }

  show(slow) {
    if (!find("rates").hidden) this.showRates(slow);
    if (!find("diagnostics").hidden) this.showHealth(slow.diagnostics);
  }

  showRates(slow) {
    const head = make("tr", {}, make("th", {}, "Topic"), ...["Rate", "Age", "Delay"].map((name) => make("th", { class: "number" }, name)));
    const rows = slow.rates.map((one) => {
      const old = one.age_s === null || one.age_s > OLD_S;
      const silent = one.age_s === null;
      const cells = silent ? ["silent", "", ""] : [shown(one.rate_hz, 1, " Hz"), shown(one.age_s, 1, " s"), delay(one.latency_s)];
      return make("tr", { class: old ? "old" : "" }, make("td", {}, topicName(one.topic, slow.transports)), ...cells.map((cell) => make("td", { class: "number" }, cell)));
    });
    const pairs = slow.diagnostics.filter((one) => one.name.endsWith(": pairs")).map((one) => make("p", { class: "hint" }, pairsSentence(one)));
    const screen = Number.isFinite(this.latency) ? [make("p", { class: "hint" }, `From an image's stamp to this screen: ${(1000 * this.latency).toFixed(0)} ms.`)] : [];
    const refused = slow.refused ? [make("p", { class: "hint" }, `An image was refused: ${slow.refused}`)] : [];
    const note = make("p", { class: "hint" }, "Delay: from a message's stamp to its arrival at web_node, by the clock of the graph.");
    find("rates").replaceChildren(make("div", { class: "wide" }, make("table", {}, head, ...rows)), ...screen, ...pairs, ...refused, note);
  }

  showHealth(entries) {
    const items = entries.map((one) => {
      const values = Object.entries(one.values).map(([key, value]) => make("tr", {}, make("td", {}, key.replaceAll("_", " ")), make("td", {}, value)));
      const summary = make("summary", {}, make("span", { class: "level" }, LEVELS[one.level] ?? "?"), make("b", {}, one.name), ` ${one.message}`);
      const item = make("details", { class: `health level${one.level}`, open: this.open.has(one.name) }, summary, make("table", {}, ...values));
      item.addEventListener("toggle", () => (item.open ? this.open.add(one.name) : this.open.delete(one.name)));
      return item;
    });
    find("diagnostics").replaceChildren(...(items.length ? items : [make("p", { class: "hint" }, "Nothing has arrived on /diagnostics yet.")]));
  }
}

const topicName = (topic, transports) => {
  const eye = topic.match(/^(left|right)\/image$/)?.[1];
  return eye ? `${eye}/image_raw${transports[eye] === "compressed" ? "/compressed" : ""}` : topic;
};

/** A delay of minutes is one of two clocks that differ, and says nothing. */
const delay = (seconds) => (seconds !== null && Math.abs(seconds) < 60 ? shown(1000 * seconds, 0, " ms") : "–");

function pairsSentence({ name, message, values }) {
  const left = values.unmatched_left ?? "0";
  const right = values.unmatched_right ?? "0";
  return `${name.split(":")[0]}: ${message}; without a partner were ${left} left and ${right} right images.`;
}
