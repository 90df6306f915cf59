// What scrolls sideways can be reached and scrolled by the keyboard.
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
})();
