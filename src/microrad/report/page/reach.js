// What scrolls sideways can be scrolled by the keyboard, the contents fold on a narrow screen, a link opens what is
// folded about its place, buttons choose rows.
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

  const contents = document.querySelector("nav.contents > details"), wide = matchMedia("(min-width: 70rem)");
  const fold = () => { contents.open = wide.matches; };
  if (contents) {
    fold();
    wide.addEventListener("change", fold);
  }

  // Whether something about the place that a link leads to had to be opened.
  function opened(hash) {
    let found = false;
    for (let at = hash.length > 1 ? document.getElementById(hash.slice(1)) : null; at; at = at.parentElement) {
      if (at.tagName !== "DETAILS" || at.open) continue;
      found = at.open = true;
    }
    return found;
  }
  function arrive() {
    if (opened(location.hash)) document.getElementById(location.hash.slice(1)).scrollIntoView();
  }
  addEventListener("click", (event) => {  // also a second time, which changes no address
    const link = event.target.closest('a[href^="#"]');
    if (link) opened(link.hash);
  });
  addEventListener("hashchange", arrive);
  arrive();

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
