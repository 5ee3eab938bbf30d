// Keeps the page's settings in its address, behind the #: the program's, from data-address, and
// "view=x,y,z,x,y,z", position and target of this browser's camera, from data-anchor. A page that is
// opened with such an address, or whose program was restarted, sends it to the program, unless
// another web site opened the page (rv.isForeign). The address is that of the page around this one.
(() => {
  const { location, history } = parent;
  const PERIOD_MS = 500;
  const isForeign = rv.isForeign || parent.opener !== null;
  let run = ""; // of the program that has our address
  let view = "";
  let isMoved = false; // the camera, by hand

  // A tab that is reloaded before the program has received it keeps it.
  const opened = location.hash || sessionStorage.getItem("rv-opened") || "";
  if (!isForeign) sessionStorage.setItem("rv-opened", opened);
  const replace = history.replaceState.bind(history);
  replace(null, "", location.pathname + (parent === window ? "" : location.search));
  window.history.replaceState = () => {}; // viser writes its address, which holds the token

  function split(hash) {
    const [, address, view] = hash.match(/^#?(.*?)(?:(?:^|&|(?<=#))view=([^&]*))?$/);
    return { address, view: view ?? "" };
  }

  function send(hash, isSame) {
    const found = split(hash);
    if (found.address && !isSame(found.address)) rv.send("address", found.address);
    if (found.view) rv.send("view", (view = found.view));
  }

  function look(anchor) {
    const from = anchor.split(",").map(Number);
    const { position, look_at } = rv.camera;
    const places = [...position, ...look_at].map((xyz, i) => (xyz - from[i % 3]).toFixed(2));
    return places.join(",");
  }

  function write(address) {
    const hash = [address, view && `view=${view}`].filter(Boolean).join("&");
    if (hash !== location.hash.slice(1))
      replace(null, "", location.pathname + location.search + (hash && `#${hash}`));
    sessionStorage.setItem("rv-shown", `${run} ${address}`);
    sessionStorage.removeItem("rv-opened");
  }

  setInterval(() => {
    const there = document.querySelector("[data-address]")?.dataset;
    if (!there) return;
    if (there.run !== run) {
      const hash = run ? location.hash : opened;
      run = there.run;
      // A reloaded tab sends nothing: others may have changed settings since.
      const shown = sessionStorage.getItem("rv-shown");
      if (!isForeign) return send(hash, (address) => shown === `${run} ${address}`);
    }
    if (isMoved && rv.camera) view = look(there.anchor);
    write(there.address);
  }, PERIOD_MS);

  for (const moved of ["pointerdown", "wheel"])
    window.addEventListener(moved, (event) => (isMoved ||= event.target.matches?.("canvas")), true);
  parent.addEventListener("hashchange", () => isForeign || send(location.hash, () => false));
})();
