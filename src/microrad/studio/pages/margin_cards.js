// The margins of the links side by side; see slider.js for why they keep what they show by themselves.
export default {
  template: `
    <div class="margins">
      <div v-for="card in cards" :key="card.name" class="margin-card">
        <div class="soft">{{ card.name }}</div>
        <div class="value">{{ card.value }}</div>
        <div :class="card.met ? 'PASS' : 'FAIL'">{{ card.needs }}</div>
      </div>
    </div>
  `,
  data() {
    return { cards: [] };
  },
  methods: {
    show(cards) {
      this.cards = cards;
    },
  },
};
