// A robot: its status, its actions, and driving it. While a button or its key is held, the page says so again
// and again. Everything is released when the tab loses the focus, is hidden or left, or the connection is lost.
const PERIOD_MS = 100;

export default {
  template: `
    <div class="rv-robot">
      <p v-if="isKnown && !state_.robot && !state_.moves.length" class="rv-note">This graph has no robot.</p>
      <p v-if="state_.status" class="rv-status" :class="{ 'rv-failed': state_.failed }" role="status">{{ state_.status }}</p>
      <div v-if="state_.actions.length" class="rv-actions" role="group" aria-label="Commands">
        <q-btn v-for="action in state_.actions" :key="action.name" outline dense no-caps :label="action.label" :title="action.help" :disable="readOnly"
          @click="socket.send({ do: 'act', action: action.name })" />
      </div>
      <template v-if="state_.moves.length">
        <label v-for="one in speeds" :key="one.name" class="rv-speed" :title="one.unit">{{ one.label }}
          <input type="range" :min="0.1" :max="one.most" step="0.1" :value="speed[one.name]" :disabled="readOnly" :aria-label="one.label" @input="choose(one, $event)">
          <output>{{ speed[one.name].toFixed(1) }} {{ one.unit }}</output>
        </label>
        <div class="rv-pad" :class="{ 'rv-disabled': readOnly }">
          <template v-for="name in pad">
            <button v-if="moves[name]" :data-hold="name" :class="{ 'rv-held': held.includes(name) }" :disabled="readOnly"
              @pointerdown="grab($event, name)" @contextmenu.prevent>{{ moves[name].label }}<kbd>{{ moves[name].key.toUpperCase() }}</kbd></button>
            <i v-else></i>
          </template>
          <button class="rv-stop" :disabled="readOnly" @pointerdown="stop" @click="stop">■ Stop<kbd>K</kbd></button>
        </div>
        <p class="rv-note">Hold a button or its key to drive.</p>
      </template>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const speed = { speed: 0.8, turn: 0.6, ...this.state.speed };
    return { state_: { robot: "", actions: [], moves: [], status: "", failed: false }, speed, held: [], isKnown: false };
  },
  computed: {
    pad: () => ["left", "forward", "right", "up", "back", "down"],
    speeds: () => [
      { name: "speed", label: "Speed", unit: "m/s", most: 3 },
      { name: "turn", label: "Turning speed", unit: "rad/s", most: 2 },
    ],
    moves() { return Object.fromEntries(this.state_.moves.map((move) => [move.name, move])); },
  },
  created() {
    this.holding = new Map(); // pointer or key -> what it holds
    this.press = "";
  },
  mounted() {
    this.socket = rv.live("/live/robot", {
      message: (messages) => {
        messages.forEach((message) => Object.assign(this.state_, message));
        this.isKnown = true;
      },
      closed: () => this.releaseAll(),
    });
    this.listeners = [
      [window, "keydown", this.keyDown, true], // before other keys of the page, such as M
      [window, "keyup", (event) => this.release(event.code), true],
      [window, "pointerup", (event) => this.release(event.pointerId), true],
      [window, "pointercancel", (event) => this.release(event.pointerId), true],
      [window, "blur", this.releaseAll],
      [window, "pagehide", this.releaseAll],
      [document, "visibilitychange", () => document.hidden && this.releaseAll()],
    ];
    for (const [target, ...listener] of this.listeners) target.addEventListener(...listener);
  },
  beforeUnmount() {
    this.releaseAll();
    for (const [target, ...listener] of this.listeners) target.removeEventListener(...listener);
    this.socket.close();
  },
  methods: {
    isShown() {
      return this.$el.offsetParent !== null; // else it is behind another tab
    },
    send() {
      if (!this.isShown()) this.holding.clear();
      if (!this.holding.size) clearInterval(this.timer);
      this.held = [...new Set(this.holding.values())];
      this.socket.send({ do: "hold", press: this.press, names: this.held, ...this.speed });
    },
    hold(what, name) {
      if (this.readOnly || this.holding.get(what) === name) return;
      if (!this.holding.size) {
        this.press = Math.random().toString(36).slice(2);
        this.timer = setInterval(this.send, PERIOD_MS);
      }
      this.holding.set(what, name);
      this.send();
    },
    release(what) {
      if (this.holding.delete(what)) this.send();
    },
    releaseAll() {
      for (const what of [...this.holding.keys()]) this.release(what);
    },
    stop() {
      if (!this.readOnly) this.socket.send({ do: "stop", press: this.press });
    },
    grab(event, name) {
      if (event.button !== 0) return;
      event.preventDefault();
      document.activeElement?.blur(); // else keys would still be typed into a field
      this.hold(event.pointerId, name);
    },
    keyDown(event) {
      if (event.ctrlKey || event.altKey || event.metaKey || rv.isTyping(event.target)) return;
      const key = event.key.toLowerCase();
      if (key === "k" && this.state_.moves.length) return this.stop(); // wherever the panel is
      const move = this.state_.moves.find((one) => one.key === key);
      if (!move || !this.isShown()) return;
      event.preventDefault();
      event.stopImmediatePropagation();
      this.hold(event.code, move.name);
    },
    choose({ name }, { target }) {
      this.speed = { ...this.speed, [name]: Number(target.value) };
      rv.keep(this.$el, { speed: this.speed });
    },
  },
};
