// The arm as a drawing: each joint's link, pulley and muscles with their valves, and the goal to be dragged.
// Lengths are millimetres. Angles are degrees from the middle of the range; higher ones turn the link to the right,
// where muscle 1 pulls. Where a joint has one muscle, a spring is drawn in place of the other. Reports and films show the
// same picture: report/drawn_arm.py, which says what the proportions are that come with the state.

const SVG = "http://www.w3.org/2000/svg";
const ABOVE = 52; // from the valves' hoses to the upper end of the picture: words stand there

function make(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

// A muscle from its upper end (0, 0) to (0, length): conical ends, thicker in the middle.
function spindle(length, width, shorter = 0) {
  const w = width / 2, end = Math.min(w * 0.9, length * 0.2), e = w * 0.45;
  return `M${-e} ${shorter}C${-w} ${shorter + end * 0.4} ${-w} ${end} ${-w} ${end * 1.4}V${length - end * 1.4}` +
    `C${-w} ${length - end} ${-w} ${length - end * 0.4} ${-e} ${length - shorter}H${e}` +
    `C${w} ${length - end * 0.4} ${w} ${length - end} ${w} ${length - end * 1.4}V${end * 1.4}` +
    `C${w} ${end} ${w} ${shorter + end * 0.4} ${e} ${shorter}Z`;
}

// A spring from (0, 0) to (0, length).
function coil(length, width, turns = 11) {
  const end = 12, step = (length - 2 * end) / (2 * turns);
  let path = `M0 0V${end}`;
  for (let k = 0; k < 2 * turns; k++) path += `L${(k % 2 ? -1 : 1) * width / 2} ${end + (k + 0.5) * step}`;
  return `${path}L0 ${length - end}V${length}`;
}

class Spring {
  constructor(parent, side, measures) {
    Object.assign(this, measures, { side });
    const group = make("g", { class: "spring", transform: `translate(${side * this.radius} ${-this.top})` }, parent);
    this.coil = make("path", { class: "coil" }, group);
    if (this.worded) make("text", beside(side, this.diameter, this.rest * 0.5), group).textContent = "spring";
  }

  show(angle) {
    const length = this.top - this.side * this.radius * angle * Math.PI / 180;
    this.coil.setAttribute("d", coil(length, this.diameter * 0.7));
  }
}

// Where words stand beside a muscle.
function beside(side, diameter, y) {
  return { x: side * (diameter * 0.75 + 6), y, "text-anchor": side > 0 ? "start" : "end" };
}

class Muscle {
  constructor(parent, side, measures) {
    this.side = side; // +1: muscle 1, on the right, pulls to higher angles
    this.number = side > 0 ? 1 : 2;
    Object.assign(this, measures); // radius, rest, diameter, top, worded, proportions
    this.group = make("g", { class: `muscle of-${this.number}`, transform: `translate(${side * this.radius} ${-this.top})` }, parent);
    this.tendon = make("line", { class: "tendon", x1: 0, x2: 0, y2: this.top }, this.group);
    this.rubber = make("path", { class: "rubber" }, this.group);
    this.air = make("path", { class: "air" }, this.group);
    this.weave = make("path", { class: "weave" }, this.group);
    const x = side * 15, plate = this.proportions.plate;
    this.inlet = make("path", { class: "valve", d: `M${x - 6} ${-plate - 9}h12l-6 9z` }, this.group);
    this.outlet = make("path", { class: "valve", d: `M${x - 6} ${-plate + 13}h12l-6 -9z` }, this.group);
    make("path", { class: "tendon", d: `M0 0V${-plate + 2}H${x}`, fill: "none" }, this.group);
    this.inGlow = make("path", { class: "open", d: this.inlet.getAttribute("d"), opacity: 0 }, this.group);
    this.outGlow = make("path", { class: "open", d: this.outlet.getAttribute("d"), opacity: 0 }, this.group);
    const name = make("text", { class: "name", ...beside(side, this.diameter, this.rest * 0.5) }, this.group);
    name.textContent = this.worded ? `muscle ${this.number}` : this.number;
    this.label = this.worded ? make("text", { ...beside(side, this.diameter, this.rest * 0.5), dy: "1.3em" }, this.group) : null;
    if (this.worded) {
      const at = { x: side * 26, "text-anchor": side > 0 ? "start" : "end" };
      make("text", { ...at, y: -plate - 1, dy: "-0.05em" }, this.group).textContent = "in";
      make("text", { ...at, y: -plate + 11, dy: "0.3em" }, this.group).textContent = "out";
    }
    this.light = [0, 0];
  }

  show(angle, pressure, most, valve) {
    const length = this.rest - this.side * this.radius * angle * Math.PI / 180;
    const { slim, swell, fullest, fading } = this.proportions;
    const full = Math.min(Math.max(pressure / most, 0), fullest);
    const width = this.diameter * (slim + swell * full * (this.rest / length));
    this.rubber.setAttribute("d", spindle(length, width));
    this.air.setAttribute("d", spindle(length, width * 0.86, 4));
    this.air.setAttribute("fill-opacity", (0.08 + 0.82 * Math.min(full, 1)).toFixed(3));
    let strands = "";
    for (let y = 12; y < length - 14; y += 9) strands += `M${-width * 0.4} ${y}L${width * 0.4} ${y + 8}M${width * 0.4} ${y}L${-width * 0.4} ${y + 8}`;
    this.weave.setAttribute("d", strands);
    this.tendon.setAttribute("y1", length);
    this.light[0] = Math.max(Math.sqrt(Math.max(valve, 0)), this.light[0] * fading);
    this.light[1] = Math.max(Math.sqrt(Math.max(-valve, 0)), this.light[1] * fading);
    this.inGlow.setAttribute("opacity", this.light[0].toFixed(2));
    this.outGlow.setAttribute("opacity", this.light[1].toFixed(2));
    if (this.label) this.label.textContent = `${pressure.toFixed(2)} bar`;
  }
}

export class ArmDrawing {
  // `moved(degrees)` is called while somebody drags the goal.
  constructor(svg, moved) {
    this.svg = svg;
    this.moved = moved;
    this.dragging = null;
    new ResizeObserver(() => this.fit()).observe(svg);
    for (const name of ["pointerdown", "pointermove", "pointerup", "pointercancel"]) svg.addEventListener(name, (event) => this[name](event));
  }

  build({ measures, muscles, range, goals, most_bar, proportions }) {
    this.svg.replaceChildren();
    this.each = muscles;
    this.proportions = proportions;
    this.links = measures.map((one) => one.link * 1000);
    this.range = range;
    this.goals = goals ?? measures.map(() => range);
    this.most = most_bar;
    this.goal = measures.map(() => 0);
    this.angle = measures.map(() => 0);
    const reach = this.links.reduce((a, b) => a + b, 0);
    const top = Math.min(measures[0].muscle * 1000, 230) + proportions.tendon + proportions.plate + ABOVE;
    let turned = 0, aside = 0; // as far as all links reach to a side together
    this.links.forEach((length, j) => {
      turned = Math.min(turned + Math.max(...this.goals[j].map(Math.abs)), 90);
      aside += length * Math.sin(turned * Math.PI / 180);
    });
    const half = Math.max(aside + 46, 150);
    this.svg.setAttribute("viewBox", `${-half} ${-top} ${2 * half} ${top + reach + 44}`);
    this.fit();
    if (measures.length === 1) this.scale(reach + 24);
    this.ghosts = this.chain((parent, j) => {
      make("line", { class: "ghost", x1: 0, y1: 0, x2: 0, y2: this.links[j] }, parent);
    }, "goal");
    this.handles = this.links.map(() => this.handle(Math.max(13, reach / 16)));
    this.muscles = [];
    this.joints = this.chain((parent, j, frame) => this.joint(parent, frame, j, measures[j]), "is");
    this.handleLayer = make("g", { class: "handles" }, this.svg);
    this.handleLayer.append(...this.handles);
    make("line", { class: "plate", x1: -70, x2: 70, y1: -top + ABOVE - 6, y2: -top + ABOVE - 6 }, this.svg);
    make("line", { class: "plate", x1: 0, x2: 0, y1: -top + ABOVE - 6, y2: 0, opacity: 0.14 }, this.svg);
  }

  // Text is as large on a phone as elsewhere.
  fit() {
    const scale = this.svg.getScreenCTM()?.a;
    if (scale) this.svg.style.setProperty("--millimetre", 1 / scale);
  }

  // Nested groups, one a joint, each turning about its hinge; `draw(turning group, j, group that does not turn)`.
  chain(draw, name) {
    const turning = [];
    let frame = make("g", { class: name }, this.svg);
    this.links.forEach((length, j) => {
      const still = make("g", { transform: j ? `translate(0 ${this.links[j - 1]})` : "" }, frame);
      const turn = make("g", {}, still);
      turning.push(turn);
      draw(turn, j, still);
      frame = turn;
    });
    return turning;
  }

  joint(turn, still, j, measures) {
    const room = j ? this.links[j - 1] * 0.6 : measures.muscle * 1000;
    const rest = Math.min(measures.muscle * 1000, room);
    const radius = measures.pulley * 1000, top = rest + this.proportions.tendon + radius * 0.8;
    const own = { radius, rest, diameter: measures.diameter * 1000, top, worded: this.links.length === 1, proportions: this.proportions };
    this.muscles.push([new Muscle(still, 1, own), this.each > 1 ? new Muscle(still, -1, own) : new Spring(still, -1, own)]);
    if (!own.worded) make("text", { class: "name", x: radius + 26, y: 4, "text-anchor": "start" }, still).textContent = `joint ${j + 1}`;
    make("line", { class: "link", x1: 0, y1: 0, x2: 0, y2: this.links[j] }, turn);
    make("line", { class: "bone", x1: 0, y1: 0, x2: 0, y2: this.links[j] }, turn);
    make("circle", { class: "pulley", r: radius }, turn);
    make("line", { class: "mark", x1: 0, y1: radius * 0.4, x2: 0, y2: radius }, turn);
    make("circle", { class: "weight", r: 4 }, turn);
    if (j === this.links.length - 1) make("circle", { class: "weight", cx: 0, cy: this.links[j], r: this.proportions.weight }, turn);
  }

  // What a goal is dragged by: a ring with arrows to both sides.
  handle(r) {
    const group = make("g", { class: "handle" });
    make("circle", { r }, group);
    for (const side of [-1, 1]) make("path", { d: `M${side * (r + 5)} -7L${side * (r + 14)} 0L${side * (r + 5)} 7Z` }, group);
    return group;
  }

  scale(radius) {
    const at = (degrees, r) => `${(r * Math.sin(degrees * Math.PI / 180)).toFixed(2)} ${(r * Math.cos(degrees * Math.PI / 180)).toFixed(2)}`;
    const [low, high] = this.goals[0];
    make("path", { class: "scale", d: `M${at(low, radius)}A${radius} ${radius} 0 0 0 ${at(high, radius)}` }, this.svg);
    for (let degrees = Math.ceil(low / 10) * 10; degrees <= high; degrees += 10) {
      make("path", { class: "tick", d: `M${at(degrees, radius - 3)}L${at(degrees, radius + 3)}` }, this.svg);
      const [x, y] = at(degrees, radius + 15).split(" ");
      make("text", { x, y: Number(y) + 4, "text-anchor": "middle" }, this.svg).textContent = `${degrees}°`.replace("-", "\u2212");
    }
  }

  show({ angle, goal, pressure, valves }) {
    this.angle = angle;
    this.joints.forEach((joint, j) => joint.setAttribute("transform", `rotate(${-angle[j]})`));
    this.muscles.forEach((pair, j) => pair.forEach((muscle, m) => muscle.show(angle[j], pressure[j][m] ?? 0, this.most, valves?.[j]?.[m] ?? 0)));
    if (this.dragging === null) this.place(goal ?? angle, goal !== null);
  }

  place(degrees, wanted) {
    this.goal = [...degrees];
    this.ghosts.forEach((ghost, j) => ghost.setAttribute("transform", `rotate(${-degrees[j]})`));
    let turned = 0;
    this.ends(degrees).forEach(([x, y], j) => {
      turned += degrees[j];
      this.handles[j].setAttribute("transform", `translate(${x} ${y}) rotate(${-turned})`);
    });
    this.ghosts[0].parentNode.parentNode.classList.toggle("no-goal", !wanted);
    this.handleLayer.classList.toggle("no-goal", !wanted);
  }

  // Where each link ends.
  ends(degrees) {
    let [x, y, turned] = [0, 0, 0];
    return this.links.map((length, j) => {
      turned += degrees[j] * Math.PI / 180;
      x += length * Math.sin(turned);
      y += length * Math.cos(turned);
      return [x, y];
    });
  }

  at(event) {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    return [point.x, point.y];
  }

  pointerdown(event) {
    if (!this.links || this.dragging !== null) return;
    const [x, y] = this.at(event);
    const far = this.ends(this.goal).map(([a, b]) => Math.hypot(x - a, y - b));
    if (y < 0 && far.every((one) => one > 60)) return; // up there are the muscles
    this.dragging = far.indexOf(Math.min(...far));
    try { this.svg.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone by now */ }
    event.preventDefault();
    this.pointermove(event);
  }

  pointermove(event) {
    const j = this.dragging;
    if (j === null) return;
    const [x, y] = this.at(event);
    const [fromX, fromY] = j ? this.ends(this.goal)[j - 1] : [0, 0];
    const before = this.goal.slice(0, j).reduce((a, b) => a + b, 0);
    let degrees = Math.atan2(x - fromX, y - fromY) * 180 / Math.PI - before;
    degrees = ((degrees + 540) % 360) - 180;
    const goal = [...this.goal];
    goal[j] = Math.min(Math.max(degrees, this.goals[j][0]), this.goals[j][1]);
    this.place(goal, true);
    this.moved(goal, false);
  }

  pointerup() {
    if (this.dragging === null) return;
    this.dragging = null;
    this.moved(this.goal, true);
  }

  pointercancel() { this.pointerup(); }
}
