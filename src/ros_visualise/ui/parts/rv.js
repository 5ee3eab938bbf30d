// What all panels use, as window.rv: WebSockets, queries, the clock, the cursor, undo, the workspace.
(() => {
  const RETRY_MS = 1000;
  const NEAR_S = 60; // further outside of what is played, a stamp is of another clock
  const EPOCH_S = 1e8; // stamps below count from some start
  const root = location.pathname.replace(/\/$/, "");

  // A WebSocket of the page that comes back by itself. Text is JSON, binary an ArrayBuffer.
  function live(path, { message = () => {}, open = () => {}, closed = () => {} } = {}) {
    let socket, isGone;
    const connect = () => {
      socket = new WebSocket(`${location.origin.replace("http", "ws")}${root}${path}`);
      socket.binaryType = "arraybuffer";
      socket.onopen = () => open();
      socket.onmessage = ({ data }) => message(typeof data === "string" ? JSON.parse(data) : data);
      socket.onclose = () => {
        if (isGone) return;
        closed();
        setTimeout(() => isGone || connect(), RETRY_MS);
      };
    };
    connect();
    return {
      send: (value) => socket.readyState === WebSocket.OPEN && socket.send(JSON.stringify(value)),
      close: () => {
        isGone = true;
        socket.close();
      },
    };
  }

  // The answer to a query, as JSON; rejected with the reason that the server gives.
  async function ask(query) {
    const answer = await fetch(`${root}/?${new URLSearchParams(query)}`, { headers: { "X-Ros-Visualise": "1" } });
    if (!answer.ok) throw new Error(await answer.text());
    return answer.json();
  }

  // The playback: its state as the server sends it, or {}; "change" tells of another one, "begun" of
  // another stamp of its start.
  class Clock extends EventTarget {
    state = {};
    begin() {
      this.socket = live("/live/clock", {
        message: (state) => {
          const isBegun = state.start !== this.state.start;
          this.state = state;
          this.dispatchEvent(new Event("change"));
          if (isBegun) this.dispatchEvent(new Event("begun"));
        },
      });
    }
    act(message) {
      this.socket?.send(message);
    }
    seek(seconds) {
      this.act({ seek: seconds });
    }
  }

  // What the server offers: title, standard layout, topics, parameters, actions; "change" when it differs.
  class Offered extends EventTarget {
    state = {};
    begin() {
      this.socket = live("/live/offered", {
        open: () => this.isSeen && this.seen(),
        message: (state) => {
          this.state = state;
          document.title = state.title;
          this.dispatchEvent(new Event("change"));
        },
      });
    }
    // Tell that the panels are there, for which playing waits.
    seen() {
      this.isSeen = true;
      this.socket.send({ seen: true });
    }
  }

  // The time that a person points at in any panel, s from the recording's start, or null; "move".
  class Cursor extends EventTarget {
    at = null;
    move(at) {
      if (at === this.at) return;
      this.at = at;
      this.dispatchEvent(new Event("move"));
    }
  }

  // What a person did, in all of the page; each is {undo, redo}. "change" tells of another state. What is
  // `underWay`, a number of changes, is noted once the server has answered; until then undo and redo wait.
  class EditHistory extends EventTarget {
    done = [];
    undone = [];
    waiting = [];
    underWay = 0;
    did(step) {
      this.done = [...this.done.slice(-99), step];
      this.undone = [];
      this.dispatchEvent(new Event("change"));
    }
    undo() {
      this.step("done", "undone", "undo");
    }
    redo() {
      this.step("undone", "done", "redo");
    }
    setUnderWay(count) {
      this.underWay = count;
      while (this.waiting.length && !this.underWay) this.step(...this.waiting.shift());
    }
    step(from, to, way) {
      if (this.underWay) return this.waiting.push([from, to, way]);
      const step = this[from].pop();
      if (!step) return;
      if (step[way]() === false) return this[from].push(step); // there is no connection
      this[to].push(step);
      this.dispatchEvent(new Event("change"));
    }
  }

  // A time as people read it: 0:12.94, 1:02:03.40.
  function asClock(seconds) {
    const whole = Math.max(0, Math.round(seconds * 100));
    const two = (value) => String(value).padStart(2, "0");
    const [hours, minutes] = [Math.floor(whole / 360000), Math.floor(whole / 6000) % 60];
    const rest = `${two(Math.floor(whole / 100) % 60)}.${two(whole % 100)}`;
    return hours ? `${hours}:${two(minutes)}:${rest}` : `${minutes}:${rest}`;
  }

  // A stamp in ns as people read it: the time since the start of what is played, else the time of day.
  function asTime(stamp) {
    const { start, duration } = rv.clock.state; // a simulation has no duration
    const [seconds, since] = [Number(stamp) / 1e9, Number(stamp) / 1e9 - (start ?? NaN)];
    if (since > -NEAR_S && since < (duration ?? Infinity) + NEAR_S) return asClock(since);
    if (seconds < EPOCH_S) return asClock(seconds);
    return new Date(seconds * 1000).toLocaleTimeString("en-GB") + (seconds % 1).toFixed(3).slice(1);
  }

  const isTyping = (target) => !!target?.closest?.("input:not([type=range]):not([type=checkbox]), textarea, select, [contenteditable]");
  const past = new EditHistory();
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || event.altKey || isTyping(event.target)) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    key === "y" || event.shiftKey ? past.redo() : past.undo();
  });

  // The topic and the field that are dropped on a panel, or an empty topic.
  function dropped(event, topics) {
    const text = event.dataTransfer.getData("text/rv-topic");
    const topic = Object.keys(topics).filter((one) => text === one || text.startsWith(`${one}.`)).sort((a, b) => b.length - a.length)[0] ?? "";
    return [topic, text.slice(topic.length + 1)];
  }

  // A panel of what the nodes report, from a level on and with some words; it shows what it can `take`.
  const monitored = (what, levels, first) => ({
    props: { state: Object, readOnly: Boolean },
    data() {
      const { level, words } = this.state;
      return { levels, level: levels.includes(level) ? level : first, words: String(words ?? "") };
    },
    mounted() {
      const open = () => (this.begin?.(), this.live.send({ show: what }));
      this.live = live("/live/monitor", { open, message: (news) => this.take(news) });
    },
    beforeUnmount() {
      this.live.close();
    },
    methods: {
      keep() {
        rv.keep(this.$el, { level: this.level, node: this.node || undefined, words: this.words || undefined });
      },
      passes(rank, text) {
        return rank >= levels.indexOf(this.level) && text.toLowerCase().includes(this.words.toLowerCase());
      },
    },
  });

  window.rv = {
    root,
    live,
    ask,
    asClock,
    asTime,
    isTyping,
    dropped,
    monitored,
    past,
    clock: new Clock(),
    cursor: new Cursor(),
    offered: new Offered(),
    // Keep a panel's state in the address: what is given replaces what it had under the same names.
    keep: (element, state) => element.dispatchEvent(new CustomEvent("rv-keep", { bubbles: true, detail: state })),
    // Show a panel of this kind whose state `serves`, else open one with this state; its number.
    open(kind, state = {}, serves = () => false) {
      const detail = { kind, state, serves };
      document.dispatchEvent(new CustomEvent("rv-open", { detail }));
      return detail.id;
    },
    // Draw a curve in a plot that is seen, else in a new one.
    plot(curve) {
      const isNew = document.dispatchEvent(new CustomEvent("rv-plot", { detail: curve, cancelable: true }));
      if (isNew) rv.open("plots", { panes: [{ curves: [curve] }] });
    },
  };
  rv.clock.begin();
  rv.offered.begin();
})();
