// viser's page in a frame, which hands on keys by rvKey and hears none before it has the focus.
export default {
  template: `<div><iframe id="rv-viser" ref="frame" :src="address" title="Graph" @load="$refs.frame.contentWindow.focus()"></iframe></div>`,
  props: { state: Object, readOnly: Boolean },
  data: () => ({ address: `${rv.root}/viser${document.getElementById("rv-foreign") ? "?foreign" : ""}` }),
};
