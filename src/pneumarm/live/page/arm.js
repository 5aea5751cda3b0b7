// The arm as a drawing, with the goal to be dragged. What its shapes are comes with the state, from
// drawing/drawn_arm.py, which reports and films are drawn by too; here they are moved. Lengths are millimetres. Angles are
// degrees from the middle of the range; higher ones turn the link to the right, where muscle 1 pulls.

const SVG = "http://www.w3.org/2000/svg";
const ABOVE = 12; // from the drawing to the upper end of the picture

function make(name, attributes, parent) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  parent?.append(element);
  return element;
}

const paths = (shapes, parent) => shapes.map(([kind, d]) => make("path", { class: kind, d }, parent));

// A muscle, or the spring in its place.
class Muscle {
  constructor(parent, drawn, number, worded, drawing) {
    Object.assign(this, { drawn, drawing, light: [0, 0], swells: drawn.lights.length > 0 });
    const [x, y] = drawn.at, side = Math.sign(x), anchor = { "text-anchor": side > 0 ? "start" : "end" };
    const group = make("g", { class: `${this.swells ? "muscle" : "spring"} of-${number}`, transform: `translate(${x} ${y})` }, parent);
    paths(drawn.fixed, group);
    this.body = make("g", {}, group);
    this.air = paths(drawn.body, this.body)[1];
    this.lights = paths(drawn.lights, group);
    const words = (text, x, y, more = {}) => {
      const element = make("text", { x: side * x, y, ...anchor, ...more }, group);
      element.textContent = text;
      return element;
    };
    if (!worded && this.swells) words(number, 28, drawn.rest * 0.5, { class: "name" });
    if (!worded) return;
    words(this.swells ? `muscle ${number}` : "spring", 28, drawn.rest * 0.5, this.swells ? { class: "name" } : {});
    if (!this.swells) return;
    this.label = words("", 28, drawn.rest * 0.5, { dy: "1.3em" });
    words("in", 26, -drawing.plate_gap - 1, { dy: "-0.05em" });
    words("out", 26, -drawing.plate_gap + 11, { dy: "0.3em" });
  }

  show(angle, pressure, most, valve) {
    const { slim, swell, fullest, pale, air, fading } = this.drawing;
    const length = 1 - this.drawn.at[0] * angle * Math.PI / 180 / this.drawn.rest;
    const full = Math.min(Math.max(pressure / most, 0), fullest);
    this.body.setAttribute("transform", `scale(${this.swells ? slim + swell * full / length : 1} ${length})`);
    if (!this.swells) return;
    this.air.setAttribute("fill-opacity", (pale + air * Math.min(full, 1)).toFixed(3));
    this.light = [valve, -valve].map((open, i) => Math.max(Math.sqrt(Math.max(open, 0)), this.light[i] * fading));
    this.lights.forEach((light, i) => light.setAttribute("opacity", this.light[i].toFixed(2)));
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

  build({ drawing, range, goals, most_bar }) {
    const { links, above, plate, ghost, turning, muscles, style } = drawing;
    this.svg.innerHTML = style;
    this.links = links;
    this.goals = goals ?? links.map(() => range);
    this.most = most_bar;
    this.goal = links.map(() => 0);
    const reach = links.reduce((a, b) => a + b, 0), top = above + ABOVE;
    let turned = 0, aside = 0; // as far as all links reach to a side together
    links.forEach((length, j) => {
      turned = Math.min(turned + Math.max(...this.goals[j].map(Math.abs)), 90);
      aside += length * Math.sin(turned * Math.PI / 180);
    });
    const half = Math.max(aside + 46, 150), worded = links.length === 1;
    this.svg.setAttribute("viewBox", `${-half} ${-top} ${2 * half} ${top + reach + 44}`);
    this.fit();
    if (worded) this.scale(reach + 24);
    paths(plate, this.svg);
    this.ghosts = this.chain((turn, j) => paths(ghost[j], turn), "goal");
    this.handles = links.map(() => this.handle(Math.max(13, reach / 16)));
    this.muscles = [];
    this.joints = this.chain((turn, j, still) => {
      this.muscles.push(muscles[j].map((one, m) => new Muscle(still, one, m + 1, worded, drawing)));
      if (!worded) make("text", { class: "name", x: muscles[j][0].at[0] + 26, y: 4, "text-anchor": "start" }, still).textContent = `joint ${j + 1}`;
      paths(turning[j], turn);
    }, "is");
    this.handleLayer = make("g", { class: "handles" }, this.svg);
    this.handleLayer.append(...this.handles);
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
