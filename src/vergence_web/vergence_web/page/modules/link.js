// The WebSocket to web_node: updates come in, requests go out, and a lost connection is made again.

const RETRY_MS = 1000;

export class Link {
  /**
   * onUpdate(update) gets {number, images, state, slow, available}; onStatus(connected, text) a change of the
   * connection.
   */
  constructor(onUpdate, onStatus) {
    this.onUpdate = onUpdate;
    this.onStatus = onStatus;
    this.answers = new Map();
    this.number = 0;
    this.greeting = [];
    this.connect();
  }

  connect() {
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    this.socket = new WebSocket(`${scheme}://${location.host}/socket`);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.onStatus(true, "connected");
      for (const request of this.greeting) this.ask(request);
    };
    this.socket.onmessage = (event) => {
      if (typeof event.data === "string") this.onAnswer(JSON.parse(event.data));
      else this.onUpdate(decode(event.data));
    };
    this.socket.onclose = () => {
      this.onStatus(false, "web_node is gone: trying again");
      for (const on of this.answers.values()) on({ ok: false, text: "the connection was lost", last: true });
      this.answers.clear();
      setTimeout(() => this.connect(), RETRY_MS);
    };
  }

  /** Send a request; onAnswer(answer) is called with each answer to it. Returns false without a connection. */
  ask(request, onAnswer = () => {}) {
    if (this.socket.readyState !== WebSocket.OPEN) {
      onAnswer({ ok: false, text: "not connected", last: true });
      return false;
    }
    this.number += 1;
    this.answers.set(this.number, onAnswer);
    this.socket.send(JSON.stringify({ ...request, id: this.number }));
    return true;
  }

  /** Report that an update is on the screen: the next one is sent then. */
  drawn(number, latencySeconds) {
    if (this.socket.readyState !== WebSocket.OPEN) return;
    const latency = Number.isFinite(latencySeconds) ? { latency_s: latencySeconds } : {};
    this.socket.send(JSON.stringify({ do: "drawn", id: 0, update: number, ...latency }));
  }

  onAnswer(answer) {
    const on = this.answers.get(answer.answer);
    if (!on) return;
    if (answer.last) this.answers.delete(answer.answer);
    on(answer);
  }
}

/** Split a binary update: uint32 length, JSON header, then the images' bytes in the header's order. */
function decode(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const update = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let offset = 4 + length;
  for (const image of update.images) {
    image.blob = new Blob([new Uint8Array(buffer, offset, image.bytes)], { type: "image/jpeg" });
    offset += image.bytes;
  }
  return update;
}
