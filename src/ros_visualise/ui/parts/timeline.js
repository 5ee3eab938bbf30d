// The timeline: clock, controls and a bar to scrub.
const SKIP_S = 5;
const MARGIN = 10;
const clock = rv.asClock;

export default {
  template: `
    <div class="rv-timeline" v-show="isKnown" role="region" aria-label="Timeline">
      <div class="rv-controls">
        <q-btn v-if="!state.live" flat dense round icon="skip_previous" :disable="readOnly" aria-label="Step back"
          title="Step back (,)" @mousedown.prevent @click="act({ step: false })" />
        <q-btn flat dense round :icon="icon" :disable="readOnly" :aria-label="state.playing ? 'Pause' : 'Play'"
          title="Play or pause (space)" @mousedown.prevent @click="act({ toggle: 1 })" />
        <q-btn flat dense round icon="skip_next" :disable="readOnly" aria-label="Step forward"
          title="Step forward (.)" @mousedown.prevent @click="act({ step: true })" />
        <span v-if="readOnly" class="rv-read-only" title="Read-only">Read-only</span>
        <span class="rv-clock">{{ time }}<small v-if="length"> / {{ length }}</small></span>
      </div>
      <div v-show="!state.live || canRewind" class="rv-track">
      <div v-if="rows.length" class="rv-ticks" role="img" aria-label="Messages over time">
        <div v-for="[topic, counts] in rows" :key="topic" class="rv-tick-row" :title="topic">
          <span>{{ topic }}</span><canvas :ref="(canvas) => canvas && drawRow(canvas, counts)"></canvas></div>
      </div>
      <div v-for="one in sources" :key="one.name" class="rv-source" :title="one.title + (one.aligned ? ', aligned by timestamps' : ', starts together with the first source')">
        <span class="rv-span" :class="{ 'rv-held': one.isHeld }" :style="{ left: place(one.begin), right: rest(one.end) }" @pointerdown="hold($event, one)">{{ one.title }}</span>
        <label>offset<input type="number" step="0.01" :value="one.offset" :disabled="readOnly" :aria-label="'Offset of ' + one.title + ', seconds'"
          @keydown.stop @change="move(one, Number($event.target.value))">s</label>
      </div>
      <div ref="bar" class="rv-bar" role="slider" tabindex="0" aria-label="Time"
        :aria-valuemin="begin" :aria-valuemax="end" :aria-valuenow="shown" :aria-valuetext="time"
        @pointerdown="grab" @pointermove="hover" @pointerleave="leave"><canvas ref="canvas"></canvas>
        <img v-if="thumbnail && pointer !== null" class="rv-thumbnail" :src="thumbnail" :style="{ left: place(pointer) }" alt="">
        <button v-for="[at, name] in state.marks ?? []" :key="at" class="rv-mark" :style="{ left: place(at) }" :title="name + '  ' + clock(at)"
          :aria-label="'Mark ' + name + ' at ' + clock(at)" @pointerdown.stop @click="seek(at)">
          <q-menu v-if="!readOnly" context-menu @before-show="marked = name"><div class="rv-marking">
            <q-input v-model="marked" dense autofocus label="Name of the mark" @keydown.stop @keydown.enter="act({ mark: [at, marked] })" />
            <q-btn v-close-popup flat dense no-caps label="Rename" @click="act({ mark: [at, marked] })" />
            <q-btn v-close-popup flat dense no-caps label="Loop from here to the next mark" @click="loop(at)" />
            <q-btn v-close-popup flat dense no-caps label="Export from here to the next mark" @click="exportFrom(at)" />
            <q-btn v-close-popup flat dense no-caps label="Remove" @click="act({ mark: [at, ''] })" />
          </div></q-menu></button>
      </div>
      </div>
      <div v-if="canRewind" class="rv-controls" :title="kept">
        <q-btn flat dense no-caps icon="sensors" label="Live" :color="state.past ? undefined : 'negative'" :disable="readOnly" :aria-pressed="String(!state.past)"
          title="Back to live (End)" @mousedown.prevent @click="act({ live: 1 })" />
      </div>
      <div v-if="!state.live" class="rv-controls">
        <select class="rv-rate" :value="state.rate" :disabled="readOnly" aria-label="Playback speed" title="Playback speed, from slow motion to fast (keys < and >)"
          @change="act({ rate: Number($event.target.value) }); $event.target.blur()">
          <option v-for="rate in rates" :key="rate" :value="rate">{{ rate ? rate + " ×" : "Unlimited" }}</option>
        </select>
        <q-btn flat dense round icon="repeat" :color="state.loop ? 'primary' : undefined" :disable="readOnly" aria-label="Loop"
          :aria-pressed="String(!!state.loop)" title="Repeat: start again when the end is reached" @mousedown.prevent @click="act({ loop: null })" />
        <q-btn flat dense round icon="flag" :disable="readOnly" aria-label="Set a mark"
          title="Set a mark, that is, a bookmark in time (M); right-click a mark to rename or remove it" @mousedown.prevent @click="mark" />
        <q-btn flat dense round icon="density_medium" :color="rows.length ? 'primary' : undefined" aria-label="Messages per topic"
          :aria-pressed="String(!!rows.length)" title="Messages of each topic over time" @mousedown.prevent @click="toggleTicks" />
        <select v-if="(state.topics ?? []).length > 1" :value="state.topic" :disabled="readOnly" aria-label="Step by" class="rv-topic"
          title="Step to the next message of this topic" @change="act({ topic: $event.target.value }); $event.target.blur()">
          <option value="">Any message</option>
          <option v-for="topic in state.topics" :key="topic" :value="topic">{{ topic }}</option>
        </select>
      </div>
    </div>`,
  props: { readOnly: Boolean },
  data() {
    return { state: {}, isKnown: false, held: null, offsets: {}, scrubbed: null, pointer: null, thumbnail: "", marked: "", rows: [] };
  },
  computed: {
    sources() {
      return (this.state.sources ?? []).map((one) => {
        const by = this.held?.name === one.name ? this.held.by : 0;
        const offset = Number(((this.offsets[one.name] ?? 0) + by).toFixed(3));
        return { ...one, begin: one.begin_s + by, end: one.end_s + by, aligned: one.is_aligned, offset, isHeld: !!by };
      });
    },
    begin() { return this.state.begin ?? 0; },
    canRewind() { return !!this.state.live && this.state.duration - this.begin > 1; },
    kept() { const [used, most] = this.state.megabytes ?? []; return `${clock(this.end - this.begin)} kept, ${used} of ${most} MB`; },
    shown() { return this.scrubbed ?? this.state.position ?? 0; },
    end() { return Math.max(this.state.duration ?? 0, this.shown, 0.01); },
    time() { return this.state.past ? `−${clock(this.end - this.shown)}` : clock(this.shown); },
    length() { return this.state.live || this.state.duration == null ? "" : clock(this.state.duration); },
    icon() { return this.state.playing ? "pause" : this.state.ended ? "replay" : "play_arrow"; },
    rates() {
      const { rate = 1, rates = [] } = this.state;
      return [...(rates.includes(rate) || !rate ? [] : [rate]), ...rates, 0]; // 0 is unlimited
    },
  },
  mounted() {
    rv.clock.addEventListener("change", this.heard);
    rv.nodes.addEventListener("change", this.moved);
    this.heard();
    this.sized = new ResizeObserver(() => this.draw());
    this.sized.observe(this.$refs.bar);
    rv.cursor.addEventListener("move", this.pointed);
    this.pressed = (event) => this.key(event) && event.preventDefault();
    document.addEventListener("keydown", this.pressed);
  },
  beforeUnmount() {
    rv.clock.removeEventListener("change", this.heard);
    rv.nodes.removeEventListener("change", this.moved);
    this.sized.disconnect();
    rv.cursor.removeEventListener("move", this.pointed);
    document.removeEventListener("keydown", this.pressed);
  },
  methods: {
    moved() {
      this.offsets = rv.nodes.values[this.state.player] ?? {};
    },
    heard() {
      this.state = rv.clock.state;
      this.moved();
      this.isKnown = "position" in this.state;
      if (this.isGrabbed !== true) this.scrubbed = null;
      this.$nextTick(this.draw);
    },
    act(message) {
      if (!this.readOnly) rv.clock.act(message);
    },
    seek(seconds) {
      this.scrub(seconds);
      this.act({ seek: this.scrubbed });
    },
    // Go on or back from where the server is then: another key may be under way.
    skip(by) {
      this.scrub(this.shown + by);
      this.act({ skip: by });
    },
    // Show a time until the server's comes.
    scrub(seconds) {
      if (!this.readOnly) this.scrubbed = Math.min(Math.max(seconds, this.begin), this.end);
      this.draw();
    },
    key(event) {
      if (!this.isKnown || rv.isTyping(event.target) || event.ctrlKey || event.metaKey || event.altKey) return false;
      if (event.key === " " && event.target.closest?.("button")) return false; // a button's own
      if (/^(Arrow|Home|End|Page)/.test(event.key) && event.target.matches?.("input[type=range]")) return false; // a slider's own
      const { live } = this.state;
      const part = this.state.part?.[0] ?? 0;
      const back = {
        ArrowLeft: () => this.skip(event.shiftKey ? -1 : -SKIP_S),
        ArrowRight: () => this.skip(event.shiftKey ? 1 : SKIP_S),
      };
      const actions = {
        " ": () => this.act({ toggle: 1 }),
        ".": () => this.act({ step: true }),
        ...(!live && {
          ",": () => this.act({ step: false }),
          ...back,
          Home: () => this.seek(part),
          End: () => this.seek(this.state.part?.[1] ?? this.end),
          "[": () => this.act({ begin: 1 }),
          m: () => this.mark(),
          "]": () => this.act({ end: 1 }),
          "<": () => this.act({ faster: false }),
          ">": () => this.act({ faster: true }),
        }),
        ...(this.canRewind && { ...back, End: () => this.act({ live: 1 }), Home: () => this.seek(this.begin) }),
      };
      const action = Object.hasOwn(actions, event.key) && actions[event.key];
      if (action) action();
      return !!action;
    },
    clock,
    place(at) {
      return `calc(${MARGIN}px + ${(at - this.begin) / (this.end - this.begin)} * (100% - ${2 * MARGIN}px))`;
    },
    rest(at) {
      return `calc(${MARGIN}px + ${1 - at / this.end} * (100% - ${2 * MARGIN}px))`;
    },
    // Move a source that is played with others.
    move({ name }, offset) {
      if (Number.isFinite(offset)) rv.nodes.set(this.state.player, name, offset);
    },
    hold(event, one) {
      if (this.readOnly || event.button !== 0) return;
      const { target, clientX } = event;
      const width = this.$refs.bar.clientWidth - 2 * MARGIN;
      target.setPointerCapture(event.pointerId);
      this.held = { name: one.name, by: 0 };
      target.onpointermove = (moved) => (this.held = { name: one.name, by: ((moved.clientX - clientX) / width) * this.end });
      const release = ({ type }) => {
        target.onpointermove = target.onpointerup = target.onpointercancel = null;
        const { by } = this.held;
        this.held = null;
        if (type === "pointerup" && by) this.move(one, Number((one.offset + by).toFixed(3)));
      };
      target.onpointerup = target.onpointercancel = release;
    },
    mark() {
      this.act({ mark: [null, ""] });
    },
    // What lies between this mark and the next one.
    partFrom(at) {
      return [at, (this.state.marks ?? []).find(([time]) => time > at)?.[0] ?? null];
    },
    exportFrom(at) {
      this.act({ range: this.partFrom(at) });
      rv.open("files");
    },
    loop(at) {
      this.scrub(at);
      this.act({ repeat: this.partFrom(at) });
    },
    async toggleTicks() {
      if (this.rows.length) return (this.rows = []);
      const { topics } = await rv.ask({ ask: "ticks" });
      this.rows = Object.entries(topics);
    },
    // The messages of a topic over the time of the recording; a gap is empty.
    drawRow(canvas, counts) {
      const most = Math.max(...counts, 1);
      Object.assign(canvas, { width: counts.length, height: 1 });
      const to = canvas.getContext("2d");
      to.fillStyle = getComputedStyle(this.$el).color;
      counts.forEach((count, i) => {
        to.globalAlpha = count ? 0.35 + (0.65 * count) / most : 0;
        to.fillRect(i, 0, 1, 1);
      });
    },
    // The image at a time; of those that are asked for meanwhile the newest comes next.
    async askThumbnail(at) {
      this.nextAt = at;
      if (this.isAsking) return;
      this.isAsking = true;
      while (this.nextAt !== null) {
        const query = new URLSearchParams({ ask: "thumbnail", at: this.nextAt });
        this.nextAt = null;
        const answer = await fetch(`${rv.root}/?${query}`, { headers: { "X-Ros-Visualise": "1" } }).catch(() => null);
        const found = answer?.ok ? await answer.blob() : null;
        URL.revokeObjectURL(this.thumbnail);
        this.thumbnail = found?.size ? URL.createObjectURL(found) : "";
      }
      this.isAsking = false;
    },
    leave() {
      this.nextAt = null;
      rv.cursor.move(null);
    },
    timeAt({ clientX }) {
      const { left, width } = this.$refs.bar.getBoundingClientRect();
      return Math.min(Math.max((clientX - left - MARGIN) / (width - 2 * MARGIN), 0), 1) * (this.end - this.begin) + this.begin;
    },
    grab(event) {
      if (this.readOnly || event.button !== 0) return;
      event.preventDefault();
      const bar = this.$refs.bar;
      bar.setPointerCapture(event.pointerId);
      this.isGrabbed = true;
      this.seek(this.timeAt(event));
      const release = () => {
        this.isGrabbed = false;
        bar.onpointermove = bar.onpointerup = bar.onpointercancel = null;
      };
      bar.onpointermove = (moved) => this.seek(this.timeAt(moved));
      bar.onpointerup = bar.onpointercancel = release;
    },
    hover(event) {
      rv.cursor.move(this.timeAt(event));
      if (event.pointerType === "mouse" && !this.state.live) this.askThumbnail(this.timeAt(event));
    },
    pointed() {
      this.pointer = rv.cursor.at;
      this.draw();
    },
    draw() {
      const { bar, canvas } = this.$refs;
      const [width, height] = [bar.clientWidth, bar.clientHeight];
      if (!width) return;
      const scale = devicePixelRatio;
      Object.assign(canvas, { width: width * scale, height: height * scale });
      const to = canvas.getContext("2d");
      to.scale(scale, scale);
      const ink = getComputedStyle(bar).color;
      const x = (time) => MARGIN + ((time - this.begin) / (this.end - this.begin)) * (width - 2 * MARGIN);
      const middle = height - 13;
      const line = (from, until, color, alpha, thick) => {
        Object.assign(to, { fillStyle: color, globalAlpha: alpha });
        to.fillRect(x(from), middle - thick / 2, Math.max(x(until) - x(from), 0), thick);
      };
      const [begin, end] = this.state.part ?? [0, null];
      line(this.begin, this.end, ink, 0.2, 5);
      if (begin || end != null) line(begin, end ?? this.end, "#fab005", 0.9, 9);
      line(this.begin, this.shown, "#4dabf7", 1, 5);
      this.drawTicks(to, x, width, ink, middle);
      Object.assign(to, { fillStyle: ink, globalAlpha: 1 });
      to.beginPath();
      to.arc(x(this.shown), middle, 7, 0, 7);
      to.fill();
      if (this.pointer === null) return;
      to.fillRect(x(this.pointer), middle - 9, 1, 18);
      Object.assign(to, { font: "11px sans-serif", textAlign: "center" });
      to.fillText(clock(this.pointer), Math.min(Math.max(x(this.pointer), 24), width - 24), 10);
    },
    drawTicks(to, x, width, ink, middle) {
      const step = [0.1, 0.5, 1, 5, 10, 30, 60, 300, 600, 1800, 3600, 14400, 86400].find((one) => (one / (this.end - this.begin)) * width > 70);
      Object.assign(to, { fillStyle: ink, font: "10px sans-serif", textAlign: "center", globalAlpha: 0.55 });
      for (let number = step ? Math.ceil(this.begin / step) : 0; step && number * step <= this.end; number++) {
        to.fillRect(x(number * step), middle - 9, 1, 4);
        const label = clock(number * step).replace(/\.00$/, "");
        if (this.pointer === null) to.fillText(label, Math.min(Math.max(x(number * step), 12), width - 16), 10);
      }
    },
  },
};
