// Makes the figures of the page interactive when they come into view. The static picture stays in the page: it prints.
(function () {
  "use strict";
  const VOID = 10, LEAST = 150, NARROW = 0.6, WIDEST = 1.15, GAP = 14, LETTER = 7.2, LINE = 16;
  const CONFIG = { displayModeBar: false, displaylogo: false, scrollZoom: false, doubleClick: "reset", responsive: false,
                   plotlyServerURL: "", topojsonURL: "", showTips: false };

  function element(name, attributes, parent, text) {
    const made = document.createElement(name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== undefined) made.textContent = text;
    if (parent) parent.append(made);
    return made;
  }

  // ------------------------------------------------------------------------------------------------ places
  // Boxes of data stretch; ticks, titles and colour bars keep their size; what is empty shrinks.
  function stretched(spans, kept, length) {
    const cuts = [...new Set([...spans, ...kept].flat())].sort((a, b) => a - b);
    const within = (list, a, b) => list.some(([from, to]) => from <= a && b <= to);
    const parts = cuts.slice(1).map((to, i) => {
      const from = cuts[i], size = to - from;
      if (within(spans, from, to)) return { size, grows: true };
      return { size: within(kept, from, to) ? size : Math.min(size, VOID), grows: false };
    });
    const total = (grows) => parts.filter((p) => p.grows === grows).reduce((sum, p) => sum + p.size, 0);
    const factor = length === null ? 1 : (length - total(false)) / total(true);
    const places = [0];
    for (const part of parts) places.push(places[places.length - 1] + part.size * (part.grows ? factor : 1));
    return { factor, length: places[places.length - 1], at: (value) => places[cuts.indexOf(value)] };
  }

  function beside(plot, width) {
    const boxes = [...plot.panels, ...plot.scales];
    const across = (which) => (box) => [box[which][0], box[which][2]];
    const down = (which) => (box) => [box[which][1], box[which][3]];
    const x = stretched(plot.panels.map(across("inner")), boxes.flatMap((b) => [across("outer")(b), across("inner")(b)]), width);
    const spans = plot.panels.map(down("inner"));
    const kept = boxes.flatMap((b) => [down("outer")(b), down("inner")(b)]);
    const fixed = stretched(spans, kept, null);
    const y = plot.ratio ? stretched(spans, kept, fixed.length + (x.factor - 1) * grown(spans)) : fixed;
    const place = ({ inner }) => ({ left: x.at(inner[0]), right: x.at(inner[2]), top: y.at(inner[1]), bottom: y.at(inner[3]) });
    const panels = plot.panels.map(place);
    const height = y.length + Math.max(...panels.map((box, i) => more(plot, i, box.right - box.left, false)));
    return { factor: x.factor, width, height, panels, scales: plot.scales.map(place), stacked: false };
  }

  function grown(spans) {
    const cuts = [...new Set(spans.flat())].sort((a, b) => a - b);
    return cuts.slice(1).reduce((sum, to, i) => sum + (spans.some(([a, b]) => a <= cuts[i] && to <= b) ? to - cuts[i] : 0), 0);
  }

  // All panels below each other, each with ticks and titles of its own.
  function below(plot, width) {
    const edge = (side, sign) => Math.max(...plot.panels.map((p) => sign * (p.outer[side] - p.inner[side])));
    const bars = plot.scales.map((bar) => bar.outer[2] - bar.inner[0] + VOID);
    const [left, top, right, bottom] = [edge(0, -1), edge(1, -1), edge(2, 1), edge(3, 1)];
    const far = Math.max(right, ...bars, 0);
    const across = Math.max(width - left - far, LEAST);
    const panels = [], order = plot.panels.map((_, i) => i);
    order.sort((a, b) => plot.panels[a].inner[1] - plot.panels[b].inner[1] || plot.panels[a].inner[0] - plot.panels[b].inner[0]);
    let y = 0;
    for (const i of order) {
      const { inner } = plot.panels[i];
      const high = plot.ratio ? (across * (inner[3] - inner[1])) / (inner[2] - inner[0]) : inner[3] - inner[1];
      panels[i] = { left, right: left + across, top: y + top, bottom: y + top + high };
      y += top + high + bottom + more(plot, i, across, true) + GAP;
    }
    const scales = plot.scales.map((bar) => ({ ...panels[bar.panel], left: left + across + VOID, right: left + across + VOID + bar.inner[2] - bar.inner[0] }));
    return { factor: 1, width: left + across + far, height: y - GAP, panels, scales, stacked: true };
  }

  // A title longer than its axis in lines, and how many they are. It may reach beyond the axis by a little.
  function inLines(title, length) {
    const most = Math.max((1.1 * length) / LETTER, 12), lines = [""];
    for (const word of title.split(" ")) {
      const last = lines[lines.length - 1], letters = (text) => text.replace(/<[^>]*>|&[^;]*;/g, ".").length;
      if (last && letters(last) + letters(word) + 1 > most) lines.push(word);
      else lines[lines.length - 1] = last ? `${last} ${word}` : word;
    }
    return [lines.join("<br>"), lines.length];
  }

  function more(plot, i, length, stacked) {
    const panel = plot.panels[i], own = plot.layout[panel.x];
    return own ? (inLines(stacked ? panel.titles[panel.x] : own.title.text, length)[1] - 1) * LINE : 0;
  }

  function placed(plot, available) {
    const width = Math.min(available, WIDEST * plot.size[0]);
    const wide = beside(plot, width);
    const columns = new Set(plot.panels.map((p) => p.inner[0])).size;
    if (columns > 1 && wide.factor < NARROW) return below(plot, width);
    const least = Math.min(...plot.panels.map((p, i) => wide.panels[i].right - wide.panels[i].left));
    return least >= LEAST || columns > 1 ? wide : beside(plot, width + LEAST - least);
  }

  function arranged(plot, place) {
    const layout = { width: place.width, height: place.height };
    const data = [];
    plot.panels.forEach((panel, i) => {
      const box = place.panels[i], fraction = (v, whole) => Math.min(Math.max(v / whole, 0), 1);
      layout[`${panel.x}.domain`] = [fraction(box.left, place.width), fraction(box.right, place.width)];
      layout[`${panel.y}.domain`] = [fraction(place.height - box.bottom, place.height), fraction(place.height - box.top, place.height)];
      const sizes = { [panel.x]: box.right - box.left, [panel.y]: box.bottom - box.top };
      for (const axis of [panel.x, panel.y]) {
        const own = plot.layout[axis];
        if (!own) continue;
        const shown = own.showticklabels || (place.stacked && Boolean(own.matches));
        layout[`${axis}.showticklabels`] = shown;
        layout[`${axis}.title.text`] = inLines(place.stacked ? panel.titles[axis] : own.title.text, sizes[axis])[0];
      }
    });
    plot.scales.forEach((bar, i) => {
      const box = place.scales[i];
      data.push([bar.trace, { "colorbar.x": box.left / place.width, "colorbar.xpad": 0, "colorbar.ypad": 0, "colorbar.xanchor": "left",
        "colorbar.y": 1 - (box.top + box.bottom) / 2 / place.height, "colorbar.len": (box.bottom - box.top) / place.height,
        "colorbar.thicknessmode": "pixels", "colorbar.thickness": box.right - box.left }]);
    });
    return { layout, data };
  }

  function assign(target, path, value) {
    const keys = path.split("."), last = keys.pop();
    const holder = keys.reduce((at, key) => (at[key] = at[key] || {}), target);
    holder[last] = value;
  }

  // ------------------------------------------------------------------------------------------------ legend
  function swatch(entry) {
    const space = "http://www.w3.org/2000/svg";
    const picture = document.createElementNS(space, "svg");
    const add = (name, attributes) => {
      const made = document.createElementNS(space, name);
      for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
      picture.append(made);
    };
    for (const [key, value] of Object.entries({ width: 30, height: 14, viewBox: "0 0 30 14", "aria-hidden": "true" })) picture.setAttribute(key, value);
    if (pale(entry)) add("rect", { width: 30, height: 14, fill: "#57606a" });
    if (entry.area) add("rect", { x: 3, y: 2, width: 24, height: 10, fill: entry.area });
    if (entry.line) {
      const w = entry.line.width, dashes = { solid: "", dash: `${4 * w} ${2 * w}`, dot: `${w} ${1.6 * w}`, dashdot: `${5 * w} ${2 * w} ${w} ${2 * w}` };
      const dash = entry.line.dash in dashes ? dashes[entry.line.dash] : entry.line.dash.replaceAll("px", "").replaceAll(",", " ");
      add("line", { x1: 1, x2: 29, y1: 7, y2: 7, stroke: entry.line.color, "stroke-width": w, "stroke-dasharray": dash });
    }
    if (entry.marker) {
      const m = entry.marker, r = Math.min(m.size / 2, 6), open = m.symbol.endsWith("-open");
      const paths = { circle: `M${15 - r},7a${r},${r} 0 1,0 ${2 * r},0a${r},${r} 0 1,0 ${-2 * r},0Z`, square: `M${15 - r},${7 - r}h${2 * r}v${2 * r}h${-2 * r}Z`,
        diamond: `M15,${7 - r}L${15 + r},7L15,${7 + r}L${15 - r},7Z`, "triangle-up": `M15,${7 - r}L${15 + r},${7 + r}H${15 - r}Z`,
        "triangle-down": `M15,${7 + r}L${15 + r},${7 - r}H${15 - r}Z`, "x-thin": `M${15 - r},${7 - r}l${2 * r},${2 * r}m${-2 * r},0l${2 * r},${-2 * r}`,
        "line-ns": `M15,${7 - r}v${2 * r}` };
      const line = m.line || { color: m.color, width: 1 };
      add("path", { d: paths[m.symbol.replace("-open", "")] || paths.circle, fill: open ? "none" : m.color, stroke: line.color || m.color, "stroke-width": line.width || 1 });
    }
    return picture;
  }

  function pale(entry) {
    return [entry.area, entry.line && entry.line.color, entry.marker && entry.marker.color].includes("#ffffff") && !(entry.marker && entry.marker.line);
  }

  function legend(plot, drawn, box) {
    for (const key of plot.keys) {
      const group = element("div", { class: "keys", role: "group", "aria-label": key.title || "Legend" }, box);
      if (key.title) element("span", { class: "of" }, group, key.title);
      for (const entry of key.entries) {
        const switches = entry.data.length + entry.shapes.length > 0;
        const made = element(switches ? "button" : "span", switches ? { type: "button", "aria-pressed": "true" } : { class: "key" }, group);
        made.append(swatch(entry), document.createTextNode(entry.label.replaceAll("\n", " ")));
        if (switches) made.addEventListener("click", () => toggle(made, entry, drawn));
      }
    }
  }

  function toggle(button, entry, drawn) {
    const shown = button.getAttribute("aria-pressed") !== "true";
    button.setAttribute("aria-pressed", String(shown));
    const shapes = Object.fromEntries(entry.shapes.map((i) => [`shapes[${i}].visible`, shown]));
    if (entry.data.length) Plotly.update(drawn, { visible: shown }, shapes, entry.data);
    else Plotly.relayout(drawn, shapes);
  }

  // ------------------------------------------------------------------------------------------------ buttons
  function axes(plot) {
    return Object.keys(plot.layout).filter((key) => /^[xy]axis\d*$/.test(key));
  }

  function zoom(plot, drawn, factor) {
    const ranges = {};
    for (const axis of axes(plot)) {
      const [a, b] = drawn.layout[axis].range, middle = (a + b) / 2, half = ((b - a) / 2) * factor;
      ranges[`${axis}.range`] = [middle - half, middle + half];
    }
    Plotly.relayout(drawn, ranges);
  }

  function reset(plot, drawn) {
    Plotly.relayout(drawn, Object.fromEntries(axes(plot).map((axis) => [`${axis}.range`, plot.layout[axis].range.slice()])));
  }

  function buttons(plot, drawn, bar, figure) {
    const add = (text, title, act) => {
      const made = element("button", { type: "button", title }, bar, text);
      made.addEventListener("click", () => act(made));
      return made;
    };
    add("Zoom in", "Half of each axis, about its middle", () => zoom(plot, drawn, 0.5));
    add("Zoom out", "Twice each axis, about its middle", () => zoom(plot, drawn, 2));
    const drag = add("Drag moves", "What dragging does: choose a part to zoom into, or move the view", (made) => {
      const pans = made.getAttribute("aria-pressed") !== "true";
      made.setAttribute("aria-pressed", String(pans));
      Plotly.relayout(drawn, { dragmode: pans ? "pan" : "zoom" });
    });
    drag.setAttribute("aria-pressed", "false");
    add("Reset", "The limits of the printed figure", () => reset(plot, drawn));
    add("Save CSV", "The points that are drawn, as a file", () => save(plot, figure.dataset.name));
  }

  function save(plot, name) {
    const quoted = (value) => (/[",\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ""));
    const rows = [["curve", "x", "y", "z"]];
    plot.data.forEach((trace, i) => {
      const curve = trace.name || `curve ${i + 1}`;
      if (trace.z) trace.z.forEach((row, j) => row.forEach((z, k) => rows.push([curve, trace.x[k], trace.y[j], z])));
      else (trace.x || []).forEach((x, j) => rows.push([curve, x, trace.y[j], ""]));
    });
    const url = URL.createObjectURL(new Blob([rows.map((row) => row.map(quoted).join(",")).join("\n") + "\n"], { type: "text/csv" }));
    element("a", { href: url, download: `${name}.csv` }).click();
    setTimeout(() => URL.revokeObjectURL(url), 1000);
  }

  // ------------------------------------------------------------------------------------------------ figures
  function build(figure) {
    const source = figure.querySelector("script.plot"), picture = figure.querySelector(".picture");
    const plot = JSON.parse(source.textContent);
    const box = element("div", { class: "interactive" });
    const bar = element("div", { class: "tools", role: "group", "aria-label": "View of the figure" }, box);
    const keys = element("div", { class: "legends" }, box);
    for (const line of plot.heading) element("div", { class: "heading", style: `color: ${line.color}` }, box, line.text);
    const scroll = element("div", { class: "scroll" }, box);
    const drawn = element("div", { role: "img", "aria-label": `${figure.getAttribute("aria-label")}, interactive` }, scroll);
    picture.after(box);
    const first = arranged(plot, placed(plot, box.clientWidth));
    const layout = JSON.parse(JSON.stringify(plot.layout)), data = plot.data.map((trace) => ({ ...trace }));
    for (const [path, value] of Object.entries(first.layout)) assign(layout, path, value);
    for (const [trace, values] of first.data) for (const [path, value] of Object.entries(values)) assign(data[trace], path, value);
    return Plotly.newPlot(drawn, data, layout, CONFIG).then(() => {
      legend(plot, drawn, keys);
      buttons(plot, drawn, bar, figure);
      figure.classList.add("ready");
      follow(plot, drawn, box);
      dispatchEvent(new Event("drawn"));
    });
  }

  function follow(plot, drawn, box) {
    let width = box.clientWidth;
    new ResizeObserver(() => {
      if (!box.clientWidth || Math.abs(box.clientWidth - width) < 2) return;
      width = box.clientWidth;
      const next = arranged(plot, placed(plot, width));
      Plotly.relayout(drawn, next.layout);
      for (const [trace, values] of next.data) Plotly.restyle(drawn, values, [trace]);
    }).observe(box);
  }

  const waiting = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      waiting.unobserve(target);
      build(target).catch((error) => {
        target.querySelector(".interactive")?.remove();
        console.error(`figure ${target.getAttribute("aria-label")}: ${error}`);
      });
    }
  }, { rootMargin: "300px" });
  for (const source of document.querySelectorAll("figure > script.plot")) waiting.observe(source.parentElement);
})();
