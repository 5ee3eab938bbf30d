// Files: one is opened or uploaded, topics are recorded, recordings downloaded, parameters and the layout saved.
const DOWNLOAD = "application/octet-stream";

export default {
  template: `
    <div class="rv-files">
      <section v-if="all.opens" aria-label="Open">
        <h3>Open</h3>
        <select :disabled="readOnly" aria-label="Source" title="Uploads, and videos and recordings in the current folder" @change="open">
          <option value="">Choose a file</option>
          <option v-for="name in all.files" :key="name">{{ name }}</option>
        </select>
        <label v-if="isAddable" class="rv-check"><input v-model="adds" type="checkbox" :disabled="readOnly">Add to the current timeline</label>
        <label class="rv-field">Address<input :disabled="readOnly" placeholder="ws://…, rtsp://…, /dev/video0 or test" @keydown.enter="address"
          title="URL of a stream, camera device, or 'test' for a test pattern; press Enter to open it"></label>
        <p v-if="all.recent.length > 1" class="rv-note">Recent:
          <template v-for="path in all.recent.slice(1)" :key="path"><button class="rv-link" :title="path" :disabled="readOnly"
            @click="openIt(path)">{{ base(path) }}</button> </template></p>
        <p class="rv-note"><label class="rv-upload" :class="{ 'rv-disabled': readOnly }">Upload a file<input ref="input" type="file" hidden multiple
          :disabled="readOnly" :accept="all.suffixes.join(',')" @change="upload"></label> or drop it anywhere on the page:
          {{ all.uploads || "up to " + all.gib + " GiB, into " + all.folder }}</p>
      </section>
      <section aria-label="Record">
        <h3>Record</h3>
        <label class="rv-field">File<input v-model="name" :placeholder="'record-….mcap'" :disabled="readOnly" title="Name such as run.mcap or edges.mp4; leave empty for an automatic name"></label>
        <label class="rv-field">Split<input v-model="split" :disabled="readOnly" title="Size or duration of each file, such as 1G or 10m; leave empty for a single file"></label>
        <details>
          <summary>Topics to record ({{ chosen.length }} of {{ all.topics.length }})</summary>
          <button class="rv-link" :disabled="readOnly" @click="off = []; more = all.topics.map(([name]) => name)">All</button>
          <button class="rv-link" :disabled="readOnly" @click="off = all.topics.map(([name]) => name); more = []">None</button>
          <label v-for="[topic] in all.topics" :key="topic" class="rv-check"><input type="checkbox" :checked="chosen.includes(topic)" :disabled="readOnly"
            @change="pick(topic, $event.target.checked)">{{ topic }}</label>
        </details>
        <q-btn dense no-caps outline :color="all.recording ? 'negative' : undefined" :disable="readOnly" :label="all.recording ? '■ Stop recording' : '● Record'" @click="record" />
        <p v-if="all.text" class="rv-note" role="status">{{ all.text }}</p>
        <p v-if="all.links.length" class="rv-note">Download:
          <template v-for="link in all.links" :key="link"><button class="rv-link" :data-download="link" @click="download(link)">{{ link }}{{ progress[link] ?? "" }}</button> </template></p>
      </section>
      <section v-if="!clock.live && clock.duration != null" aria-label="Playback range">
        <h3>Playback range</h3>
        <label class="rv-field">Start<input :value="clock.part?.[0] ?? 0" inputmode="decimal" :disabled="readOnly" title="Start, seconds; press [ to set it" @change="range('begin_at', $event)"></label>
        <label class="rv-field">End<input :value="clock.part?.[1] ?? 0" inputmode="decimal" :disabled="readOnly" title="End, seconds (0 = end of recording); press ] to set it" @change="range('end_at', $event)"></label>
        <span class="rv-actions">
          <q-btn v-for="[label, action] in ends" :key="action" outline dense no-caps size="sm" :label="label" :disable="readOnly" @click="act({ [action]: 1 })" />
        </span>
        <template v-if="all.exportable.length">
          <label class="rv-field">File<input v-model="part" placeholder="part-….mcap" :disabled="readOnly" title="New file with this range: .mcap, .bag, .mp4 or .csv; leave empty for a new .mcap"></label>
          <details>
            <summary>Topics to export ({{ parts.length || "all" }})</summary>
            <label v-for="topic in all.exportable" :key="topic" class="rv-check"><input v-model="parts" type="checkbox" :value="topic" :disabled="readOnly">{{ topic }}</label>
          </details>
          <q-btn dense no-caps outline :color="all.exporting ? 'negative' : undefined" :disable="readOnly" :label="all.exporting ? '■ Stop export' : 'Export range'" @click="exportIt" />
          <p v-if="all.exported" class="rv-note" role="status">{{ all.exported }}</p>
        </template>
      </section>
      <section aria-label="Save">
        <h3>Save</h3>
        <label v-for="[what, title] in saves" :key="what" class="rv-field">{{ what }}<input v-model="names[what]" :placeholder="what.toLowerCase() + '-….yaml'" :disabled="readOnly" :title="title">
          <q-btn outline dense no-caps size="sm" :disable="readOnly" :label="'Save ' + what.toLowerCase()" @click="save(what)" /></label>
        <p v-if="all.saved" class="rv-note" role="status">Saved {{ all.saved }}</p>
      </section>
    </div>`,
  props: { state: Object, readOnly: Boolean },
  data: () => ({
    all: { files: [], recent: [], topics: [], links: [], suffixes: [], opens: false, recording: false, text: "", uploads: "", folder: "", gib: 0, saved: "", exportable: [], exporting: false, exported: "" },
    clock: rv.clock.state, name: "", split: "", off: [], more: [], names: {}, progress: {}, adds: false, part: "", parts: [],
  }),
  computed: {
    isAddable() { return !this.clock.live && this.clock.duration != null; },
    chosen() { return this.all.topics.filter(([name, usual]) => (usual && !this.off.includes(name)) || this.more.includes(name)).map(([name]) => name); },
    ends: () => [["Set start", "begin"], ["Set end", "end"], ["Clear", "whole"]],
    saves: () => [["Parameters", "YAML file for --params and launch files"], ["Layout", "YAML file for --layout"]],
  },
  mounted() {
    this.socket = rv.live("/live/files", { message: (messages) => messages.forEach((message) => Object.assign(this.all, message)) });
    this.tick = () => (this.clock = rv.clock.state);
    rv.clock.addEventListener("change", this.tick);
  },
  beforeUnmount() {
    this.socket.close();
    rv.clock.removeEventListener("change", this.tick);
  },
  methods: {
    base: (path) => path.split("/").at(-1),
    ask(request) {
      this.socket.send(request);
    },
    act(action) {
      rv.clock.act(action);
    },
    open({ target }) {
      if (target.value) this.openIt(target.value);
      target.value = "";
    },
    openIt(name) {
      this.ask({ do: "open", name, add: this.adds && this.isAddable });
      this.adds = false;
    },
    address({ target }) {
      if (target.value.trim()) this.openIt(target.value.trim());
      target.value = "";
    },
    upload({ target }) {
      rv.upload([...target.files]);
      target.value = "";
    },
    pick(topic, on) {
      this.off = this.off.filter((one) => one !== topic);
      this.more = this.more.filter((one) => one !== topic);
      (on ? this.more : this.off).push(topic);
    },
    record() {
      if (this.all.recording) return this.ask({ do: "stop" });
      this.ask({ do: "record", name: this.name.trim(), split: this.split.trim(), topics: this.all.topics.length ? this.chosen : null });
      this.name = "";
    },
    exportIt() {
      if (this.all.exporting) return this.ask({ do: "stop_export" });
      const [start, end] = this.clock.part;
      const topics = this.parts.filter((topic) => this.all.exportable.includes(topic));
      this.ask({ do: "export", start, end, name: this.part.trim(), topics });
      this.part = "";
    },
    range(action, { target }) {
      const seconds = Number(target.value.replace(",", "."));
      if (Number.isFinite(seconds) && seconds >= 0) this.act({ [action]: seconds });
      else target.value = this.clock.part[action === "begin_at" ? 0 : 1] ?? 0;
    },
    save(what) {
      const layout = new URLSearchParams(location.search).get("layout") ?? "";
      this.ask({ do: "save", what: what.toLowerCase(), name: (this.names[what] ?? "").trim(), layout });
      this.names[what] = "";
    },
    async download(name) {
      const pieces = [];
      for (let at = 0, size = 1; at < size; at += pieces.at(-1).size) {
        const query = new URLSearchParams({ ask: "recorded", name, from: at });
        const answer = await fetch(`${rv.root}/?${query}`, { headers: { "X-Ros-Visualise": "1" } });
        if (!answer.ok) return;
        size = Number(answer.headers.get("X-Size"));
        pieces.push(await answer.blob());
        this.progress[name] = ` (${Math.floor((100 * at) / size)} %)`;
      }
      delete this.progress[name];
      const saved = document.createElement("a");
      saved.href = URL.createObjectURL(new Blob(pieces, { type: DOWNLOAD }));
      saved.download = name;
      saved.click();
      setTimeout(() => URL.revokeObjectURL(saved.href), 60_000);
    },
  },
};
