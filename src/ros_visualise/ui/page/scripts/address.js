// Keeps the page's settings in its address, behind the #, from data-address. A page that is opened
// with such an address, or whose program was restarted, sends it to the program, unless another web
// site opened the page (rv.isForeign). The address is that of the page around this one.
(() => {
  const { location, history } = parent;
  const PERIOD_MS = 500;
  const isForeign = rv.isForeign || parent.opener !== null;
  let run = ""; // of the program that has our address

  // A tab that is reloaded before the program has received it keeps it.
  const opened = location.hash || sessionStorage.getItem("rv-opened") || "";
  if (!isForeign) sessionStorage.setItem("rv-opened", opened);
  const replace = history.replaceState.bind(history);
  replace(null, "", location.pathname + (parent === window ? "" : location.search));
  window.history.replaceState = () => {}; // viser writes its address, which holds the token

  function send(hash, isSame) {
    const address = hash.replace(/^#/, "");
    if (address && !isSame(address)) rv.send("address", address);
  }

  function write(address) {
    if (address !== location.hash.slice(1))
      replace(null, "", location.pathname + location.search + (address && `#${address}`));
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
    write(there.address);
  }, PERIOD_MS);

  parent.addEventListener("hashchange", () => isForeign || send(location.hash, () => false));
})();
