// The 3D view: a canvas, what a click does, what is followed, and the settings of what is drawn. The
// view, what it follows and the settings that were changed are kept in the page's address.
const FOLLOW_NONE = "";
const KEPT_MS = 400;

const describe = (places) => {
  const [a, b] = places;
  if (!b) return `x ${a[0].toFixed(2)}, y ${a[1].toFixed(2)}, z ${a[2].toFixed(2)} m`;
  const way = b.map((xyz, i) => xyz - a[i]);
  const [x, y, z] = way.map((xyz) => (xyz < 0 ? "" : "+") + xyz.toFixed(2));
  return `${Math.hypot(...way).toFixed(2)} m (x ${x}, y ${y}, z ${z})`;
};

export default {
  template: `
    <div class="rv-space3d">
      <div ref="room" class="rv-space-room">
        <canvas ref="canvas" tabindex="0" role="img" :aria-label="'3D view. ' + words" v-show="!problem"
          title="Drag to rotate; drag with the right button or two fingers to move; wheel to zoom. Keys: arrows, + and -, T (top view), Home (reset)"></canvas>
        <p v-if="problem" class="rv-space-problem" role="alert">{{ problem }}</p>
        <p v-else-if="isKnown && !shown.has" class="rv-space-problem">Nothing to draw in 3D: this graph has no point clouds, poses, paths, maps or markers.</p>
      </div>
      <div class="rv-space-tools" role="toolbar" aria-label="3D view">
        <q-btn flat dense icon="home" aria-label="Reset view" title="Reset view (Home)" @click="goHome" />
        <q-btn flat dense icon="vertical_align_bottom" aria-label="View from above" title="Top view (T)" @click="view?.fromAbove()" />
        <select v-model="follow" aria-label="Follow" title="Keep the robot or a frame in view" @change="setFollow">
          <option value="robot">Follow robot</option>
          <option value="${FOLLOW_NONE}">Follow nothing</option>
          <option v-for="frame in frames" :key="frame" :value="frame">Follow {{ frame }}</option>
        </select>
        <select v-model="click" aria-label="Click" title="What a click does" @change="clear">
          <option value="">Click: turn view</option>
          <option value="place">Click: show coordinates</option>
          <option value="distance">Click: measure distance</option>
          <option v-for="goal in goals" :key="goal" :value="'goal ' + goal">Click: send goal {{ goal }}</option>
        </select>
        <q-btn flat dense icon="tune" aria-label="Settings" :aria-expanded="String(isOpen)" :color="isOpen ? 'primary' : undefined"
          title="Topics and appearance" @click="isOpen = !isOpen" />
      </div>
      <p v-if="said" class="rv-space-said" role="status">{{ said }}</p>
      <button v-if="missing.length && !isOpen" class="rv-space-missing" :title="reasons" @click="isOpen = true">Not shown: {{ notShown }}</button>
      <div v-if="isOpen" class="rv-space-settings" role="group" aria-label="Settings of the 3D view">
        <template v-for="one in shown.controls ?? []" :key="one.place">
          <h3 v-if="heads[one.place]">{{ one.group }}</h3>
          <label :title="one.hint" :class="{ 'rv-indent': one.label === 'Colour by' }">
            <input v-if="isSwitch(one)" type="checkbox" :checked="one.value" :disabled="readOnly" @change="set(one, $event.target.checked)">
            <i v-if="one.group === 'Topics' && isSwitch(one)" :style="{ background: swatch(one) }"></i>
            <span>{{ one.label }}</span>
            <select v-if="one.options.length" :value="one.value" :disabled="readOnly" :aria-label="one.label + (one.group === 'Topics' ? ' ' + one.hint : '')"
              @change="set(one, $event.target.value)">
              <option v-for="option in one.options" :key="option">{{ option }}</option>
            </select>
            <template v-if="one.range">
              <input type="range" :min="one.range[0]" :max="one.range[1]" :step="one.range[2]" :value="one.value" :disabled="readOnly"
                @input="set(one, Number($event.target.value), true)" @change="set(one, Number($event.target.value))">
              <output>{{ one.value.toLocaleString("en", { maximumFractionDigits: 2, useGrouping: false }) }}</output>
            </template>
          </label>
        </template>
        <p v-for="note in shown.notes ?? []" :key="note">{{ note }}</p>
      </div>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const follow = typeof this.state?.follow === "string" ? this.state.follow : "robot";
    return { shown: {}, isKnown: false, isOpen: false, follow, click: "", said: "", problem: "", frames: [] };
  },
  computed: {
    goals() { return this.readOnly ? [] : (this.shown.goals ?? []); },
    words() { return (this.shown.notes ?? []).join(". "); },
    reasons() { return this.missing.join("\n"); },
    missing() { return this.shown.missing ?? []; },
    notShown() {
      const what = this.missing.length > 1 ? `${this.missing.length} topics` : this.missing[0].split(": ")[0];
      return this.missing.every((one) => one.includes(": no transform ")) ? `${what} (no transform to ${this.shown.fixed})` : what;
    },
    heads() {
      const found = {};
      let group = "";
      for (const one of this.shown.controls ?? []) {
        if (one.group !== group) found[one.place] = true;
        group = one.group;
      }
      return found;
    },
  },
  async mounted() {
    this.places = [];
    this.picks = 0;
    await this.begin();
    if (this.isGone) return;
    this.live = rv.live("/live/space", { open: () => this.open(), message: (data) => this.hear(data) });
  },
  beforeUnmount() {
    this.isGone = true;
    this.live?.close();
    this.sized?.disconnect();
    this.themed?.disconnect();
    this.view?.close();
  },
  methods: {
    async begin() {
      try {
        const { SpaceView } = await import(`${rv.root}/parts/space_view.js`);
        if (this.isGone) return;
        this.view = new SpaceView(this.$refs.canvas, {
          moved: (view, fromRobot) => this.moved(view, fromRobot),
          clicked: (ray) => this.pick(ray),
          drawn: () => this.drawn(),
          hinted: () => this.hinted(),
          home: () => this.goHome(),
        });
      } catch (error) {
        console.info(`no 3D: ${error}`);
        this.problem = "3D needs WebGL, which this browser does not support or has switched off. Everything else works.";
        return;
      }
      this.view.setFollow(this.follow);
      const { view } = this.state ?? {};
      if (Array.isArray(view) && view.length === 6 && view.every(Number.isFinite)) this.view.view = view;
      const canvas = this.$refs.canvas;
      canvas.addEventListener("webglcontextlost", () => (this.problem = "The graphics driver stopped; reload the page to restore the 3D view."));
      this.sized = new ResizeObserver(([{ contentRect: { width, height } }]) => this.view.resize(width, height));
      this.sized.observe(this.$refs.room);
      const paint = () => {
        const isDark = document.body.classList.contains("body--dark");
        this.view.paint(isDark ? "#e8e8e8" : "#202020", isDark ? "#000a" : "#fffc");
      };
      this.themed = new MutationObserver(paint);
      this.themed.observe(document.body, { attributes: true, attributeFilter: ["class"] });
      paint();
    },
    open() {
      this.view?.forget();
      const { settings } = this.state ?? {};
      if (this.isRestored || this.readOnly || document.getElementById("rv-foreign")) return;
      this.isRestored = true;
      for (const [place, value] of Object.entries(settings ?? {})) this.live.send({ set: { [place]: value } });
    },
    hear(data) {
      if (data instanceof ArrayBuffer) {
        if (!this.view) return this.live.send({ got: 1 });
        this.view.take(data);
        this.owed = (this.owed ?? 0) + 1;
        return;
      }
      const { state, picked, say } = data;
      if (state) this.show(state);
      if (picked) this.found(picked);
      if (say) this.said = say;
    },
    show(state) {
      if (state.fixed !== this.shown.fixed) this.clear();
      this.shown = state;
      this.isKnown = true;
      const settings = JSON.stringify(state.changed ?? {});
      if (settings === (this.kept ?? "{}")) return;
      this.kept = settings;
      rv.keep(this.$el, { settings: state.changed });
    },
    drawn() {
      const { dataset } = this.$refs.canvas;
      dataset.frames = Number(dataset.frames ?? 0) + 1;
      dataset.packets = Number(dataset.packets ?? 0) + (this.owed ?? 0);
      for (; this.owed > 0; this.owed--) this.live.send({ got: 1 });
    },
    hinted() {
      const { frames } = this.view.hints;
      if (frames.join("\n") !== this.frames.join("\n")) this.frames = [...frames];
    },
    moved(view, fromRobot) {
      clearTimeout(this.keeping);
      this.keeping = setTimeout(() => {
        if (this.isGone) return;
        rv.keep(this.$el, { view });
        if (!this.readOnly) this.live.send({ view: fromRobot });
      }, KEPT_MS);
    },
    goHome() {
      if (!this.view) return;
      clearTimeout(this.keeping);
      this.view.goHome();
      this.live.send({ home: 1 });
      rv.keep(this.$el, { view: undefined });
    },
    setFollow() {
      this.view?.setFollow(this.follow);
      rv.keep(this.$el, { follow: this.follow === "robot" ? undefined : this.follow });
    },
    pick(ray) {
      if (!this.click) return;
      const goal = this.click.startsWith("goal ") ? this.click.slice(5) : "";
      this.live.send({ pick: { ray, id: ++this.picks, goal } });
    },
    found({ id, at, fixed, goal }) {
      if (id !== this.picks) return;
      if (!at) return void (this.said = "Nothing there; click a drawn object");
      const keeps = this.click === "distance" && this.places.length === 1;
      this.places = keeps ? [...this.places, at] : [at];
      const text = describe(this.places);
      this.view.pin(this.places, text);
      this.said = `${goal ? "Goal sent: " : ""}${text} in ${fixed}`;
    },
    clear() {
      this.places = [];
      this.said = "";
      this.view?.pin([], "");
    },
    // Change a setting; what a person is done with can be undone.
    set(control, value, isUnderway = false) {
      this.before ??= control.value;
      control.value = value;
      this.tell(control.place, value);
      if (isUnderway) return;
      const { place } = control;
      const before = this.before;
      this.before = null;
      if (before !== value) rv.past.did({ undo: () => this.tell(place, before), redo: () => this.tell(place, value) });
    },
    tell(place, value) {
      const message = { set: { [place]: value } };
      if (!this.isGone) return this.live.send(message);
      const live = rv.live("/live/space", { open: () => (live.send(message), setTimeout(live.close, 1000)) }); // the panel was closed
    },
    isSwitch: (one) => !one.options.length && !one.range,
    swatch: ({ color }) => (color.length ? `rgb(${color.join()})` : "linear-gradient(90deg, #30f, #2cf, #4f4, #fc2, #d20)"),
  },
};
