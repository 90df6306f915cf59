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
      const { height, ...layout } = figure.layout;
      this.rows = figure.rows;
      if (height) this.$el.style.height = `${height}px`;
      await Plotly.react(this.$el, figure.data, layout, { ...figure.config, responsive: false });
      await this.keepRows(Plotly);
      if (!this.observer) {
        this.observer = new ResizeObserver(async () => {
          await Plotly.Plots.resize(this.$el);
          await this.keepRows(Plotly);
        });
        this.observer.observe(this.$el);
      }
      await nextFrame();
    },
    // A legend that needs more lines in a narrow place makes the figure higher, not its data smaller. A higher figure may
    // have more of its legend shown, so this takes a few steps.
    async keepRows(Plotly) {
      for (let step = 0; step < 4; step++) {
        const missing = this.rows ? Math.round(this.rows - this.$el._fullLayout._size.h) : 0;
        if (Math.abs(missing) < 8 || !this.$el.clientHeight) return;
        this.$el.style.height = `${this.$el.clientHeight + missing}px`;
        await Plotly.Plots.resize(this.$el);
      }
    },
  },
};
