// Parameters, actions and texts of the nodes for all panels, as rv.nodes; notices, as toasts too; and the
// settings that were changed, in the page's address behind the #.
(() => {
  const MOST_IN_ADDRESS = 4000;
  const MOST_TOASTS = 4;
  const TOAST_MS = 10_000;
  const WRITE_MS = 300; // browsers take few new addresses a second
  const isForeign = () => !!document.getElementById("rv-foreign");

  // "change" tells of anything that is another; objects inside are replaced, never changed.
  class Nodes extends EventTarget {
    names = [];
    about = {}; // node -> help, params, actions, texts
    values = {}; // node -> parameter -> value, as those below
    first = {};
    unused = {};
    drafts = {}; // "node/parameter" -> what was set here, until the server has answered
    reasons = {}; // "node/parameter" -> why the last value was rejected
    texts = {}; // topic -> HTML
    notices = [];
    presets = [];
    preset = "";
    readOnly = false;
    sought = null;

    begin() {
      this.count = 0;
      this.sent = new Map(); // number -> what to do with the answer
      this.readers = new Map();
      this.socket = rv.live("/live/nodes", {
        open: () => this.read(),
        message: (messages) => {
          for (const message of messages) this.take(message);
          this.changed();
        },
        closed: () => {
          this.drafts = {};
          this.sent.clear();
          rv.past.waiting = []; // there is nobody to undo it
          rv.past.setUnderWay(0);
          this.run = null; // an address that was not restored yet is restored when it is back
          this.changed();
        },
      });
    }

    changed() {
      this.dispatchEvent(new Event("change"));
    }

    shown(node, name) {
      return this.drafts[`${node}/${name}`]?.value ?? this.values[node]?.[name];
    }

    isChanged(node, name) {
      return this.values[node]?.[name] !== this.first[node]?.[name];
    }

    // Set a parameter; values of one stroke, such as a drag, are undone as one. One is under way at a time.
    set(node, name, value, stroke) {
      const key = `${node}/${name}`;
      const draft = this.drafts[key];
      this.drafts = { ...this.drafts, [key]: { ...draft, value, isNew: true, stroke } };
      if (!draft) this.sendDraft(node, name);
      this.changed();
    }

    sendDraft(node, name) {
      const key = `${node}/${name}`;
      const { value, stroke } = this.drafts[key];
      this.drafts = { ...this.drafts, [key]: { value, stroke, isNew: false } };
      const drop = () => {
        const { [key]: _, ...others } = this.drafts;
        this.drafts = others;
      };
      const isSent = this.ask("set", { values: { [node]: { [name]: value } } }, stroke, ({ reason }) => {
        this.reasons = { ...this.reasons, [key]: reason };
        if (this.drafts[key]?.isNew) this.sendDraft(node, name);
        else drop();
      });
      if (!isSent) drop();
    }

    reset(node, name = "") {
      this.ask("reset", { node, name });
    }

    choose(preset) {
      this.ask("preset", { name: preset });
    }

    act(node, action) {
      if (!this.readOnly) this.socket.send({ do: "act", node, action });
    }

    // Have a panel show a parameter or an action, by "node/name"; one that opens now finds it in `sought`.
    reveal(node, name) {
      this.sought = { node, name };
      this.dispatchEvent(new Event("reveal"));
    }

    // Send the texts of these topics; `reader` shows them.
    read(reader = null, topics = []) {
      if (reader) topics.length ? this.readers.set(reader, topics) : this.readers.delete(reader);
      this.socket.send({ do: "read", topics: [...new Set([...this.readers.values()].flat())] });
    }

    ask(what, request, stroke = "", then = () => {}) {
      const before = this.values;
      const number = ++this.count;
      if (this.readOnly || this.socket.send({ do: what, ...request, number }) === false) return false;
      this.sent.set(number, (answer) => {
        then(answer);
        this.note(before, answer.after, stroke);
      });
      rv.past.setUnderWay(this.sent.size);
      return true;
    }

    take(message) {
      if (message.graph) this.takeGraph(message);
      else if (message.node) this.about = { ...this.about, [message.node]: message };
      else if (message.of) {
        for (const what of ["values", "first", "unused"]) this[what] = { ...this[what], [message.of]: message[what] };
      } else if (message.topic) this.texts = { ...this.texts, [message.topic]: message.html };
      else if (message.notices) this.takeNotices(message.notices);
      else if ("done" in message) {
        this.sent.get(message.done)?.(message);
        this.sent.delete(message.done);
        rv.past.setUnderWay(this.sent.size);
      } else Object.assign(this, message);
    }

    takeGraph({ graph, run }) {
      const there = (by) => Object.fromEntries(Object.entries(by).filter(([node]) => graph.includes(node)));
      this.names = graph;
      for (const what of ["about", "values", "first", "unused"]) this[what] = there(this[what]);
      if (run !== this.run) this.restoreOnce((this.run = run));
    }

    takeNotices(notices) {
      const last = this.notices.at(-1)?.[0] ?? (this.isTold ? 0 : Infinity);
      this.isTold = true;
      this.notices = notices;
      for (const [, , level, text] of notices.filter(([number]) => number > last).slice(-MOST_TOASTS)) toast(level, text);
    }

    // Make a change of ours undoable.
    note(before, after, stroke) {
      const old = {};
      for (const [node, values] of Object.entries(after)) {
        const names = Object.keys(values).filter((name) => before[node] && name in before[node]);
        if (names.length) old[node] = Object.fromEntries(names.map((name) => [name, before[node][name]]));
      }
      if (!Object.keys(old).length) return;
      const { last } = this;
      const merged = (one, other) => Object.fromEntries([...new Set([...Object.keys(one), ...Object.keys(other)])].map((node) => [node, { ...one[node], ...other[node] }]));
      if (stroke && last?.stroke === stroke && rv.past.done.at(-1) === last.step) {
        last.before = merged(old, last.before);
        last.after = merged(last.after, after);
        return;
      }
      const made = (this.last = { stroke, before: old, after });
      const put = (values) => this.socket.send({ do: "set", values });
      made.step = { undo: () => put(made.before), redo: () => put(made.after) };
      rv.past.did(made.step);
    }

    // The address: one that was opened is sent to the program, once; then it follows the program.
    get address() {
      const found = [];
      for (const node of this.names)
        for (const [name, value] of Object.entries(this.values[node] ?? {}))
          if (this.isChanged(node, name)) found.push([`${node}/${name}`, value]);
      const { part = [], first_part: first = [] } = rv.clock.state;
      if (String(part) !== String(first)) ["start", "end"].forEach((name, at) => found.push([`playback range/${name}`, part[at] ?? 0]));
      const words = (text) => encodeURIComponent(text).replace(/%2F|%2C|%3A/g, decodeURIComponent);
      let address = "";
      for (const [place, value] of found) {
        const more = `${address && "&"}${words(place)}=${words(shownInAddress(value))}`;
        if (address.length + more.length <= MOST_IN_ADDRESS) address += more;
      }
      return address;
    }

    restoreOnce(run) {
      const opened = this.wasOpened ? location.hash : (location.hash || sessionStorage.getItem("rv-opened") || "");
      const isOwn = this.isShown(run, opened);
      this.wasOpened = true;
      this.isWriting = false;
      if (opened.length > 1 && !isForeign() && !this.readOnly && !isOwn) {
        sessionStorage.setItem("rv-opened", opened);
        this.restore(opened);
      } else this.isWriting = true;
    }

    // Whether this tab wrote an address itself; a page that is loaded again may write one more meanwhile.
    isShown(run, opened) {
      const { run: of, now, before, at } = JSON.parse(sessionStorage.getItem("rv-shown") ?? "{}");
      return of === run && (opened === now || (opened === before && at > performance.timeOrigin - WRITE_MS));
    }

    restore(hash) {
      const values = Object.fromEntries(new URLSearchParams(hash.replace(/^#/, "")));
      this.ask("restore", { values }, "", () => (this.isWriting = true));
    }

    write() {
      this.writing ??= setTimeout(() => {
        this.writing = null;
        if (this.isWriting && this.run) this.writeNow();
      }, WRITE_MS);
    }

    writeNow() {
      const { address, run } = this;
      const before = location.hash || "#";
      if (`#${address}` !== before) history.replaceState(null, "", location.pathname + location.search + (address && `#${address}`));
      sessionStorage.setItem("rv-shown", JSON.stringify({ run, now: `#${address}`, before, at: Date.now() }));
      sessionStorage.removeItem("rv-opened");
    }
  }

  const shownInAddress = (value) => (typeof value === "boolean" ? (value ? "True" : "False") : String(value));

  // A notice takes the place of the one that differs by its numbers alone, as while a slider is dragged.
  const toasts = new Map(); // text without its numbers -> what removes its toast
  function toast(level, text) {
    const about = text.replace(/-?\d[\d.]*/g, "");
    const before = toasts.get(about) ?? (toasts.size >= MOST_TOASTS && [...toasts.values()][0]);
    if (before) before();
    const type = level === "warning" ? "warning" : "negative";
    const onDismiss = () => toasts.get(about) === dismiss && toasts.delete(about);
    const dismiss = Quasar.Notify.create({ message: text, type, position: "top", timeout: TOAST_MS, onDismiss });
    toasts.set(about, dismiss);
  }

  const nodes = (rv.nodes = new Nodes());
  nodes.begin();
  nodes.addEventListener("change", () => nodes.write());
  rv.clock.addEventListener("change", () => {
    const { state } = rv.clock;
    const part = String([state.part, state.first_part]);
    if (part !== nodes.part) nodes.write((nodes.part = part));
  });
  // The address may have been written anew since.
  window.addEventListener("hashchange", ({ newURL }) => isForeign() || nodes.restore(new URL(newURL).hash));
})();
