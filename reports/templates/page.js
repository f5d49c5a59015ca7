(function () {
  "use strict";
  const at = (id) => document.getElementById(id);
  const read = (id) => (at(id) ? JSON.parse(at(id).textContent) : null);
  const all = read("curves"), texts = read("texts");
  const cuts = all.cuts || [all], cut = at("cut"); // a study has several, so have tests of several specimens
  let curves, x, count, first, last;
  const chart = at("chart"), box = at("box"), tip = at("tip"), way = at("cursor"), said = at("at");
  const pick = at("member"), every = at("every"), space = "\u00a0";
  const shown = new Set();
  let now = null; // place of the cursor among the points
  let chosen = null; // number of the member among those of the page
  let frame = null; // scales of the last drawing

  // Show another cut: its curves, and what belongs to it alone.
  function show(k) {
    curves = cuts[k];
    x = curves.x;
    count = x.length;
    first = curves.log ? x[0] : Math.min(0, x[0]);
    last = x[count - 1];
    now = null;
    tip.hidden = true;
    way.max = String(count - 1);
    way.value = "0";
    said.textContent = "";
    document.querySelectorAll("[data-cut]").forEach((one) => { one.hidden = one.getAttribute("data-cut") !== String(k); });
    document.querySelectorAll("[data-curve]").forEach((one) => {
      const key = one.getAttribute("data-curve");
      one.closest("li").hidden = !(key === "band" ? curves.band : key in curves.names);
    });
  }

  const number = (value, places) => value.toFixed(places).replace("-", "\u2212");
  const valued = (value, kind) => (
    value === null ? "\u2013" : number(value, curves.places[kind || "force"]) + space + curves.axes.up[1]);
  const member = () => (chosen === null ? null : curves.members[chosen]);

  function make(parent, name, attributes, text) {
    const one = document.createElementNS(chart.namespaceURI, name);
    for (const key of Object.keys(attributes)) one.setAttribute(key, attributes[key]);
    if (text !== undefined) one.textContent = text;
    parent.appendChild(one);
    return one;
  }

  // Places of round numbers between two ends, about as many as asked for.
  function ticks(low, high, wanted) {
    const raw = (high - low) / wanted, power = Math.pow(10, Math.floor(Math.log10(raw)));
    const step = [1, 2, 5, 10].find((k) => k * power >= raw) * power;
    const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return found.map((value) => ({ value, text: number(value, places) }));
  }

  // Round numbers up an axis: two at least, for one alone has no scale.
  function upward(panel) {
    for (let wanted = panel.height / 45; ; wanted *= 1.3) {
      const found = ticks(panel.low, panel.high, wanted);
      if (found.length > 1) return found;
    }
  }

  // Powers of ten, where the way across is told by its logarithm.
  function decades() {
    const found = [];
    for (let k = Math.ceil(Math.log10(first) - 1e-9); Math.pow(10, k) <= last * (1 + 1e-9); k++) {
      found.push({ value: Math.pow(10, k), text: number(Math.pow(10, k), Math.max(0, -k)) });
    }
    return found;
  }

  function line(values, panel) {
    let path = "", pen = "M";
    values.forEach((value, k) => {
      if (value === null) { pen = "M"; return; }
      path += pen + frame.x(x[k]).toFixed(1) + " " + panel.y(value).toFixed(1);
      pen = "L";
    });
    return path;
  }

  function scale(lists, least, top, height) {
    const all = [].concat(...lists).filter((value) => value !== null && Math.abs(value) <= least.most);
    let low = Math.min(0, ...all), high = Math.max(0, ...all);
    const room = 0.05 * (high - low || 1);
    low = low < 0 ? low - room : 0;
    high += room;
    return { low, high, top, height, y: (value) => top + height * (high - value) / (high - low) };
  }

  function axes(panel, title, group) {
    const left = frame.left, right = frame.width - frame.right;
    upward(panel).forEach((tick) => {
      const y = panel.y(tick.value);
      make(group, "line", { class: "grid", x1: left, x2: right, y1: y, y2: y });
      make(group, "text", { x: left - 6, y: y + 4, "text-anchor": "end" }, tick.text);
    });
    (curves.log ? decades() : ticks(first, last, (right - left) / 70)).forEach((tick) => {
      const place = frame.x(tick.value), low = panel.top + panel.height;
      make(group, "line", { class: "grid", x1: place, x2: place, y1: panel.top, y2: low });
      if (panel === frame.lowest) make(group, "text", { x: place, y: low + 16, "text-anchor": "middle" }, tick.text);
    });
    make(group, "line", { class: "axis", x1: left, x2: right, y1: panel.y(0), y2: panel.y(0) });
    make(group, "text", { x: left, y: panel.top - 7 }, title);
  }

  function clip(name, panel) {
    const one = make(chart, "clipPath", { id: name });
    const size = { x: frame.left, y: panel.top, width: frame.width - frame.left - frame.right, height: panel.height };
    make(one, "rect", size);
    return make(chart, "g", { "clip-path": "url(#" + name + ")" });
  }

  function draw() {
    const width = Math.max(box.clientWidth, 260), own = member();
    const tall = Math.min(Math.max(0.46 * width, 220), 380), low = Math.min(Math.max(0.2 * width, 100), 150);
    frame = { width, left: 46, right: 8 };
    const part = (value) => (curves.log ? Math.log(value / first) / Math.log(last / first) : (value - first) / (last - first));
    frame.x = (value) => frame.left + (width - frame.left - frame.right) * part(value);
    const keys = Object.keys(curves.names).filter((key) => shown.has(key));
    const lists = keys.map((key) => curves.y[key]);
    const banded = curves.band && shown.has("band");
    const residual = own ? own.curve.map((value, k) => value - curves.y[curves.main[0]][k]) : null;
    // A curve of the report that leaves everything else far behind leaves the chart; a chosen member does not.
    const normal = curves.main.map((key) => curves.y[key]).concat(banded ? Object.values(curves.band) : []);
    const most = 1.5 * Math.max(...[].concat(...normal).map((value) => Math.abs(value || 0)));
    const ownMost = own ? Math.max(...own.curve.map(Math.abs)) : 0;
    frame.upper = scale(lists.concat(banded ? Object.values(curves.band) : [], own ? [own.curve] : []),
      { most: Math.max(most, ownMost) }, 24, tall);
    const spread = [curves.residual].concat(residual ? [residual] : []);
    const bare = curves.residual.every((value) => value === null); // nothing to compare with
    frame.lower = scale(spread, { most: Infinity }, 24 + tall + 34, low);
    frame.lowest = bare ? frame.upper : frame.lower;
    const height = frame.lowest.top + frame.lowest.height + 40;
    chart.replaceChildren();
    chart.setAttribute("viewBox", "0 0 " + width + " " + height);
    const back = make(chart, "g", {}), upper = clip("upper", frame.upper), lower = clip("lower", frame.lower);
    if (banded) {
      const ends = curves.band.high, under = curves.band.low;
      const edge = (values, k) => frame.x(x[k]).toFixed(1) + " " + frame.upper.y(values[k]).toFixed(1);
      const there = x.map((_, k) => k).filter((k) => ends[k] !== null && under[k] !== null);
      const around = there.map((k) => edge(ends, k)).concat(there.reverse().map((k) => edge(under, k)));
      make(upper, "path", { class: "band", d: "M" + around.join("L") + "Z" });
    }
    const noise = curves.noise, y = frame.lower.y;
    if (noise > 0) make(lower, "rect", { class: "noise", x: frame.left, y: y(noise), width: width - frame.left - frame.right,
      height: Math.max(y(-noise) - y(noise), 0) });
    const across = curves.axes.across, up = curves.axes.up;
    axes(frame.upper, up[0] + " [" + up[1] + "]", back);
    if (!bare) axes(frame.lower, "residual [" + up[1] + "]: " + curves.residual_name, back);
    make(back, "text", { x: width - frame.right, y: height - 6, "text-anchor": "end" }, across[0] + " [" + across[1] + "]");
    if (every && every.checked) {
      curves.members.forEach((one) => make(upper, "path", { class: "line every", d: line(one.curve, frame.upper) }));
    }
    keys.slice().reverse().forEach((key) => {
      make(upper, "path", { class: "line " + key, d: line(curves.y[key], frame.upper) });
    });
    if (!bare) make(lower, "path", { class: "line residual", d: line(curves.residual, frame.lower) });
    if (own) {
      make(upper, "path", { class: "line member", d: line(own.curve, frame.upper) });
      make(lower, "path", { class: "line member", d: line(residual, frame.lower) });
    }
    frame.keys = keys;
    frame.banded = banded;
    frame.mark = make(chart, "g", {});
    mark();
  }

  // Names and values at the cursor: class of the line, name, text, and the height of its dot.
  function values() {
    const rows = [], own = member();
    frame.keys.forEach((key) => {
      const value = curves.y[key][now];
      rows.push([key, curves.names[key], valued(value), value === null ? null : frame.upper.y(value)]);
    });
    if (frame.banded) {
      const ends = [curves.band.low[now], curves.band.high[now]];
      rows.push(["band", curves.band_name, valued(ends[0]) + " to " + valued(ends[1]), null]);
    }
    const rest = curves.residual[now];
    if (frame.lowest === frame.lower) {
      rows.push(["residual", "residual", valued(rest, "residual"), rest === null ? null : frame.lower.y(rest)]);
    }
    if (own) rows.push(["member", own.name, valued(own.curve[now]), frame.upper.y(own.curve[now])]);
    return rows;
  }

  function mark() {
    if (now === null) return;
    const place = frame.x(x[now]), rows = values();
    const plain = curves.log ? String(Number(x[now].toPrecision(3))) : number(x[now], curves.places.stroke);
    const stroke = plain + space + curves.axes.across[1];
    frame.mark.replaceChildren();
    const ends = { y1: frame.upper.top, y2: frame.lowest.top + frame.lowest.height };
    make(frame.mark, "line", Object.assign({ class: "now", x1: place, x2: place }, ends));
    rows.forEach((row) => {
      if (row[3] !== null) make(frame.mark, "circle", { class: "dot " + row[0], cx: place, cy: row[3], r: 4.5 });
    });
    tip.replaceChildren();
    [["head", curves.axes.across[0], stroke]].concat(rows).forEach((row) => {
      const one = document.createElement("div");
      one.className = row[0] === "head" ? "head" : "";
      [row[1], row[2]].forEach((text) => { one.appendChild(document.createElement("span")).textContent = text; });
      tip.appendChild(one);
    });
    way.value = String(now);
    way.setAttribute("aria-valuetext", [stroke].concat(rows.map((row) => row[1] + " " + row[2])).join(", "));
    said.textContent = stroke;
    const ratio = box.clientWidth / frame.width, there = place * ratio, wide = tip.offsetWidth;
    const right = there + 14 + wide < box.clientWidth;
    tip.style.left = Math.max(right ? there + 14 : there - 14 - wide, 0) + "px";
    tip.style.top = Math.max((frame.upper.top + frame.upper.height) * ratio - tip.offsetHeight - 6, 0) + "px";
  }

  function point(event) {
    const area = chart.getBoundingClientRect();
    const inside = (event.clientX - area.left) * frame.width / area.width;
    let best = 0;
    x.forEach((value, k) => { if (Math.abs(frame.x(value) - inside) < Math.abs(frame.x(x[best]) - inside)) best = k; });
    now = best;
    tip.hidden = false;
    mark();
    return (event.clientY - area.top) * frame.width / area.width;
  }

  // The member whose curve passes nearest to a click, where all are drawn.
  function click(event) {
    const height = point(event);
    if (!every || !every.checked) return;
    let best = null, least = 12;
    curves.members.forEach((one, k) => {
      const far = Math.abs(frame.upper.y(one.curve[now]) - height);
      if (far < least) { least = far; best = k; }
    });
    if (best !== null) choose(best);
  }

  function choose(k) {
    chosen = k;
    pick.value = k === null ? "" : String(k);
    at("chosen").parentNode.parentNode.hidden = k === null;
    if (k !== null) {
      at("chosen").tHead.rows[0].cells[1].textContent = curves.members[k].name.replace("m", "M");
      Array.from(at("chosen").tBodies[0].rows).forEach((row, j) => {
        row.cells[1].textContent = texts.values[k][j];
        row.cells[4].textContent = texts.inside[k][j];
        row.cells[4].className = texts.inside[k][j] === "no" ? "no" : "";
      });
    }
    Array.from(at("all").tBodies[0].rows).forEach((row, j) => {
      row.className = j === k ? "picked" : "";
      row.querySelector("button").setAttribute("aria-pressed", String(j === k));
    });
    draw();
  }

  function step(by) {
    const size = curves.members.length;
    choose(chosen === null ? (by > 0 ? 0 : size - 1) : (chosen + by + size) % size);
  }

  ["box", "legend", "choice"].map(at).filter(Boolean).concat(Array.from(document.querySelectorAll("p[hidden]")))
    .forEach((one) => { one.hidden = false; });
  show(0);
  if (cut) cut.addEventListener("change", () => { show(cut.selectedIndex); draw(); });
  document.querySelectorAll("[data-curve]").forEach((one) => {
    const key = one.getAttribute("data-curve");
    const set = () => { if (one.checked) shown.add(key); else shown.delete(key); };
    set();
    one.addEventListener("change", () => { set(); one.closest("li").classList.toggle("more", !one.checked); draw(); });
  });
  chart.addEventListener("pointermove", point);
  chart.addEventListener("pointerdown", point);
  chart.addEventListener("click", click);
  chart.addEventListener("pointerleave", (event) => { if (event.pointerType === "mouse") tip.hidden = true; });
  way.addEventListener("input", () => { now = Number(way.value); tip.hidden = false; mark(); });
  way.addEventListener("blur", () => { tip.hidden = true; });
  if (pick) {
    pick.addEventListener("change", () => choose(pick.value === "" ? null : Number(pick.value)));
    at("previous").addEventListener("click", () => step(-1));
    at("next").addEventListener("click", () => step(1));
    every.addEventListener("change", draw);
    document.querySelectorAll("[data-member]").forEach((one) => one.addEventListener("click", () => {
      choose(Number(one.getAttribute("data-member")));
      at("forces").scrollIntoView();
    }));
  }
  window.addEventListener("resize", draw);
  draw();
})();
