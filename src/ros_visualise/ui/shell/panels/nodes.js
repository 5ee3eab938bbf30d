// Parameters of the nodes: sliders with a number beside, switches, choices and texts; their actions and
// texts. What is typed counts on Enter, or when the field is left.
const DIGITS = 12;

function written(value) {
  if (typeof value !== "number" || Number.isInteger(value)) return String(value ?? "");
  return String(Number(value.toPrecision(DIGITS)));
}

const Param = {
  template: `
    <div class="rv-param" tabindex="-1" :data-name="node + '/' + param.name" :class="{ 'rv-unused': unused }" :title="param.help + (unused ? ' (currently has no effect)' : '')">
      <label :for="id">{{ param.label }}</label>
      <span class="rv-input">
        <q-toggle v-if="param.kind === 'bool'" dense :model-value="value" :disable="locked" :aria-label="param.label" @update:model-value="set" />
        <select v-else-if="param.kind === 'choice'" :id="id" :value="value" :disabled="locked" @change="set($event.target.value)">
          <option v-for="choice in param.choices" :key="choice">{{ choice }}</option>
        </select>
        <template v-else>
          <input v-if="isSlider" type="range" :min="Math.min(param.low, value)" :max="Math.max(param.high, value)" :step="param.step" :value="value"
            :disabled="locked" :aria-label="param.label" @input="slide" @change="stroke = ''">
          <input :id="id" class="rv-typed" :class="{ 'rv-long': param.kind === 'str' }" type="text" autocomplete="off" spellcheck="false"
            :inputmode="param.kind === 'str' ? 'text' : 'decimal'" :value="typed ?? shown" :disabled="locked" :aria-invalid="String(!!problem)"
            @input="typed = $event.target.value" @change="take" @blur="typed = null" @keydown.enter="take" @keydown.escape="leave"
            @keydown.up="nudge($event, 1)" @keydown.down="nudge($event, -1)">
        </template>
      </span>
      <button class="rv-reset" :class="{ 'rv-hidden': !changed || locked }" :disabled="!changed || locked" :title="'Reset to ' + first"
        :aria-label="'Reset ' + param.label" @click="$emit('reset')">↺</button>
      <p v-if="problem" class="rv-problem" role="alert">{{ problem }}</p>
    </div>`,
  props: { node: String, param: Object, value: [Number, String, Boolean], initial: [Number, String, Boolean], unused: Boolean, readOnly: Boolean, reason: String },
  emits: ["set", "reset"],
  data: () => ({ typed: null, stroke: "", own: "" }),
  computed: {
    id() { return `rv-${this.node}-${this.param.name}`; },
    locked() { return this.readOnly || this.unused; },
    isSlider() { return "low" in this.param && typeof this.value === "number"; },
    shown() { return written(this.value); },
    first() { return written(this.initial); },
    changed() { return this.value !== this.initial; },
    problem() { return this.own || this.reason; },
  },
  methods: {
    set(value, stroke = "") {
      this.own = "";
      this.$emit("set", value, stroke);
    },
    slide({ target }) {
      this.stroke ||= Math.random().toString(36).slice(2);
      this.set(this.whole(Number(target.value)), this.stroke);
    },
    whole(value) {
      return this.param.kind === "int" ? Math.round(value) : Number(value.toPrecision(DIGITS));
    },
    take({ target }) {
      const text = this.typed?.trim();
      this.typed = null;
      if (text === undefined || text === this.shown) return;
      if (this.param.kind === "str") return this.set(text);
      const value = Number(text.includes(".") ? text : text.replace(",", "."));
      if (text && Number.isFinite(value)) return this.set(value);
      this.own = text ? "Not a number" : "";
      target.value = this.shown;
    },
    leave({ target }) {
      this.typed = null;
      this.own = "";
      target.value = this.shown;
    },
    nudge(event, way) {
      if (this.param.kind === "str" || typeof this.value !== "number") return;
      event.preventDefault();
      this.typed = null;
      const value = this.value + way * (this.param.step ?? (this.param.kind === "int" ? 1 : 0.1));
      this.set(this.whole(Math.min(Math.max(value, this.param.min ?? -Infinity), this.param.max ?? Infinity)));
    },
  },
};

export default {
  components: { ParamRow: Param },
  template: `
    <div class="rv-nodes">
      <div class="rv-bar-top">
        <input type="search" v-model="words" placeholder="Find a parameter" aria-label="Find a parameter" @keydown.escape="words = ''">
        <select v-if="all.presets.length" :value="all.preset" :disabled="readOnly" aria-label="Preset" title="A preset sets the parameters of filters and edge_detector together"
          @change="choose">
          <option value="" disabled>Custom</option>
          <option v-for="name in all.presets" :key="name">{{ name }}</option>
        </select>
      </div>
      <p v-if="only" class="rv-note">Only {{ only.join(", ") }} <button @click="show(null)">Show all</button></p>
      <p v-if="!shown.length" class="rv-note">{{ words ? "No parameter matches." : "There are no nodes with parameters." }}</p>
      <details v-for="node in shown" :key="node.node" :open="isOpen(node.node)" @toggle="toggled(node.node, $event)">
        <summary :title="node.help">{{ node.node }}
          <button v-if="!readOnly && isChanged(node)" class="rv-reset" :title="'Reset all parameters of ' + node.node" :aria-label="'Reset ' + node.node" @click.prevent="store.reset(node.node)">↺</button>
        </summary>
        <template v-if="isOpen(node.node)">
          <template v-for="group in node.groups" :key="group.name">
            <component :is="group.name ? 'details' : 'div'" class="rv-group" :open="group.name && isWithin(node, group) || undefined" @toggle.stop="grouped(node, group, $event)">
              <summary v-if="group.name">{{ group.name }}</summary>
              <template v-if="!group.name || isWithin(node, group)">
                <param-row v-for="param in group.params" :key="param.name" :node="node.node" :param="param" :value="value(node.node, param.name)"
                  :initial="all.first[node.node]?.[param.name]" :unused="!!all.unused[node.node]?.includes(param.name)" :read-only="readOnly"
                  :reason="all.reasons[node.node + '/' + param.name]" @set="(value, stroke) => store.set(node.node, param.name, value, stroke)"
                  @reset="store.reset(node.node, param.name)" />
              </template>
            </component>
          </template>
          <div v-if="node.actions.length" class="rv-actions">
            <q-btn v-for="action in node.actions" :key="action.name" :data-name="node.node + '/' + action.name" outline dense no-caps size="sm" :label="action.label" :title="action.help" :disable="readOnly"
              @click="store.act(node.node, action.name)" />
          </div>
          <div v-for="topic in node.texts" :key="topic" class="rv-text" v-html="all.texts[topic]"></div>
        </template>
      </details>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    return { words: "", all: this.copy(), only: this.state.nodes ?? null, closed: this.state.closed ?? [], groups: [] };
  },
  computed: {
    store: () => rv.nodes,
    shown() {
      const words = this.words.toLowerCase().split(/\s+/).filter(Boolean);
      const isFound = (node, param) => words.every((word) => `${node} ${param.name} ${param.label} ${param.group} ${param.help}`.toLowerCase().includes(word));
      const found = this.all.names.map((name) => this.all.about[name]).filter((node) => node && (!this.only || this.only.includes(node.node)));
      return found.map((node) => {
        const params = node.params.filter((param) => isFound(node.node, param));
        const names = [...new Set(params.map((param) => param.group))];
        const groups = names.map((name) => ({ name, params: params.filter((param) => param.group === name) }));
        return { ...node, groups: groups.sort((a, b) => !!a.name - !!b.name) };
      }).filter((node) => node.groups.length || (!words.length && (node.actions.length || node.texts.length)));
    },
    read() {
      return this.shown.filter((node) => this.isOpen(node.node)).flatMap((node) => node.texts);
    },
  },
  watch: {
    read() { this.store.read(this, this.read); },
  },
  mounted() {
    this.follow = () => (this.all = this.copy());
    this.store.addEventListener("change", this.follow);
    this.store.addEventListener("reveal", this.reveal);
    this.follow();
    this.store.read(this, this.read);
    this.reveal();
  },
  beforeUnmount() {
    this.store.removeEventListener("change", this.follow);
    this.store.removeEventListener("reveal", this.reveal);
    this.store.read(this, []);
  },
  methods: {
    copy() {
      const { names, about, first, values, unused, drafts, reasons, texts, presets, preset } = rv.nodes;
      return Object.freeze({ names, about, first, values, unused, drafts, reasons, texts, presets, preset });
    },
    value(node, name) {
      return this.all.drafts[`${node}/${name}`]?.value ?? this.all.values[node]?.[name];
    },
    isChanged({ node, params }) {
      return params.some(({ name }) => this.all.values[node]?.[name] !== this.all.first[node]?.[name]);
    },
    isOpen(node) {
      return !!this.words || !this.closed.includes(node);
    },
    isWithin({ node }, { name }) {
      return !!this.words || this.groups.includes(`${node}/${name}`);
    },
    toggled(node, { target }) {
      if (this.words || target.open === this.isOpen(node)) return;
      this.closed = target.open ? this.closed.filter((one) => one !== node) : [...this.closed, node];
      rv.keep(this.$el, { closed: this.closed });
    },
    grouped({ node }, { name }, { target }) {
      if (this.words) return;
      const key = `${node}/${name}`;
      this.groups = target.open ? [...new Set([...this.groups, key])] : this.groups.filter((one) => one !== key);
    },
    // Scroll to what was sought, if this panel shows its node.
    async reveal() {
      await this.$nextTick(); // its tab is shown by now
      const { node, name } = this.store.sought ?? {};
      const about = this.all.about[node];
      if (!about || (this.only && !this.only.includes(node)) || !this.$el.checkVisibility()) return;
      this.store.sought = null;
      this.words = "";
      this.closed = this.closed.filter((one) => one !== node);
      const group = about.params.find((param) => `${node}/${param.name}` === name)?.group;
      if (group) this.groups = [...new Set([...this.groups, `${node}/${group}`])];
      await this.$nextTick();
      const found = this.$el.querySelector(`[data-name="${CSS.escape(name)}"]`);
      found?.scrollIntoView({ block: "center" });
      (found?.querySelector(":enabled") ?? found)?.focus({ preventScroll: true });
    },
    choose({ target }) {
      this.store.choose(target.value);
      target.value = this.all.preset;
    },
    show(only) {
      this.only = only;
      rv.keep(this.$el, { nodes: only ?? undefined });
    },
  },
};
