// A number of the mission as a field and a slider, with what is wrong with it. It keeps what it shows by itself: for a
// change of a property, NiceGUI would build the whole page anew.
// What is typed is let go with the focus, so before a click elsewhere is told; Quasar's own blur comes behind it.
const TYPING_MS = 150;
const MOVING_MS = 20;

export default {
  template: `
    <div class="slider" @focusout="settle">
      <q-input dense autocomplete="off" spellcheck="false" :label="label" :model-value="text"
        :aria-invalid="fault ? 'true' : 'false'"
        @update:model-value="typing" @keydown.enter="settle" />
      <q-slider v-if="steps" color="primary" :min="0" :max="steps" :step="1" :model-value="place"
        :aria-label="label + ', slider'" @update:model-value="moving" @change="release" />
      <div v-show="fault" class="slider-fault" role="alert">{{ fault }}</div>
    </div>
  `,
  props: { label: String, begin: Object },
  emits: ["try_text", "set_text", "try_place", "set_place"],
  data() {
    return { text: "", place: 0, steps: 0, fault: "", ...this.begin };
  },
  created() {
    this.timer = this.waiting = null;
    this.typed = false;
  },
  unmounted() {
    this.drop();
  },
  methods: {
    show(changed) {
      Object.assign(this, changed);
    },
    typing(text) {
      this.text = text ?? "";
      this.typed = true;
      this.tell("try_text", this.text, TYPING_MS);
    },
    moving(place) {
      const first = this.timer === null;
      this.place = place;
      this.typed = false; // the field, which loses the focus next, has nothing to say any more
      this.tell("try_place", place, MOVING_MS);
      if (first) this.flush();
    },
    settle() {
      if (!this.typed) return;
      this.typed = false;
      this.drop();
      this.$emit("set_text", this.text);
    },
    release(place) {
      this.drop();
      this.$emit("set_place", place);
    },
    // The newest of what is told within a time is told at its end, unless it has been let go before.
    tell(event, value, wait) {
      this.waiting = [event, value];
      this.timer ??= setTimeout(() => {
        this.timer = null;
        this.flush();
      }, wait);
    },
    flush() {
      if (this.waiting) this.$emit(...this.waiting);
      this.waiting = null;
    },
    drop() {
      clearTimeout(this.timer);
      this.timer = this.waiting = null;
    },
  },
};
