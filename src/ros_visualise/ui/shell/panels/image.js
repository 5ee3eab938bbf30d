// One image topic or several: zoomed and moved by pointer or keys, with the values of the original.
let count = 0;
const taken = new Map(); // panel -> its topics

export default {
  template: `
    <div class="rv-image" @dragover.prevent @drop.prevent="drop">
      <div class="rv-image-bar" role="toolbar" aria-label="Image">
        <select :value="topic" aria-label="Topic" title="Topic; drop other topics here to compare them" @change="choose($event.target.value)">
          <option v-if="!topic" value="">No image topic</option>
          <option v-for="one in offered" :key="one" :value="one">{{ one }}</option>
        </select>
        <select v-if="others.length" v-model="mode" aria-label="Comparison" title="How the images are compared">
          <option value="side">Side by side</option><option value="wipe">Wipe</option><option value="difference">Difference</option>
        </select>
        <span class="rv-space"></span>
        <button v-for="one in buttons" :key="one.label" :class="{ 'rv-on': one.on }" :aria-label="one.label" :aria-pressed="one.on === undefined ? undefined : String(one.on)"
          :title="one.title" @click="one.act"><q-icon :name="one.icon" /></button>
        <button aria-label="Options" title="Options"><q-icon name="tune" />
          <q-menu><div class="rv-image-menu">
            <label>Compare with <select value="" aria-label="Compare with" @change="add($event.target.value); $event.target.value = ''">
              <option value="">Choose a topic</option>
              <option v-for="one in offered.filter((one) => !shown.includes(one))" :key="one" :value="one">{{ one }}</option></select></label>
            <label v-for="one in others" :key="one">{{ one }} <button :aria-label="'Remove ' + one" title="Remove" @click="remove(one)"><q-icon name="close" /></button></label>
            <label v-if="clouds.length">Point cloud <select v-model="cloud" aria-label="Point cloud" title="Points over the image, coloured by distance">
              <option value="">None</option><option v-for="one in clouds" :key="one">{{ one }}</option></select></label>
            <label v-if="hasBoxes" title="Outlines of detected objects"><input v-model="boxes" type="checkbox"> Detections</label>
            <label title="Stretch the contrast to the range of values in the image"><input v-model="stretch" type="checkbox"> Stretch contrast</label>
          </div></q-menu>
        </button>
      </div>
      <div class="rv-image-room">
        <canvas ref="picture" role="img" :aria-label="shown.join(', ')"></canvas>
        <canvas ref="over" class="rv-image-over" tabindex="0" :class="{ 'rv-picks': picks }" :aria-label="'View of ' + topic"
          title="Zoom: wheel, + and -; move: drag or arrow keys; fit: double click or 0; one to one: 1"></canvas>
        <p v-if="note" class="rv-image-note">{{ note }}</p>
      </div>
      <div v-if="aside" class="rv-image-values">
        <div>Histogram <small>{{ ranges.histogram }}</small><canvas ref="histogram"></canvas></div>
        <div v-if="hasLine">Line profile <small>{{ ranges.line }}</small><canvas ref="line"></canvas></div>
      </div>
      <div class="rv-image-facts"><span class="rv-image-value" aria-live="off">{{ value }}</span><span class="rv-space"></span><span :title="stamp && 'Stamp ' + stamp + ' ns'">{{ facts }}</span></div>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data() {
    const { topic = "", others = [], mode = "side", cloud = "", boxes = true, stretch = false, aside = false } = this.state ?? {};
    return {
      topic, others, mode, cloud, boxes, stretch, aside, number: ++count, offers: [], held: false, isDrawing: false, hasLine: false,
      value: "", facts: "", stamp: "", problem: "", isKnown: false, hasImage: false, ranges: { histogram: "", line: "" },
    };
  },
  computed: {
    offered() { return this.offers.map(({ topic }) => topic); },
    shown() { return [this.topic, ...this.others].filter(Boolean); },
    offer() { return this.offers.find(({ topic }) => topic === this.topic); },
    clouds() { return this.offer?.clouds ?? []; },
    hasBoxes() { return this.shown.some((one) => this.offers.find(({ topic }) => topic === one)?.boxes); },
    picks() { return !this.readOnly && this.shown.some((one) => this.offers.find(({ topic }) => topic === one)?.picks); },
    note() {
      if (!this.isKnown) return this.problem;
      if (!this.topic) return "No image topics";
      if (!this.offer) return `${this.topic} is not in this graph`;
      return this.problem || (this.hasImage ? "" : `No image on ${this.topic} yet`);
    },
    buttons() {
      return [
        { label: "Fit", title: "Show the whole image (0, double click)", icon: "fit_screen", act: () => this.stage.fit() },
        { label: "1:1", title: "One image pixel per screen pixel (1)", icon: "crop_free", act: () => this.stage.exact() },
        { label: "Freeze", title: "Keep showing this image", icon: "ac_unit", on: this.held, act: () => (this.held = !this.held) },
        { label: "Line profile", title: "Draw a line to plot the values along it (or drag with Shift)", icon: "show_chart", on: this.isDrawing, act: this.drawLine },
        { label: "Histogram", title: "Histogram of the values", icon: "bar_chart", on: this.aside, act: () => (this.aside = !this.aside) },
        { label: "Save PNG", title: "Save the image at its full depth of 8 or 16 bits", icon: "download", act: this.save },
        { label: "Full screen", title: "Full screen", icon: "fullscreen", act: () => (document.fullscreenElement ? document.exitFullscreen() : this.$el.requestFullscreen()) },
      ];
    },
    // What is asked of the program, by keys that are alike for alike views.
    views() {
      if (!this.topic || !this.isKnown) return {};
      const cloud = this.clouds.includes(this.cloud) ? this.cloud : "";
      const { boxes, stretch } = this;
      const all = this.shown.map((topic) => ({ topic, cloud, boxes, stretch }));
      if (this.others.length && this.mode === "difference") all.splice(0, all.length, { topic: this.topic, minus: this.others[0], stretch });
      if (this.mode === "wipe") all.splice(2);
      return Object.fromEntries(all.map((view) => [`${this.number} ${JSON.stringify(view)}`, view]));
    },
    keys() { return Object.keys(this.views); },
  },
  watch: {
    views() {
      taken.set(this.number, this.shown);
      this.stage.names = this.shown.length > 1 && this.mode !== "difference" ? this.shown : [];
      this.hasImage = false;
      this.problem = "";
      const sizes = this.keys.map((key, i) => this.known.get(key) ?? this.stage.sizes[i] ?? this.stage.sizes[0]);
      this.stage.sizes = sizes.length ? sizes.map(({ width, height, ...size }) => (width ? [width, height] : [size[0], size[1]])) : [[16, 9]];
      this.stage.isWipe = this.mode === "wipe" && this.others.length > 0;
      this.show();
    },
    held() { this.show(); },
    mode() { this.keep(); },
    others() { this.keep(); },
    cloud() { this.keep(); },
    boxes() { this.keep(); },
    stretch() { this.keep(); },
    aside() { this.keep(); this.$nextTick(() => this.refresh()); },
  },
  created() {
    taken.set(this.number, this.shown);
  },
  async mounted() {
    const part = (name) => import(`${rv.root}/parts/${name}.js`);
    const [{ images }, { Stage }, values] = await Promise.all([part("images"), part("stage"), part("values")]);
    if (!this.$refs.picture) return;
    if (!this.$refs.picture.transferControlToOffscreen) {
      this.problem = "Images need a newer browser: Chrome 97, Firefox 105 or Safari 16.4";
      return;
    }
    Object.assign(this, { images, tools: values, facts: "" });
    this.known = new Map();
    this.asking = {};
    this.stage = new Stage(this.$refs.over, { changed: () => this.moved(), pointed: () => this.point(), picked: (...place) => this.pick(...place) });
    const { zoom, wipe } = this.state ?? {};
    if (Array.isArray(zoom) && zoom.length === 3 && zoom.every(Number.isFinite)) this.stage.view = { zoom: zoom[0], x: zoom[1], y: zoom[2] };
    if (Number.isFinite(wipe)) this.stage.share = wipe;
    this.panel = images.attach(this.$refs.picture, (key, facts) => this.drawn(key, facts));
    this.follow = () => this.take(images.topics);
    images.addEventListener("topics", this.follow);
    this.sized = new ResizeObserver(() => this.show());
    this.sized.observe(this.$refs.over);
    this.seen = () => this.show();
    document.addEventListener("visibilitychange", this.seen);
    rv.clock.addEventListener("begun", this.describe);
    if (images.topics) this.follow();
  },
  beforeUnmount() {
    this.sized?.disconnect();
    document.removeEventListener("visibilitychange", this.seen);
    this.panel?.close();
    this.images?.removeEventListener("topics", this.follow);
    rv.clock.removeEventListener("begun", this.describe);
    taken.delete(this.number);
  },
  methods: {
    take(offers) {
      this.offers = offers;
      this.isKnown = true;
      if (!this.topic) this.topic = this.offered.find((one) => ![...taken.values()].flat().includes(one)) ?? this.offered[0] ?? "";
      taken.set(this.number, this.shown);
    },
    choose(topic) {
      this.others = this.others.filter((one) => one !== topic);
      this.topic = topic;
      this.stage.fit();
      this.keep();
    },
    add(topic) {
      if (topic && !this.shown.includes(topic)) this.others = [...this.others, topic];
    },
    remove(topic) {
      this.others = this.others.filter((one) => one !== topic);
    },
    drop(event) {
      const topic = event.dataTransfer.getData("text/rv-topic").split(".")[0];
      if (!this.offered.includes(topic)) return;
      if (event.shiftKey || this.others.length) this.add(topic);
      else this.choose(topic);
    },
    keep() {
      const { topic, others, mode, cloud, boxes, stretch, aside } = this;
      const { view, share } = this.stage;
      const digits = (value) => Number(value.toPrecision(5));
      const or = (value, usual) => (value === usual ? undefined : value);
      rv.keep(this.$el, {
        topic, others: others.length ? [...others] : undefined, mode: or(mode, "side"), cloud: or(cloud, ""), boxes: or(boxes, true),
        stretch: or(stretch, false), aside: or(aside, false), wipe: or(digits(share), 0.5),
        zoom: view ? [view.zoom, view.x, view.y].map(digits) : undefined,
      });
    },
    moved() {
      this.show();
      this.keep();
    },
    // Ask for the images as large as they are seen, and draw them where they are to be.
    show() {
      if (!this.panel) return;
      const ratio = devicePixelRatio || 1;
      const { stage, keys } = this;
      const isSeen = this.$refs.over.clientWidth > 0 && !document.hidden;
      const asked = !isSeen ? [] : keys.map((key, i) => [key, { ...this.views[key], size: this.sizeOf(i, ratio), held: this.held }]);
      const text = JSON.stringify(asked);
      if (text !== this.asked) this.panel.show(Object.fromEntries(asked));
      this.asked = text;
      if (!isSeen) return;
      const layers = stage.layout(ratio).map((layer, i) => ({ key: keys[i], ...layer }));
      const [width, height] = [stage.width, stage.height].map((side) => Math.round(side * ratio));
      this.panel.draw({ width, height, layers });
      stage.draw();
      this.refresh();
    },
    // The longer side of an image in screen pixels; enlarged, no more than it has, four times that for all colours.
    sizeOf(i, ratio) {
      const [, , w, h] = this.stage.cells[i];
      const facts = this.known.get(this.keys[i]);
      if (!facts) return Math.ceil(Math.max(w, h) * ratio);
      const longer = Math.max(facts.width, facts.height);
      const needed = longer * this.stage.place(i).scale * ratio;
      if (needed >= 4 * longer) return 4 * longer;
      if (needed >= longer) return longer;
      return Math.max(1, this.stage.view ? Math.min(longer, Math.ceil(2 ** (Math.ceil(Math.log2(needed) * 2) / 2))) : Math.ceil(needed));
    },
    drawn(key, facts) {
      const number = this.keys.indexOf(key);
      if (number < 0) return;
      if (facts.problem) return void (this.problem = facts.problem);
      const before = this.known.get(key);
      if (facts.preview && before) Object.assign(facts, { width: before.width, height: before.height }); // it is smaller
      this.known.set(key, facts);
      this.problem = "";
      this.hasImage = true;
      const { images = 0 } = this.$el.dataset; // for tests and benchmarks
      Object.assign(this.$el.dataset, { stamp: facts.stamp, preview: Boolean(facts.preview), images: Number(images) + 1 });
      if (before?.width !== facts.width || before?.height !== facts.height) {
        this.stage.sizes[number] = [facts.width, facts.height];
        this.show();
      }
      this.describe();
      this.refresh();
    },
    describe() {
      const first = this.known.get(this.keys[0]);
      if (!first) return;
      const { width, height, encoding, stamp } = first;
      const other = this.known.get(this.keys[1]);
      const apart = first.apart ?? (other ? Number(BigInt(other.stamp) - BigInt(stamp)) / 1e6 : 0);
      const later = apart ? `; the other image is ${Math.abs(apart)} ms ${apart > 0 ? "later" : "earlier"}` : "";
      this.stamp = stamp;
      this.facts = `${width} × ${height} ${encoding}, ${rv.asTime(stamp)}${later}${first.preview ? "; preview" : ""}`;
    },
    // Values of what is seen now, as far as they are shown; one question of a kind at a time.
    refresh() {
      if (!this.hasImage) return;
      const { stage } = this;
      if (stage.showsNumbers) this.once("part", 0, stage.part(), (answer) => {
        stage.numbers = { ...answer, values: this.tools.valuesOf(answer) };
        stage.draw();
      });
      this.point();
      if (!this.aside) return;
      this.once("histogram", 0, [], (answer) => this.$refs.histogram && (this.ranges.histogram = this.tools.drawHistogram(this.$refs.histogram, answer)));
      if (stage.line) this.once("line", 0, stage.line.flat(), (answer) => this.$refs.line && (this.ranges.line = this.tools.drawLine(this.$refs.line, answer)));
    },
    point() {
      const { stage } = this;
      if (!stage) return;
      if (stage.isLining && stage.line) {
        this.aside = this.hasLine = true;
        stage.draw();
        this.once("line", 0, stage.line.flat(), (answer) => this.$refs.line && (this.ranges.line = this.tools.drawLine(this.$refs.line, answer)));
      }
      const { under } = stage;
      if (!under || !this.hasImage) return void (this.value = "");
      const { x, y } = under;
      const seen = stage.isWipe || this.keys.length === 1 ? this.keys : [this.keys[under.number]];
      seen.forEach((key) => this.once(`value ${key}`, this.keys.indexOf(key), [x, y, 1, 1], (answer) => {
        this.texts = { ...this.texts, [key]: this.tools.described(this.tools.valuesOf(answer), answer) };
        const shown = seen.map((one) => `${seen.length > 1 ? `${this.views[one]?.topic} ` : ""}${this.texts[one] ?? ""}`);
        this.value = `x ${x}, y ${y}: ${shown.join("; ")}`;
      }));
    },
    // Ask once at a time for each name; of what is wanted meanwhile, the newest is asked afterwards.
    async once(name, number, at, take) {
      const key = this.keys[number];
      if (this.asking[name]) return void (this.asking[name].next = [name, number, at, take]);
      const asking = (this.asking[name] = {});
      try {
        take(await this.images.ask(key, name.startsWith("value") ? "part" : name, at));
      } catch { // the next image brings another answer
      }
      delete this.asking[name];
      if (asking.next) this.once(...asking.next);
    },
    drawLine() {
      this.isDrawing = this.stage.isDrawing = !this.isDrawing;
      if (!this.isDrawing) {
        this.stage.line = null;
        this.hasLine = false;
        this.stage.draw();
      }
    },
    pick(number, across, down) {
      if (this.picks) this.images.ask(this.keys[number], "pick", [across, down]).catch(() => {});
    },
    async save() {
      try {
        for (const key of this.keys) {
          const { stamp, body } = await this.images.ask(key, "png");
          const { topic, minus } = this.views[key];
          const name = `${topic}${minus ? `_minus_${minus}` : ""}`.replace(/[^A-Za-z0-9]+/g, "_").replace(/^_|_$/g, "");
          const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([body], { type: "image/png" })), download: `${name.slice(0, 80)}_${stamp}.png` });
          link.click();
          setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
        }
      } catch (error) {
        this.problem = error.message;
      }
    },
  },
};
