// A plot that may be drawn many times a second. Its figure stays out of Vue, which would have every number watched.
// By the next frame the browser has also told what the pointer has done meanwhile; a hidden page has no frames.
const nextFrame = () =>
  new Promise((done) => {
    requestAnimationFrame(done);
    setTimeout(done, 100);
  });

export default {
  template: "<div></div>",
  props: { begin: Object },
  mounted() {
    this.loaded = import("nicegui-plotly");
    if (this.begin) this.draw(this.begin);
  },
  unmounted() {
    this.observer?.disconnect();
  },
  methods: {
    async draw(figure) {
      const { Plotly } = await this.loaded;
      this.rows = figure.rows;
      this.width = this.$el.clientWidth;
      const layout = { ...figure.layout, ...(this.width ? { width: this.width } : {}) };
      await Plotly.react(this.$el, figure.data, layout, { ...figure.config, responsive: false });
      await this.keepRows(Plotly);
      if (!this.observer) {
        this.observer = new ResizeObserver(() => this.fit(Plotly));
        this.observer.observe(this.$el);
      }
      await nextFrame();
    },
    async fit(Plotly) {
      const width = this.$el.clientWidth;
      if (!width || width === this.width) return;
      this.width = width;
      await Plotly.relayout(this.$el, { width });
      await this.keepRows(Plotly);
    },
    // A legend that needs more lines in a narrow place makes the figure higher, not its data smaller. A higher figure may
    // show more of its legend, so this takes a few steps.
    async keepRows(Plotly) {
      for (let step = 0; step < 4; step++) {
        const { height, _size } = this.$el._fullLayout;
        const missing = this.rows ? Math.round(this.rows - _size.h) : 0;
        if (Math.abs(missing) < 8) return;
        await Plotly.relayout(this.$el, { height: height + missing });
      }
    },
  },
};
