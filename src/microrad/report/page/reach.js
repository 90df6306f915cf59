// What scrolls sideways can be scrolled by the keyboard, the contents fold on a narrow screen, buttons choose rows.
(function () {
  "use strict";
  function reachable() {
    for (const box of document.querySelectorAll(".scroll, .picture")) {
      if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
      else box.removeAttribute("tabindex");
    }
  }
  addEventListener("resize", reachable);
  addEventListener("drawn", reachable);  // a figure, now interactive
  addEventListener("toggle", reachable, true);  // of details
  reachable();

  const contents = document.querySelector("nav.contents > details");
  if (contents) contents.open = matchMedia("(min-width: 70rem)").matches;

  // The table behind the buttons: those of the button that is pressed and hold the words that are searched.
  for (const box of document.querySelectorAll(".filters")) {
    const rows = [...box.nextElementSibling.querySelectorAll("tbody tr")];
    const buttons = [...box.querySelectorAll("button")], search = box.querySelector("input");
    const choose = () => {
      const of = buttons.find((b) => b.getAttribute("aria-pressed") === "true").dataset.rows;
      const chosen = of === "all" ? null : new Set(of.split(" ").filter(Boolean).map(Number));
      const wanted = search.value.toLowerCase();
      rows.forEach((row, i) => { row.hidden = (chosen !== null && !chosen.has(i)) || !row.textContent.toLowerCase().includes(wanted); });
    };
    for (const button of buttons) button.addEventListener("click", () => {
      for (const each of buttons) each.setAttribute("aria-pressed", String(each === button));
      choose();
    });
    search.addEventListener("input", choose);
  }
})();
