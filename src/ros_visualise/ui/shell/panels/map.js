// Tracks of NavSatFix topics, and what topics in GeoJSON place, on Leaflet's map: over a grid in metres, or over tiles if
// the user names their server.
import { leaflet as L } from "nicegui-leaflet";

const COLORS = ["#4dabf7", "#ff922b", "#51cf66", "#cc5de8", "#fcc419"];
const COLUMNS = 4096;
const PAUSE_MS = 150;
const METRES = 111320; // of a degree of latitude
const LINES = 80;
const IMAGE = /^data:image\/(png|jpeg|webp);base64,[\w+/=]*$/;

// A number as 1, 2 or 5 times a power of 10, not below what is given.
function round(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].find((step) => step * power >= value) * power;
}

export default {
  template: `
    <div class="rv-map">
      <div ref="map" class="rv-map-canvas" role="application" aria-label="Map"></div>
      <div class="rv-tools">
        <q-btn flat dense icon="fit_screen" aria-label="Fit" title="Show the whole track" @click="fit" />
        <span v-for="(topic, i) in [...topics, ...placed]" :key="topic"><b :style="{ color: color(i) }">●</b> {{ topic }}</span>
        <input v-model.lazy="tiles" type="url" aria-label="Address of map tiles" title="Address with {z}, {x} and {y}, from which map tiles are fetched"
          placeholder="Tiles: https://…/{z}/{x}/{y}.png" @change="lay">
      </div>
      <p v-if="isKnown && !topics.length && !placed.length" class="rv-map-note">No topics with satellite positions (NavSatFix) or GeoJSON</p>
      <p v-if="reason" class="rv-map-note">{{ reason }}</p>
    </div>`,
  props: { state: Object, readOnly: Boolean, resourcePath: String },
  data() {
    return { isKnown: false, topics: [], placed: [], tiles: this.state.tiles ?? "", reason: "" };
  },
  async mounted() {
    await new Promise((done) => {
      const link = Object.assign(document.createElement("link"), { rel: "stylesheet", href: `${rv.root}${this.resourcePath}/leaflet/leaflet.css` });
      link.onload = link.onerror = done;
      document.head.append(link);
    });
    this.tools = await import(`${rv.root}/parts/plot_chart.js`);
    if (this.isGone) return;
    this.map = L.map(this.$refs.map, { attributionControl: false, zoomSnap: 0.25, maxZoom: 24 });
    L.control.scale({ imperial: false }).addTo(this.map);
    this.grid = L.layerGroup().addTo(this.map);
    this.map.createPane("pictures").style.zIndex = 300; // over tiles, below lines
    this.tracks = L.layerGroup().addTo(this.map);
    this.features = new Map();
    const [lat, lng, zoom] = this.state.view ?? [0, 0, 2];
    this.map.setView([lat, lng], zoom);
    this.isMoved = !!this.state.view;
    this.map.on("moveend zoomend", this.drawGrid);
    this.map.on("dragend", () => (this.isMoved = true) && this.keep());
    this.map.getContainer().addEventListener("wheel", () => (this.isMoved = true) && setTimeout(this.keep, 500), { passive: true });
    this.sized = new ResizeObserver(() => {
      this.map.invalidateSize();
      if (!this.isMoved) this.fit(); // it may have been hidden until now
    });
    this.sized.observe(this.$refs.map);
    this.live = rv.live("/live/plots", { open: this.ask, message: this.take });
    this.geo = rv.live("/live/map", { message: this.takeFeatures });
    rv.offered.addEventListener("change", this.ask);
    rv.clock.addEventListener("change", this.place);
    rv.cursor.addEventListener("move", this.place);
    this.lay();
    this.ask();
  },
  beforeUnmount() {
    this.isGone = true;
    this.sized?.disconnect();
    this.live?.close();
    this.geo?.close();
    rv.offered.removeEventListener("change", this.ask);
    rv.clock.removeEventListener("change", this.place);
    rv.cursor.removeEventListener("move", this.place);
    this.map?.remove();
  },
  methods: {
    color: (i) => COLORS[i % COLORS.length],
    ask() {
      this.isKnown = !!rv.offered.state.topics;
      this.topics = (rv.offered.state.topics ?? []).filter(([, type]) => type.endsWith("/NavSatFix")).map(([name]) => name);
      const views = this.topics.map((topic) => ({ x: `${topic}:longitude`, y: `${topic}:latitude` }));
      this.live.send({ number: 1, views, from: null, to: null, columns: COLUMNS });
      this.place();
    },
    take(data) {
      if (!(data instanceof ArrayBuffer)) return this.takePlaces(data);
      const { header, rows } = this.tools.unpacked(data);
      this.reason = header.error ?? "";
      this.lines ??= new Map();
      this.lines.get(header.view)?.remove();
      const points = [];
      for (let i = 0; i < rows.length; i += header.width) {
        const [lng, lat, time] = rows.slice(i, i + 3);
        const isFix = Number.isFinite(lat) && Number.isFinite(lng) && (lat !== 0 || lng !== 0); // 0, 0 is no fix
        if (isFix) points.push([lat, lng, time]);
      }
      const line = L.polyline(points, { color: this.color(header.view), weight: 3 }).addTo(this.tracks);
      line.on("click", ({ latlng }) => this.seek(points, latlng));
      this.lines.set(header.view, line);
      if (!this.isMoved) this.fit();
    },
    // Draw what a topic places; a polygon with a picture is that picture.
    takeFeatures({ topic, geojson, tiles }) {
      if (tiles !== undefined) {
        this.served = tiles.startsWith("/") ? rv.root + tiles : tiles;
        return this.lay();
      }
      const isNew = !this.features.get(topic);
      this.features.get(topic)?.remove();
      this.features.delete(topic);
      if (geojson) this.features.set(topic, this.drawn(topic, geojson));
      this.placed = [...this.features.keys()];
      if (isNew && geojson && !this.isMoved) this.fit();
      if (isNew) this.drawGrid();
    },
    drawn(topic, geojson) {
      const group = L.featureGroup().addTo(this.map);
      const known = [...this.topics, ...this.placed];
      const color = this.color(known.includes(topic) ? known.indexOf(topic) : known.length);
      try {
        L.geoJSON(geojson, {
          filter: ({ properties }) => !properties?.image,
          style: { color, weight: 2, fillOpacity: 0.1 },
          pointToLayer: (_, place) => L.circleMarker(place, { radius: 5, color, fillColor: color, fillOpacity: 0.8 }),
          onEachFeature: ({ properties }, layer) => {
            const name = document.createElement("span");
            name.textContent = properties?.name ?? "";
            if (name.textContent) layer.bindTooltip(name);
          },
        }).addTo(group);
        for (const feature of geojson.features ?? []) {
          if (!IMAGE.test(feature.properties?.image ?? "")) continue;
          const bounds = L.geoJSON(feature).getBounds();
          L.imageOverlay(feature.properties.image, bounds, { pane: "pictures" }).addTo(group);
        }
        this.reason = "";
      } catch (error) {
        this.reason = `${topic}: not valid GeoJSON`;
      }
      return group;
    },
    // Ask where the robots are at the cursor, else at the time of playback.
    place() {
      if (this.placing || !this.topics.length) return;
      this.placing = setTimeout(() => {
        this.placing = null;
        const at = rv.cursor.at ?? rv.clock.state.position;
        if (at != null) this.live.send({ at, curves: this.topics.flatMap((topic) => [`${topic}:longitude`, `${topic}:latitude`]) });
      }, PAUSE_MS);
    },
    takePlaces({ values }) {
      if (!values) return;
      this.topics.forEach((topic, i) => {
        const [lng, lat] = values.slice(2 * i);
        if (!Number.isFinite(lat) || !Number.isFinite(lng)) return;
        this.spots ??= new Map();
        const spot = this.spots.get(topic) ?? L.circleMarker([lat, lng], { radius: 7, color: "#fff", fillColor: this.color(i), fillOpacity: 1 }).addTo(this.tracks);
        this.spots.set(topic, spot.setLatLng([lat, lng]));
      });
    },
    // Go to the time of the point of a track that is nearest to a click.
    seek(points, at) {
      if (this.readOnly) return;
      const nearest = points.reduce((a, b) => (this.map.distance(b, at) < this.map.distance(a, at) ? b : a));
      rv.clock.seek(nearest[2]);
    },
    fit() {
      const bounds = L.latLngBounds([]);
      for (const line of [...(this.lines?.values() ?? []), ...this.features.values()]) bounds.extend(line.getBounds());
      if (bounds.isValid() && this.map.getSize().x) this.map.fitBounds(bounds.pad(0.1), { maxZoom: 21, animate: false });
    },
    keep() {
      const { lat, lng } = this.map.getCenter();
      rv.keep(this.$el, { view: [Number(lat.toFixed(7)), Number(lng.toFixed(7)), this.map.getZoom()] });
    },
    lay() {
      this.tile?.remove();
      const address = this.tiles || this.served || "";
      this.tile = address.includes("{z}") && (this.served === address || /^https?:\/\//.test(address)) ? L.tileLayer(address, { maxZoom: 24, maxNativeZoom: 19 }).addTo(this.map) : null;
      if ((this.state.tiles ?? "") !== this.tiles) rv.keep(this.$el, { tiles: this.tiles });
      this.drawGrid();
    },
    // Lines in metres east and north of the middle of the first track.
    drawGrid() {
      this.grid.clearLayers();
      const first = [...(this.lines?.values() ?? []), ...this.features.values()].map((line) => line.getBounds()).find((one) => one.isValid());
      if (this.tile || !first?.isValid() || !this.map.getSize().x) return;
      const middle = first.getCenter();
      const east = METRES * Math.cos((middle.lat * Math.PI) / 180);
      const seen = this.map.getBounds();
      const width = (seen.getEast() - seen.getWest()) * east;
      const step = round(width / 10);
      const style = { color: "#8888", weight: 1, interactive: false };
      const draw = (from, to, metres, line) => {
        const [low, high] = [Math.ceil((from * metres) / step), Math.floor((to * metres) / step)];
        for (let i = low; i <= Math.min(high, low + LINES); i++) L.polyline(line((i * step) / metres), style).addTo(this.grid);
      };
      draw(seen.getWest() - middle.lng, seen.getEast() - middle.lng, east, (at) => [[seen.getSouth(), middle.lng + at], [seen.getNorth(), middle.lng + at]]);
      draw(seen.getSouth() - middle.lat, seen.getNorth() - middle.lat, METRES, (at) => [[middle.lat + at, seen.getWest()], [middle.lat + at, seen.getEast()]]);
    },
  },
};
