// The parameters of the running nodes, with descriptions and ranges; editable.

import { find, make, setClass, setText } from "./dom.js";

export class Parameters {
  constructor(link) {
    this.link = link;
    this.node = "";
    this.entries = [];
    this.select = make("select", { "aria-label": "Node", onchange: () => this.read(this.select.value) });
    this.filter = make("input", { type: "search", placeholder: "Filter", "aria-label": "Filter", oninput: () => this.list() });
    this.rows = make("div");
    this.said = make("p", { class: "hint" });
    find("parameters").append(make("div", { class: "choose" }, this.select, this.filter), this.said, this.rows);
    document.addEventListener("chosen", () => {
      if (!find("parameters").hidden) this.findNodes();
    });
  }

  findNodes() {
    this.link.ask({ do: "nodes" }, (answer) => {
      if (!answer.ok) return setText(this.said, answer.text);
      this.select.replaceChildren(...answer.nodes.map((name) => make("option", { value: name }, name)));
      const kept = answer.nodes.includes(this.node) ? this.node : answer.nodes.find((name) => name.endsWith("gaze_controller_node")) ?? answer.nodes[0];
      if (!kept) return setText(this.said, "No node with parameters runs here.");
      this.select.value = kept;
      this.read(kept);
    });
  }

  read(node) {
    this.node = node;
    setText(this.said, "reading");
    this.link.ask({ do: "parameters", node }, (answer) => {
      if (node !== this.node) return;
      setText(this.said, answer.ok ? `${answer.parameters.length} parameters. A change counts at once, until the node ends.` : answer.text);
      this.entries = answer.ok ? answer.parameters : [];
      this.list();
    });
  }

  list() {
    const words = this.filter.value.toLowerCase();
    const kept = this.entries.filter((one) => `${one.name} ${one.description}`.toLowerCase().includes(words));
    this.rows.replaceChildren(...kept.map((one) => this.row(one)));
  }

  row(one) {
    const input = one.kind === "bool" ? make("input", { type: "checkbox", checked: one.value }) : make("input", { type: "text", value: textOf(one.value) });
    input.disabled = one.read_only;
    input.setAttribute("aria-label", one.name);
    if (one.kind === "int" || one.kind === "float") input.inputMode = "decimal";
    const said = make("div", { class: "said" });
    input.addEventListener("change", () => this.set(one, input, said));
    const about = [one.description, one.allowed, one.read_only ? "fixed at the start" : ""].filter(Boolean).join("; ");
    return make("div", { class: "parameter", "data-parameter": one.name }, make("div", { class: "line" }, make("span", { class: "name" }, one.name), input), make("div", { class: "about" }, about), said);
  }

  set(one, input, said) {
    const value = one.kind === "bool" ? input.checked : parsed(input.value, one.kind);
    if (value === undefined) return tell(said, false, `${one.name} must be ${one.allowed || one.kind}: got ${input.value}`);
    this.link.ask({ do: "set", node: this.node, name: one.name, value }, (answer) => {
      tell(said, answer.ok, answer.ok ? "set" : answer.text);
      if (answer.ok) one.value = answer.value;
      if (one.kind === "bool") input.checked = one.value;
      else if (answer.ok) input.value = textOf(one.value);
    });
  }
}

function tell(said, ok, text) {
  setClass(said, `said ${ok ? "good" : "bad"}`);
  setText(said, text);
}

const textOf = (value) => (Array.isArray(value) ? JSON.stringify(value) : String(value ?? ""));

/** The value of a text field; undefined where it is none of this kind. */
function parsed(text, kind) {
  if (kind === "str") return text;
  if (kind === "list") {
    try {
      const value = JSON.parse(text);
      return Array.isArray(value) ? value : undefined;
    } catch {
      return undefined;
    }
  }
  const value = text.trim() === "" ? NaN : Number(text);
  return Number.isFinite(value) ? value : undefined;
}
