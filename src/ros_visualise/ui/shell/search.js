// Search (Ctrl-K): panels, topics, parameters, actions and times; Enter opens the first.
const MOST = 12;
const WORDS = { parameters: "parameter", actions: "action", topics: "topic", panels: "panel", time: "go to" };

// 1:02:03.4, 2:03 or 12.5 as seconds; NaN for other texts.
function seconds(text) {
  if (!/^\d+(:\d{1,2}){0,2}(\.\d+)?$/.test(text)) return NaN;
  return text.split(":").reduce((sum, part) => sum * 60 + Number(part), 0);
}

export default {
  template: `
    <q-dialog v-model="isOpen" position="top" @show="$refs.field.focus()" @hide="hidden">
      <q-card class="rv-search" role="search">
        <input ref="field" v-model="words" type="search" placeholder="Panel, topic, parameter, action or time" aria-label="Search the page"
          aria-controls="rv-found" @keydown.down.prevent="move(1)" @keydown.up.prevent="move(-1)" @keydown.enter.prevent="choose(found[at])">
        <div id="rv-found" role="listbox" aria-label="Results">
          <button v-for="(one, i) in found" :key="one.kind + one.name" role="option" :aria-selected="String(i === at)"
            :class="{ 'rv-chosen': i === at }" :title="one.help" @click="choose(one)"><small>{{ one.word }}</small> {{ one.name }}</button>
          <p v-if="words && !found.length">No results</p>
        </div>
      </q-card>
    </q-dialog>`,
  props: { kinds: Object, readOnly: Boolean },
  data: () => ({ isOpen: false, words: "", at: 0 }),
  computed: {
    all() {
      if (!this.isOpen) return [];
      const { topics = [], parameters = [], actions = [] } = rv.offered.state;
      const panels = Object.entries(this.kinds).map(([kind, { title }]) => ({ kind: "panels", name: title, panel: kind }));
      const found = [
        ...panels,
        ...topics.map(([name, type]) => ({ kind: "topics", name, help: type })),
        ...parameters.map(([node, name, help]) => ({ kind: "parameters", name: `${node}/${name}`, node, help })),
        ...(this.readOnly ? [] : actions.map(([node, action, help]) => ({ kind: "actions", name: `${node}/${action}`, node, help }))),
      ];
      return found.map((one) => ({ ...one, word: WORDS[one.kind], text: `${one.name} ${one.help ?? ""}`.toLowerCase() }));
    },
    found() {
      const words = this.words.toLowerCase().trim();
      const to = seconds(words);
      const time = Number.isNaN(to) || this.readOnly ? [] : [{ kind: "time", word: WORDS.time, name: words, to }];
      const parts = words.split(/\s+/);
      const fits = this.all.filter(({ text }) => parts.every((part) => text.includes(part)));
      // Whole names, then parts of names, then what things do.
      const rank = ({ name }) => (`/${name.toLowerCase()}`.endsWith(`/${words}`) ? 0 : name.toLowerCase().includes(words) ? 1 : 2);
      return [...time, ...fits.sort((a, b) => rank(a) - rank(b))].slice(0, MOST);
    },
  },
  watch: {
    words() { this.at = 0; },
  },
  mounted() {
    this.pressed = (event) => {
      if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "k") return;
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
  },
  methods: {
    move(by) {
      this.at = Math.min(Math.max(this.at + by, 0), this.found.length - 1);
    },
    choose(one) {
      if (!one) return;
      const kind = /Image$/.test(one.help) ? "image" : "messages";
      ({
        panels: () => rv.open(one.panel),
        topics: () => rv.open(kind, { topic: one.name }),
        parameters: () => this.reveal(one.node, one.name),
        actions: () => this.reveal(one.node, one.name),
        time: () => rv.clock.seek(one.to),
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
      this.sought = null;
    },
  },
};
