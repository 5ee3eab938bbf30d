// Search (Ctrl-K or ?): panels, buttons, topics, fields, parameters, actions, files, marks, times, and the texts of
// messages; Enter opens the first. Before a word is typed, the page's keys are listed.
const MOST = 12;
const MOST_TOPICS = 100; // whose fields are found
const MOST_TEXTS = 6;
const [SHORTEST, WAIT_MS, AGAIN_MS] = [3, 200, 500]; // of what is looked up in texts
const WORDS = { parameters: "parameter", actions: "action", topics: "topic", panels: "panel", fields: "field", files: "file", controls: "button", time: "go to", lines: "log", texts: "message" };
const SKIPPED = new Set("a all an and another change do find for get go how i in into is it make me my of on other see show the to use want with".split(" "));
const KEYS = [
  ["Space", "play or pause"], [", .", "one frame back or forward"], ["← →", "5 s back or forward; with Shift, 1 s"], ["Home End", "start or end"],
  ["< >", "slower or faster"], ["M", "set a mark"], ["[ ]", "start or end of the playback range"], ["F6", "next part of the page; with Shift, previous part"],
  ["Delete", "close the panel whose tab has the focus"], ["Ctrl+Z", "undo; with Shift, redo"], ["Ctrl+K ?", "search"],
];
const CONTROLS = "button[aria-label], select[aria-label], input[aria-label], .q-btn";
const NOT_CONTROLS = ".rv-search *, .rv-kinds *, .rv-close, [role=tab], [data-name] *, .rv-fields *";
const ELSEWHERE = 0.6; // worth of a word of what something does, beside one of its name

// 1:02:03.4, 2:03 or 12.5 as seconds; NaN for other texts.
function seconds(text) {
  if (!/^\d+(:\d{1,2}){0,2}(\.\d+)?$/.test(text)) return NaN;
  return text.split(":").reduce((sum, part) => sum * 60 + Number(part), 0);
}

const tokens = (text) => text.toLowerCase().match(/[\p{L}\d]+/gu) ?? [];
const stem = (word) => word.match(/^.+?(?=(e?s|ing|ed|er)?$)/)[0];

// True if one letter is missing, added, wrong, or swapped with its neighbour.
function isTypo(a, b) {
  if (a.length < 5 || Math.abs(a.length - b.length) > 1) return false;
  let from = 0;
  while (from < a.length && a[from] === b[from]) from++;
  const rest = [a.slice(from), b.slice(from)];
  return rest[0].slice(1) === rest[1].slice(1) || rest[0].slice(1) === rest[1] || rest[0] === rest[1].slice(1) ||
    (rest[0].slice(2) === rest[1].slice(2) && rest[0][0] === rest[1][1] && rest[0][1] === rest[1][0]);
}

// How well a word fits one of these, 0 to 1.
function fit(word, all) {
  const one = (token) => {
    if (token === word) return 1;
    if (stem(token) === stem(word)) return 0.95;
    if (token.startsWith(word)) return 0.8;
    if (stem(token).length > 3 && word.startsWith(stem(token))) return 0.6;
    if (word.length > 2 && token.includes(word)) return 0.4;
    return isTypo(word, token) ? 0.3 : 0;
  };
  return Math.max(0, ...all.map(one));
}

// What a person may want, the best first: those that have most of the words, at least half, then those that fit best.
function ranked(all, words) {
  const scored = all.map((one, i) => {
    const fits = words.map((word) => Math.max(fit(word, one.names), ELSEWHERE * fit(word, one.others)));
    const whole = words.filter((word) => fit(word, one.names)).length / (one.names.length || 1);
    const sum = fits.reduce((before, more) => before + more, 0);
    return { one, i, count: fits.filter(Boolean).length, score: sum + 0.3 * whole };
  });
  const most = Math.max(words.length / 2, ...scored.map(({ count }) => count));
  return scored.filter(({ count }) => count === most).sort((a, b) => b.score - a.score || a.i - b.i).map(({ one }) => one);
}

export default {
  template: `
    <q-dialog v-model="isOpen" position="top" aria-label="Search" @hide="hidden">
      <q-card class="rv-search" role="search">
        <input autofocus v-model="words" type="search" placeholder="Panel, button, topic, parameter, file, time or text" aria-label="Search the page"
          aria-controls="rv-found" @keydown.down.prevent="move(1)" @keydown.up.prevent="move(-1)" @keydown.enter.prevent="choose(found[at])">
        <div id="rv-found" role="listbox" aria-label="Results">
          <button v-for="(one, i) in found" :key="one.kind + one.name + (one.key ?? '')" role="option" :aria-selected="String(i === at)"
            :class="{ 'rv-chosen': i === at }" :title="one.help" @click="choose(one)"><small>{{ one.word }}</small> {{ one.name }}</button>
          <p v-if="words && !found.length">No results on this page. For all commands, run <code>ros-visualise --help</code>.</p>
        </div>
        <table v-if="!words" class="rv-keys"><caption>Keyboard shortcuts</caption>
          <tr v-for="[keys, act] in keys" :key="keys"><th scope="row"><kbd v-for="key in keys.split(' ')">{{ key }}</kbd></th><td>{{ act }}</td></tr></table>
      </q-card>
    </q-dialog>`,
  props: { kinds: Object, readOnly: Boolean },
  data: () => ({ isOpen: false, words: "", at: 0, fields: {}, files: [], controls: [], lines: [], texts: [] }),
  computed: {
    keys: () => KEYS,
    all() {
      if (!this.isOpen) return [];
      const { topics = [], parameters = [], actions = [] } = rv.offered.state;
      const found = [
        ...Object.entries(this.kinds).map(([kind, { title, help }]) => ({ kind: "panels", name: title, help, panel: kind })),
        ...this.controls,
        ...parameters.map(([node, name, help]) => ({ kind: "parameters", name: `${node}/${name}`, node, help })),
        ...(this.readOnly ? [] : actions.map(([node, action, help]) => ({ kind: "actions", name: `${node}/${action}`, node, help }))),
        ...topics.map(([name, type]) => ({ kind: "topics", name, help: type })),
        ...this.files.map((name) => ({ kind: "files", name })),
        ...(rv.clock.state.marks ?? []).map(([to, name]) => ({ kind: "time", name, to })),
        ...Object.entries(this.fields).flatMap(([topic, paths]) => paths.map((path) => ({ kind: "fields", name: `${topic}:${path}` }))),
      ];
      return found.map((one) => ({ ...one, word: WORDS[one.kind], names: tokens(one.name), others: tokens(one.help ?? "") }));
    },
    found() {
      const words = this.words.toLowerCase().trim();
      const to = seconds(words);
      const time = Number.isNaN(to) || this.readOnly ? [] : [{ kind: "time", word: WORDS.time, name: words, to }];
      const several = tokens(words);
      const meant = several.filter((word) => !SKIPPED.has(word));
      const names = words ? ranked(this.all, meant.length ? meant : several) : [];
      const said = [...this.lines.filter(({ name }) => several.every((word) => name.toLowerCase().includes(word))).slice(-MOST_TEXTS), ...this.texts].slice(0, MOST_TEXTS);
      return words ? [...time, ...names.slice(0, MOST - said.length), ...said] : [];
    },
  },
  watch: {
    words() {
      this.at = 0;
      this.texts = [];
      clearTimeout(this.asking);
      this.asking = setTimeout(() => this.askTexts(this.words.trim()), WAIT_MS);
    },
    isOpen() { this.isOpen ? this.gather() : this.leave(); },
  },
  mounted() {
    this.pressed = (event) => {
      const isK = (event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "k";
      if (!isK && (event.key !== "?" || rv.isTyping(event.target))) return;
      event.preventDefault();
      this.isOpen = !this.isOpen;
    };
    this.asked = () => (this.isOpen = true);
    document.addEventListener("keydown", this.pressed);
    document.addEventListener("rv-search", this.asked);
  },
  beforeUnmount() {
    document.removeEventListener("keydown", this.pressed);
    document.removeEventListener("rv-search", this.asked);
    this.leave();
  },
  methods: {
    // Look up what can be found: buttons that are seen, fields of topics, and files.
    gather() {
      const seen = [...document.querySelectorAll(CONTROLS)].filter((one) => one.offsetParent && !one.matches(NOT_CONTROLS));
      const named = seen.map((element) => [element.getAttribute("aria-label") || element.innerText.trim(), element]);
      this.controls = [...new Map(named)].map(([name, element]) => ({ kind: "controls", name, help: element.title, element }));
      this.fields = {};
      const topics = (rv.offered.state.topics ?? []).map(([topic]) => topic).slice(0, MOST_TOPICS);
      const ask = () => topics.length && this.plots?.send({ fields: topics.shift() });
      this.plots = rv.live("/live/plots", {
        open: ask,
        message: ({ fields, paths }) => {
          if (!fields) return;
          if (paths) this.fields[fields] = paths;
          ask();
        },
      });
      this.lines = [];
      const take = ({ lines = [] }) => this.lines.push(...lines.map(({ number, node, text }) => ({ kind: "lines", word: WORDS.lines, name: `${node} ${text}`, key: number, text })));
      this.log = rv.live("/live/monitor", { open: () => this.log.send({ show: "log" }), message: take });
      if (this.readOnly) return;
      this.opening = rv.live("/live/files", { message: (messages) => messages.forEach(({ files }) => files && (this.files = files)) });
    },
    leave() {
      clearTimeout(this.asking);
      for (const live of [this.plots, this.opening, this.log]) live?.close();
    },
    // The texts of messages, again while a recording is being read.
    async askTexts(words) {
      if (words.length < SHORTEST || this.readOnly) return;
      const { found = [], share = 1 } = await rv.ask({ ask: "texts", words }).catch(() => ({}));
      if (!this.isOpen || words !== this.words.trim()) return;
      this.texts = found.map(([to, topic, text], i) => ({ kind: "texts", word: WORDS.texts, name: `${rv.asClock(to)}  ${topic}  ${text}`, to, topic, key: i }));
      if (share < 1) this.asking = setTimeout(() => this.askTexts(words), AGAIN_MS);
    },
    move(by) {
      this.at = Math.min(Math.max(this.at + by, 0), this.found.length - 1);
    },
    choose(one) {
      if (!one) return;
      const kind = /Image$/.test(one.help) ? "image" : "messages";
      ({
        panels: () => (this.opened = rv.open(one.panel)),
        controls: () => (this.pressing = one.element),
        topics: () => (this.opened = rv.open(kind, { topic: one.name })),
        fields: () => rv.plot(one.name),
        files: () => this.opening.send({ do: "open", name: one.name, add: false }),
        parameters: () => this.reveal(one.node, one.name),
        actions: () => this.reveal(one.node, one.name),
        time: () => rv.clock.seek(one.to),
        lines: () => rv.open("log", { words: one.text }),
        texts: () => {
          rv.clock.seek(one.to);
          rv.open("messages", { topic: one.topic });
        },
      })[one.kind]();
      this.isOpen = false;
      this.words = "";
    },
    reveal(node, name) {
      rv.open("nodes", {}, ({ nodes }) => !nodes || nodes.includes(node));
      this.sought = [node, name];
    },
    // The dialog has given the focus back by now.
    hidden() {
      if (this.sought) rv.nodes.reveal(...this.sought);
      (this.pressing ?? document.querySelector(`#rv-tab-${this.opened}`))?.focus();
      if (this.pressing?.matches("button")) this.pressing.click();
      this.sought = this.pressing = this.opened = null;
    },
  },
};
