// A plot that is drawn many times a second. Its figure stays out of Vue, which would have every number watched.
// By the next frame the browser has also told what the pointer has done meanwhile; a hidden page has no frames.
const nextFrame = () =>
  new Promise((done) => {
    requestAnimationFrame(done);
    setTimeout(done, 100);
  });

export default {
  template: "<div></div>",
  mounted() {
    this.loaded = import("nicegui-plotly");
  },
  unmounted() {
    this.observer?.disconnect();
  },
  methods: {
    async draw(figure) {
      const { Plotly } = await this.loaded;
      await Plotly.react(this.$el, figure.data, figure.layout, { ...figure.config, responsive: false });
      if (!this.observer) {
        this.observer = new ResizeObserver(() => Plotly.Plots.resize(this.$el));
        this.observer.observe(this.$el);
      }
      await nextFrame();
    },
  },
};
