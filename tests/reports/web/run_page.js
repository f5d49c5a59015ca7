// Runs the script of a page with the least of a document that it needs, and prints as JSON what a reader would see:
// curves drawn, the tip at the middle, and after each choice of a cut the same, with the caption that is shown.
"use strict";
const html = require("fs").readFileSync(process.argv[2], "utf8");
const script = html.match(/<script>([\s\S]*?)<\/script>\s*<\/body>/)[1];
const named = {}, all = [];

class Element {
  constructor(tag, attributes = {}) {
    Object.assign(this, { tag, attributes, children: [], style: {}, heard: {}, value: "", textContent: "" });
    Object.assign(this, { hidden: "hidden" in attributes, checked: "checked" in attributes, selectedIndex: 0 });
    Object.assign(this, { clientWidth: 800, offsetWidth: 100, offsetHeight: 80, namespaceURI: "svg" });
    this.classList = { toggle() {} };
  }
  setAttribute(key, value) { this.attributes[key] = String(value); }
  getAttribute(key) { return key in this.attributes ? this.attributes[key] : null; }
  appendChild(child) { this.children.push(child); return child; }
  replaceChildren() { this.children = []; }
  addEventListener(name, listener) { this.heard[name] = listener; }
  closest() { this.around = this.around || new Element("li"); return this.around; }
  getBoundingClientRect() { return { left: 0, top: 0, width: 800, height: 600 }; }
}

for (const [, tag, given] of html.replace(/<script[\s\S]*?<\/script>/g, "").matchAll(/<(\w+)((?:\s+[\w-]+(?:="[^"]*")?)*)>/g)) {
  const attributes = {};
  for (const [, key, value] of given.matchAll(/([\w-]+)(?:="([^"]*)")?/g)) attributes[key] = value || "";
  all.push(new Element(tag, attributes));
  if (attributes.id) named[attributes.id] = all[all.length - 1];
}
for (const [, id, text] of html.matchAll(/<script type="application\/json" id="(\w+)">([\s\S]*?)<\/script>/g)) {
  named[id] = new Element("script");
  named[id].textContent = text;
}
global.document = {
  getElementById: (id) => named[id] || null,
  createElement: (tag) => new Element(tag),
  createElementNS: (space, tag) => new Element(tag),
  querySelectorAll: (query) => {
    const [, key] = query.match(/\[([\w-]+)\]/);
    return all.filter((one) => key in one.attributes && (!query.startsWith("p[") || one.tag === "p"));
  },
};
global.window = { addEventListener() {} };
eval(script);

function seen() {
  const lines = [];
  const walk = (one) => { if (one.attributes.class && one.tag === "path") lines.push(one.attributes.class); one.children.forEach(walk); };
  walk(named.chart);
  named.chart.heard.pointermove({ clientX: 400, clientY: 100 });
  const tip = Object.fromEntries(named.tip.children.map((row) => row.children.map((part) => part.textContent)));
  const captions = all.filter((one) => "data-cut" in one.attributes && !one.hidden).map((one) => one.attributes["data-cut"]);
  const switches = all.filter((one) => "data-curve" in one.attributes && !one.closest().hidden);
  return { lines, tip, captions, switches: switches.map((one) => one.attributes["data-curve"]) };
}
const found = [seen()];
const cuts = named.cut ? JSON.parse(named.curves.textContent).cuts.length : 1;
for (let k = 1; k < cuts; k++) {
  named.cut.selectedIndex = k;
  named.cut.heard.change();
  found.push(seen());
}
console.log(JSON.stringify(found));
