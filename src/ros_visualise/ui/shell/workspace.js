// Panels side by side: in rows and columns with edges to drag, several in one place as tabs. The page's
// address holds where they are and what each shows; the panels themselves are made by the server.
const EDGE = 6; // pixels between panels
const HEAD = 28; // pixels of the line with the tabs
const LEAST = 0.06; // of a row or column
const SHORTEST = 160; // pixels of a panel that opens below another
const NARROW = matchMedia("(max-width: 700px), (max-width: 900px) and (orientation: portrait)"); // panels stand under each other
const SHORT = 500; // pixels of height, below which the buttons of panels are a menu
const STEP = 0.03; // by which an arrow key moves an edge
const KEPT_MS = 300;
const [SEEN_MS, SEEN_STEP_MS] = [3000, 100];
const LONGEST = 7000; // characters of an address's query
const SAVED = "ros_visualise layouts";

// In addresses, ~ stands for ", which browsers would write as %22.
const swapped = (text) => text.replace(/["~]/g, (one) => (one === "~" ? '"' : "~"));
const isSplit = (place) => "row" in place || "column" in place;
const way = (place) => ("row" in place ? "row" : "column");

let count = 0;

// A layout as it is written -> places: splits with children and shares, or tabs with panels.
function read(written) {
  if (isSplit(written)) {
    const children = written[way(written)].map(read);
    const at = written.at?.length === children.length ? written.at : children.map(() => 1 / children.length);
    return { [way(written)]: children, at: [...at], key: ++count };
  }
  const panels = (written.tabs ?? [written]).map(({ panel, state = {} }) => ({ id: ++count, kind: panel, state }));
  return { panels, shown: Math.min(written.shown ?? 0, panels.length - 1), key: ++count };
}

function write(place) {
  if (isSplit(place)) return { [way(place)]: place[way(place)].map(write), at: place.at.map((share) => Number(share.toFixed(3))) };
  const panels = place.panels.map(({ kind, state }) => (Object.keys(state).length ? { panel: kind, state } : { panel: kind }));
  return panels.length === 1 ? panels[0] : { tabs: panels, shown: place.shown };
}

function* tabsOf(place) {
  if (!place) return;
  if (isSplit(place)) for (const child of place[way(place)]) yield* tabsOf(child);
  else yield place;
}

const isSpace = ({ panels, shown }) => panels[shown].kind === "space";
const isView = ({ panels, shown }) => ["image", "space"].includes(panels[shown].kind);

// A place without empty tabs, and without splits of a single one.
function tidy(place) {
  if (!isSplit(place)) return place.panels.length ? place : null;
  const kept = place[way(place)].map((child, i) => [tidy(child), place.at[i]]).filter(([child]) => child);
  if (kept.length < 2) return kept[0]?.[0] ?? null;
  const all = kept.reduce((sum, [, share]) => sum + share, 0);
  return { ...place, [way(place)]: kept.map(([child]) => child), at: kept.map(([, share]) => share / all) };
}

export default {
  template: `
    <div class="rv-workspace">
      <component :is="'style'">{{ css }}</component>
      <h1 class="rv-unseen">ros_visualise</h1>
      <div class="rv-room" ref="room" :class="{ 'rv-stacked': isNarrow }" @rv-keep="keep">
        <div class="rv-height" :style="{ height: total + 'px' }"></div>
        <div v-for="one in heads" :key="one.place.key" class="rv-tabs" :style="one.style" @dblclick="maximise(one.place)">
          <i role="tablist" aria-label="Panels" :aria-owns="one.place.panels.map(({ id }) => 'rv-tab-' + id).join(' ')"></i>
          <span v-for="(panel, i) in one.place.panels" :key="panel.id" class="rv-tab" :class="{ 'rv-shown': i === one.place.shown }">
            <button :id="'rv-tab-' + panel.id" role="tab" :aria-selected="String(i === one.place.shown)" @pointerdown="grab($event, one.place, panel)"
              @click="one.place.shown = i; changed()" @keydown.delete.stop="close(panel, true)">{{ title(panel) }}</button>
            <button class="rv-close" :aria-label="'Close ' + kinds[panel.kind].title" title="Close (Delete)" @click="close(panel, !$event.detail)">×</button>
          </span>
          <span class="rv-space"></span>
          <button v-if="!isNarrow" class="rv-close" :aria-label="maximal === one.place.key ? 'Restore' : 'Maximise'"
            :title="(maximal === one.place.key ? 'Restore' : 'Maximise') + ' (double click)'" @click="maximise(one.place)">⤢</button>
          <button v-if="!isNarrow" class="rv-close" aria-label="Move or split" title="Move or split">⋮
            <q-menu auto-close><q-list dense>
              <q-item v-for="[side, words] in sides" :key="side" clickable @click="move(one.place, side)"><q-item-section>{{ words }}</q-item-section></q-item>
            </q-list></q-menu>
          </button>
        </div>
        <slot></slot>
        <div v-for="edge in edges" :key="edge.key" class="rv-edge" :class="'rv-' + edge.way" role="separator" tabindex="0"
          :aria-orientation="edge.way === 'row' ? 'vertical' : 'horizontal'" aria-label="Panel size" :aria-valuenow="edge.share" :style="edge.style"
          @pointerdown="drag($event, edge)" @keydown="nudge($event, edge)"></div>
        <div v-if="target" class="rv-target" :style="target.style"></div>
        <div v-if="!root" class="rv-empty">Open a panel with the buttons at the edge, or
          <q-btn flat dense no-caps color="primary" label="restore the default layout" @click="restore" /></div>
      </div>
      <div class="rv-rail" role="toolbar" aria-label="Panels" :aria-orientation="isNarrow ? 'horizontal' : 'vertical'">
        <q-btn v-if="isSmall" flat dense no-caps icon="apps" :label="isNarrow ? 'Panels' : undefined" aria-label="Panels" title="Panels">
          <q-menu auto-close><q-list dense>
            <q-item v-for="(kind, name) in kinds" :key="name" clickable @click="open(name)"><q-item-section avatar><q-icon :name="kind.icon" :color="isOpen(name) ? 'primary' : undefined" /></q-item-section>
              <q-item-section>{{ kind.title }}</q-item-section></q-item>
          </q-list></q-menu>
        </q-btn>
        <div class="rv-kinds">
          <q-btn v-for="(kind, name) in isSmall ? {} : kinds" :key="name" flat dense :icon="kind.icon" :aria-label="kind.title" :title="kind.help ? kind.title + ': ' + kind.help : kind.title"
            :color="isOpen(name) ? 'primary' : undefined" @click="press(name)" />
        </div>
        <q-btn flat dense icon="search" aria-label="Search the page" title="Search; keyboard shortcuts (Ctrl+K or ?)" @click="search" />
        <q-btn flat dense icon="undo" aria-label="Undo" title="Undo (Ctrl+Z)" :disable="!undoable" @click="past.undo()" />
        <q-btn flat dense icon="redo" aria-label="Redo" title="Redo (Ctrl+Shift+Z)" :disable="!redoable" @click="past.redo()" />
        <q-btn flat dense icon="dashboard_customize" aria-label="Layouts" title="Layouts; to share the current one, copy the address of the page">
          <q-menu anchor="center left" self="center right"><q-list dense style="min-width: 12em">
            <q-item v-close-popup clickable @click="restore"><q-item-section>Default layout</q-item-section></q-item>
            <q-item v-for="(text, name) in saved" :key="name" v-close-popup clickable @click="load(text)"><q-item-section>{{ name }}</q-item-section>
              <q-item-section side><q-btn flat dense size="sm" icon="close" :aria-label="'Delete layout ' + name" @click.stop="forget(name)" /></q-item-section></q-item>
            <q-item><q-input v-model="name" dense label="Save as" @keydown.enter="save" /></q-item>
          </q-list></q-menu>
        </q-btn>
      </div>
    </div>`,
  props: { kinds: Object, layout: Object, standard: Object },
  data() {
    const saved = JSON.parse(localStorage.getItem(SAVED) ?? "{}");
    return { root: null, maximal: null, target: null, width: 1280, height: 720, saved, name: "", undoable: false, redoable: false, isOwn: false, isNarrow: false };
  },
  computed: {
    past: () => rv.past,
    sides: () => [["left", "Move to the left"], ["right", "Move to the right"], ["top", "Move to the top"], ["bottom", "Move to the bottom"]],
    isSmall() { return this.isNarrow || this.height < SHORT; },
    rects() {
      const found = [];
      const all = [...tabsOf(this.root)];
      const maximal = all.find((place) => place.key === this.maximal);
      const put = (place, x, y, w, h) => {
        if (!isSplit(place)) return found.push({ place, x, y, w, h });
        const isRow = way(place) === "row";
        const room = (isRow ? w : h) - EDGE * (place.at.length - 1);
        let from = isRow ? x : y;
        place[way(place)].forEach((child, i) => {
          const size = room * place.at[i];
          isRow ? put(child, from, y, size, h) : put(child, x, from, w, size);
          from += size;
          if (i < place.at.length - 1) found.push({ edge: place, i, isRow, x: isRow ? from : x, y: isRow ? y : from, w: isRow ? EDGE : w, h: isRow ? h : EDGE, room });
          from += EDGE;
        });
      };
      if (maximal) put(maximal, 0, 0, this.width, this.height);
      else if (this.isNarrow) {
        let from = 0;
        for (const place of this.stacked) {
          put(place, 0, from, this.width, this.tall(place));
          from += this.tall(place) + EDGE;
        }
      }
      else if (this.root) put(this.root, 0, 0, this.width, this.height);
      return found;
    },
    // Below one another: what is looked at, images before 3D, then its parameters, then the rest.
    stacked() {
      const all = [...tabsOf(this.root)];
      const views = all.filter((place) => isView(place)).sort((a, b) => isSpace(a) - isSpace(b));
      const nodes = all.filter((place) => !isView(place) && place.panels.some(({ kind }) => kind === "nodes"));
      const rest = all.filter((place) => !isView(place) && !nodes.includes(place));
      return [...views.slice(0, 1), ...nodes, ...views.slice(1), ...rest];
    },
    total() {
      return this.isNarrow && !this.maximal ? this.stacked.reduce((sum, place) => sum + this.tall(place) + EDGE, 0) : 0;
    },
    heads() {
      return this.rects.filter(({ place }) => place).map(({ place, x, y, w }) => ({ place, style: { left: `${x}px`, top: `${y}px`, width: `${w}px` } }));
    },
    edges() {
      return this.rects.filter(({ edge }) => edge).map(({ edge, i, isRow, x, y, w, h, room }) => ({
        key: `${edge.key} ${i}`, place: edge, i, room, way: isRow ? "row" : "column", share: Math.round(100 * edge.at[i]),
        style: { left: `${x}px`, top: `${y}px`, width: `${w}px`, height: `${h}px` },
      }));
    },
    css() {
      const shown = this.rects.filter(({ place }) => place);
      return shown.map(({ place, x, y, w, h }) =>
        `[data-panel="${place.panels[place.shown].id}"]{display:flex!important;left:${x}px;top:${y + HEAD}px;width:${w}px;height:${Math.max(h - HEAD, 0)}px}`).join("\n");
    },
  },
  created() {
    this.isOwn = !!this.layout;
    this.usual = this.standard;
    this.root = this.readable(this.layout ?? this.standard);
  },
  mounted() {
    this.sized = new ResizeObserver(([{ contentRect }]) => ({ width: this.width, height: this.height } = contentRect));
    this.sized.observe(this.$refs.room);
    this.turned = () => document.body.classList.toggle("rv-narrow", (this.isNarrow = NARROW.matches));
    NARROW.addEventListener("change", this.turned);
    this.turned();
    this.other = () => {
      const { layout } = rv.offered.state;
      if (!layout || JSON.stringify(layout) === JSON.stringify(this.usual)) return;
      this.usual = layout;
      if (!this.isOwn) this.restore();
    };
    rv.offered.addEventListener("change", this.other);
    this.other(); // another graph may have begun since the server made this page
    this.opened = ({ detail }) => (detail.id = this.open(detail.kind, detail.state, null, detail.serves));
    document.addEventListener("rv-open", this.opened);
    this.stepped = () => ([this.undoable, this.redoable] = [rv.past.done.length > 0, rv.past.undone.length > 0]);
    rv.past.addEventListener("change", this.stepped);
    this.text = this.written();
    this.tell();
    this.await(SEEN_MS / SEEN_STEP_MS);
  },
  beforeUnmount() {
    this.sized.disconnect();
    NARROW.removeEventListener("change", this.turned);
    document.removeEventListener("rv-open", this.opened);
    rv.offered.removeEventListener("change", this.other);
    rv.past.removeEventListener("change", this.stepped);
  },
  methods: {
    // A layout with the kinds of panels that are there.
    readable(written) {
      try {
        const root = written && read(JSON.parse(JSON.stringify(written)));
        for (const place of tabsOf(root)) {
          place.panels = place.panels.filter(({ kind }) => Object.hasOwn(this.kinds, kind));
          place.shown = Math.max(0, Math.min(place.shown, place.panels.length - 1));
        }
        return root && tidy(root);
      } catch {
        return null;
      }
    },
    tall(place) {
      if (this.stacked.length === 1) return Math.max(this.height, 240);
      return isView(place) ? 0.75 * this.width + HEAD : Math.max(0.6 * this.height, 240);
    },
    written() {
      return this.root ? JSON.stringify(write(this.root)) : "{}";
    },
    title({ kind, state }) {
      const { title } = this.kinds[kind];
      return state.title ?? (typeof state.topic === "string" ? state.topic : title);
    },
    all() {
      return [...tabsOf(this.root)].flatMap(({ panels }) => panels);
    },
    isOpen(kind) {
      return this.all().some((panel) => panel.kind === kind);
    },
    search() {
      document.dispatchEvent(new CustomEvent("rv-search"));
    },
    // Wait for the panels, but not for long.
    await(steps) {
      const isThere = ({ id }) => this.$refs.room?.querySelector(`[data-panel="${id}"]`);
      if (!steps || this.all().every(isThere)) return setTimeout(() => rv.offered.seen(), SEEN_STEP_MS);
      setTimeout(() => this.await(steps - 1), SEEN_STEP_MS);
    },
    tell() {
      const panels = this.all().map(({ id, kind, state }) => ({ id, kind, state }));
      this.$emit("panels", panels);
    },
    // Keep the layout in the address, and make it undoable.
    changed(isStep = true) {
      this.root = this.root && tidy(this.root);
      const [before, now] = [this.text, this.written()];
      if (now === before) return;
      this.isOwn = true;
      this.text = now;
      if (isStep) rv.past.did({ undo: () => this.become(before), redo: () => this.become(now) });
      this.address();
      this.tell();
    },
    become(text) {
      const there = this.all();
      this.root = this.readable(JSON.parse(text));
      for (const panel of this.all()) { // those that stay are not made anew
        const at = there.findIndex(({ kind, state }) => kind === panel.kind && JSON.stringify(state) === JSON.stringify(panel.state));
        if (at >= 0) panel.id = there.splice(at, 1)[0].id;
      }
      this.text = this.written();
      this.isOwn = this.text !== JSON.stringify(this.usual);
      this.address();
      this.tell();
    },
    address() {
      const url = new URL(location);
      url.searchParams.delete("layout");
      const rest = url.searchParams.toString();
      const own = this.isOwn ? `layout=${encodeURIComponent(swapped(this.text)).replace(/%(7B|7D|3A|2C|5B|5D|2F)/g, decodeURIComponent)}` : "";
      const query = [rest, own].filter(Boolean).join("&");
      if (query.length > LONGEST) return; // the server would refuse it
      history.replaceState(null, "", `${location.pathname}${query && `?${query}`}${location.hash}`);
    },
    keep({ target, detail }) {
      const id = Number(target.closest("[data-panel]")?.dataset.panel);
      const panel = this.all().find((one) => one.id === id);
      if (!panel) return;
      panel.state = { ...panel.state, ...detail };
      clearTimeout(this.keeping);
      this.keeping = setTimeout(() => {
        this.text = this.written();
        this.isOwn = true;
        this.address();
      }, KEPT_MS);
    },
    open(kind, state = {}, beside = null, serves = () => false) {
      if (!Object.hasOwn(this.kinds, kind)) return;
      const { many } = this.kinds[kind];
      const isSame = (one) => one.kind === kind && (!many || serves(one.state) || (Object.keys(state).length && JSON.stringify(one.state) === JSON.stringify(state)));
      const there = [...tabsOf(this.root)].find(({ panels }) => panels.some(isSame));
      if (there) {
        there.shown = there.panels.findIndex(isSame);
        if (this.maximal !== there.key) this.maximal = null;
        this.changed();
        this.scrollTo(isSame);
        return there.panels[there.shown].id;
      }
      const panel = { id: ++count, kind, state };
      const place = { panels: [panel], shown: 0, key: ++count };
      this.maximal = null;
      const alike = [...tabsOf(this.root)].find(({ panels }) => panels.some((one) => this.kinds[one.kind].side === this.kinds[kind].side));
      if (beside) this.put(place, beside, "centre");
      else if (!this.root) this.root = place;
      else if (alike && this.kinds[kind].side) this.put(place, alike, many && this.hasRoom(alike) ? "bottom" : "centre");
      else this.put(place, null, this.kinds[kind].side ?? "right");
      this.changed();
      this.scrollTo((one) => one.id === panel.id);
      return panel.id;
    },
    // Below one another, show the place of a panel.
    async scrollTo(isMeant) {
      await this.$nextTick();
      const found = this.rects.find(({ place }) => place?.panels.some(isMeant));
      if (this.isNarrow && found) this.$refs.room.scrollTo({ top: found.y, behavior: "smooth" });
    },
    // True if another panel can stand below a place.
    hasRoom(place) {
      return this.isNarrow || (this.rects.find((one) => one.place === place)?.h ?? Infinity) >= 2 * SHORTEST;
    },
    press(kind) {
      const there = this.all().filter((panel) => panel.kind === kind);
      if (!there.length || this.kinds[kind].many) return this.open(kind);
      there.forEach((panel) => this.remove(panel));
      this.changed();
    },
    async close(panel, isByKey) {
      const place = [...tabsOf(this.root)].find(({ panels }) => panels.includes(panel));
      this.remove(panel);
      this.changed();
      await this.$nextTick();
      const next = place.panels.length ? `#rv-tab-${place.panels[place.shown].id}` : "[role=tab]";
      if (isByKey) this.$refs.room.querySelector(next)?.focus();
    },
    remove(panel) {
      for (const place of tabsOf(this.root)) {
        place.panels = place.panels.filter((one) => one.id !== panel.id);
        place.shown = Math.max(0, Math.min(place.shown, place.panels.length - 1));
      }
    },
    // Put a place at a side of another, or of all (null).
    put(place, other, side) {
      if (other && side === "centre") {
        other.panels.push(...place.panels);
        other.shown = other.panels.length - 1;
        return;
      }
      const along = side === "top" || side === "bottom" ? "column" : "row";
      const isFirst = side === "left" || side === "top";
      const share = other ? 0.5 : 0.28;
      const split = (there) => ({ [along]: isFirst ? [place, there] : [there, place], at: isFirst ? [share, 1 - share] : [1 - share, share], key: ++count });
      const replaced = (there) => {
        if (there === other) return split(there);
        if (isSplit(there)) there[way(there)] = there[way(there)].map(replaced);
        return there;
      };
      this.root = other ? replaced(this.root) : this.root ? split(this.root) : place;
    },
    async move(place, side) {
      const moved = { ...place, panels: [...place.panels], key: ++count };
      place.panels = [];
      this.root = tidy(this.root);
      this.put(moved, null, side);
      this.changed();
      await this.$nextTick();
      this.$refs.room.querySelector(`#rv-tab-${moved.panels[moved.shown].id}`)?.focus();
    },
    maximise(place) {
      this.maximal = this.maximal === place.key ? null : place.key;
    },
    restore() {
      this.become(JSON.stringify(this.usual ?? {}));
      this.isOwn = false;
      this.address();
    },
    load(text) {
      const before = this.text;
      this.become(text);
      const now = this.text;
      rv.past.did({ undo: () => this.become(before), redo: () => this.become(now) });
    },
    save() {
      if (!this.name.trim()) return;
      this.saved = { ...this.saved, [this.name.trim()]: this.written() };
      this.name = "";
      localStorage.setItem(SAVED, JSON.stringify(this.saved));
    },
    forget(name) {
      delete this.saved[name];
      localStorage.setItem(SAVED, JSON.stringify(this.saved));
    },
    // An edge is dragged, or moved by keys.
    shift({ place, i, room }, pixels) {
      const both = place.at[i] + place.at[i + 1];
      const first = Math.min(Math.max(place.at[i] + pixels / room, LEAST), Math.max(both - LEAST, LEAST));
      [place.at[i], place.at[i + 1]] = [first, both - first];
    },
    drag(event, edge) {
      event.preventDefault();
      const { target } = event;
      target.setPointerCapture(event.pointerId);
      const along = edge.way === "row" ? "clientX" : "clientY";
      let from = event[along];
      target.onpointermove = (moved) => {
        this.shift(edge, moved[along] - from);
        from = moved[along];
      };
      target.onpointerup = target.onpointercancel = () => {
        target.onpointermove = target.onpointerup = target.onpointercancel = null;
        this.changed();
      };
    },
    nudge(event, edge) {
      const by = { ArrowLeft: -1, ArrowUp: -1, ArrowRight: 1, ArrowDown: 1 }[event.key];
      if (!by) return;
      event.preventDefault();
      event.stopPropagation();
      this.shift(edge, by * STEP * edge.room);
      this.changed();
    },
    // A tab is dragged to the middle of another place, or to its side.
    grab(event, place, panel) {
      if (event.button !== 0 || this.isNarrow) return;
      const { target } = event;
      const [x, y] = [event.clientX, event.clientY];
      const end = () => {
        target.onpointermove = target.onpointerup = target.onpointercancel = null;
        const found = this.target;
        this.target = null;
        if (found) this.drop(place, panel, found);
      };
      target.setPointerCapture(event.pointerId);
      target.onpointermove = (moved) => {
        if (this.target || Math.hypot(moved.clientX - x, moved.clientY - y) > 5) this.target = this.aim(moved, place);
      };
      target.onpointerup = end;
      target.onpointercancel = () => {
        this.target = null;
        end();
      };
    },
    aim({ clientX, clientY }, from) {
      const room = this.$refs.room.getBoundingClientRect();
      const [x, y] = [clientX - room.left, clientY - room.top];
      const found = this.rects.find((one) => one.place && x >= one.x && x < one.x + one.w && y >= one.y && y < one.y + one.h);
      if (!found || (found.place === from && from.panels.length === 1)) return null;
      const [u, v] = [(x - found.x) / found.w, (y - found.y) / found.h];
      const near = { left: u, right: 1 - u, top: v, bottom: 1 - v };
      const closest = Object.keys(near).reduce((a, b) => (near[a] < near[b] ? a : b));
      const side = near[closest] < 0.25 ? closest : "centre";
      const { x: left, y: top, w, h } = found;
      const box = { left: [left, top, w / 2, h], right: [left + w / 2, top, w / 2, h], top: [left, top, w, h / 2], bottom: [left, top + h / 2, w, h / 2], centre: [left, top, w, h] }[side];
      const style = Object.fromEntries(["left", "top", "width", "height"].map((name, i) => [name, `${box[i]}px`]));
      return { place: found.place, side, style };
    },
    drop(from, panel, { place, side }) {
      if (place === from && side === "centre") return;
      from.panels = from.panels.filter((one) => one !== panel);
      from.shown = Math.max(0, Math.min(from.shown, from.panels.length - 1));
      this.put({ panels: [panel], shown: 0, key: ++count }, place, side);
      this.maximal = null;
      this.changed();
    },
  },
};
