// The last seconds as curves, and the paper that a movement is drawn on.

const SECONDS = 10; // that are shown ...
const LONGER = [1, 3, 10, 30, 100, 300]; // ... times this where the arm's time passes faster than on the wall
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

export class Charts {
  constructor() {
    this.frames = []; // of the last seconds: bounded by time
    this.seconds = SECONDS;
    this.joint = 0;
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    new ResizeObserver(() => this.resize()).observe(document.getElementById("charts"));
    requestAnimationFrame(() => this.turn());
  }

  build(hello) {
    this.hello = hello;
    this.frames = [];
    this.draw();
  }

  // Take in a frame; the arm's time passes `pace` times as fast as on the wall.
  add(frame, pace = 1) {
    this.seconds = SECONDS * (LONGER.find((factor) => factor >= pace * 0.8) ?? LONGER.at(-1));
    const last = this.frames.at(-1);
    if (last && frame.time <= last.time) this.frames = []; // another clock
    this.frames.push(frame);
    let old = 0;
    while (this.frames[old].time < frame.time - this.seconds) old++;
    if (old) this.frames.splice(0, old);
    this.fresh = true;
  }

  turn() {
    if (this.fresh && this.plots && !document.hidden) {
      this.fresh = false;
      this.fill();
    }
    requestAnimationFrame(() => this.turn());
  }

  choose(joint) {
    this.joint = joint;
    this.draw();
  }

  size(id) {
    const place = document.getElementById(id);
    return { width: Math.max(place.clientWidth, 120), height: place.clientHeight };
  }

  resize() {
    this.plots?.forEach((plot, i) => plot.setSize(this.size(this.ids[i])));
  }

  draw() {
    if (!this.hello) return;
    this.plots?.forEach((plot) => plot.destroy());
    const [low, high] = this.hello.range, most = this.hello.most_bar;
    const blue = css("--blue"), orange = css("--orange"), sand = css("--sand"), two = this.hello.muscles > 1;
    this.ids = ["angle-chart", "pressure-chart", "valve-chart"];
    const wanted = { stroke: orange, width: 2, dash: [7, 5] }, is = { stroke: blue, width: 2.2 };
    this.plots = [
      this.plot(this.ids[0], [wanted, is], { range: [low, high], size: 44, values: (u, v) => v.map((one) => `${one}°`.replace("-", "\u2212")) }, false),
      this.plot(this.ids[1], [{ stroke: blue, width: 2 }, ...(two ? [{ stroke: sand, width: 2 }] : [])], { range: [0, most * 1.15], size: 44 }, false),
      this.plot(this.ids[2], [this.stepped(blue), ...(two ? [this.stepped(sand)] : [])], {
        range: two ? [-3, 3] : [0, 3], size: 44, splits: () => (two ? [-1.5, 1.5] : [1.5]), values: () => (two ? ["2", "1"] : ["1"]), grid: { show: false },
      }, true),
    ];
    this.fill();
  }

  stepped(color) { // fills between the line and its baseline would need bands; the line says it
    return { stroke: color, width: 1.8, paths: uPlot.paths.stepped({ align: 1 }) };
  }

  plot(id, series, { range, size, values, splits, grid }, times) {
    const soft = css("--soft"), line = css("--line"), font = "12px system-ui, sans-serif";
    const axis = { stroke: soft, font, ticks: { show: false }, grid: { stroke: line, width: 1, ...grid } };
    return new uPlot({
      ...this.size(id),
      padding: [6, 14, times ? 0 : 4, 0],
      legend: { show: false },
      cursor: { show: false },
      scales: { x: { time: false }, y: { range } },
      axes: [
        { ...axis, show: true, size: times ? 22 : 0, values: (u, all) => all.map((one) => (times ? `${one} s`.replace("-", "\u2212") : "")) },
        { ...axis, size, ...(values ? { values } : {}), ...(splits ? { splits } : {}), space: 28 },
      ],
      series: [{}, ...series.map((one) => ({ points: { show: false }, ...one }))],
    }, [[0], ...series.map(() => [null])], document.getElementById(id));
  }

  fill() {
    const frames = this.frames, j = this.joint;
    if (!frames.length) return;
    const end = frames.at(-1).time;
    const time = frames.map((one) => one.time - end);
    const x = { min: -this.seconds, max: 0 };
    const muscles = this.hello.muscles > 1 ? [0, 1] : [0];
    const valve = (m) => frames.map((one) => (m ? -1.5 : 1.5) + 1.2 * (one.valves?.[j]?.[m] ?? 0));
    const data = [
      [time, frames.map((one) => one.goal?.[j] ?? null), frames.map((one) => one.angle[j])],
      [time, ...muscles.map((m) => frames.map((one) => one.pressure[j][m]))],
      [time, ...muscles.map(valve)],
    ];
    this.plots.forEach((plot, i) => plot.batch(() => {
      plot.setData(data[i], false);
      plot.setScale("x", x);
    }));
  }
}

const MOST = 300; // points of a curve
const LEAD = 1; // s, in which the arm moves to where the curve begins

export class Paper {
  // `drawn(seconds, values)` is called when a curve is done: times and degrees of the joint that is chosen.
  constructor(canvas, drawn) {
    Object.assign(this, { canvas, drawn, points: [], trace: [], seconds: 4, joint: 0, began: null });
    canvas.addEventListener("pointerdown", (event) => this.down(event));
    canvas.addEventListener("pointermove", (event) => this.move(event));
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => this.up());
    new ResizeObserver(() => this.paint()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.paint());
  }

  build(goals, range) {
    this.goals = goals ?? [range];
    this.clear();
  }

  clear() {
    this.points = [];
    this.trace = [];
    this.paint();
  }

  get limits() { return this.goals?.[this.joint] ?? [-40, 40]; }

  place(event) {
    const box = this.canvas.getBoundingClientRect(), [low, high] = this.limits;
    const share = (event.clientX - box.left) / box.width, up = 1 - (event.clientY - box.top) / box.height;
    return [Math.min(Math.max(share, 0), 1) * this.seconds, low + Math.min(Math.max(up, 0), 1) * (high - low)];
  }

  down(event) {
    event.preventDefault();
    try { this.canvas.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone by now */ }
    this.points = [this.place(event)];
    this.trace = [];
    this.drawing = true;
    this.paint();
  }

  move(event) {
    if (!this.drawing) return;
    for (const one of event.getCoalescedEvents?.() ?? [event]) {
      const point = this.place(one);
      if (point[0] > this.points.at(-1)[0] + this.seconds / MOST) this.points.push(point);
    }
    this.paint();
  }

  up() {
    if (!this.drawing) return;
    this.drawing = false;
    if (this.points.length > 2) this.play();
    else this.clear();
  }

  sine() {
    const [low, high] = this.limits, n = 160;
    const middle = (low + high) / 2, size = Math.min(20, (high - low) * 0.4);
    this.points = Array.from({ length: n + 1 }, (_, i) => [i / n * this.seconds, middle + size * Math.sin(i / n * this.seconds * Math.PI)]);
    this.play();
  }

  play() {
    this.trace = [];
    this.began = null;
    const begin = this.points[0][0];
    this.drawn(this.points.map(([t]) => t - begin), this.points.map(([, degrees]) => degrees));
  }

  // What the arm does while it follows the curve.
  follow(frame) {
    this.began ??= frame.time;
    if (!this.points.length) return;
    const time = frame.time - this.began - LEAD;
    if (time < 0 || time > this.points.at(-1)[0] - this.points[0][0]) return;
    this.trace.push([time + this.points[0][0], frame.angle[this.joint]]);
    this.paint();
  }

  ended() { this.began = null; }

  paint() {
    const ratio = devicePixelRatio || 1, { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width) return;
    if (this.canvas.width !== Math.round(width * ratio)) this.canvas.width = Math.round(width * ratio);
    if (this.canvas.height !== Math.round(height * ratio)) this.canvas.height = Math.round(height * ratio);
    const pen = this.canvas.getContext("2d"), [low, high] = this.limits;
    const x = (t) => t / this.seconds * width, y = (degrees) => (1 - (degrees - low) / (high - low)) * height;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = css("--soft");
    pen.strokeStyle = css("--line");
    pen.lineWidth = 1;
    for (let degrees = Math.ceil(low / 10) * 10; degrees < high; degrees += 10) {
      pen.beginPath();
      pen.moveTo(0, y(degrees));
      pen.lineTo(width, y(degrees));
      pen.stroke();
      if (degrees % 20 === 0 && y(degrees) > 18) pen.fillText(`${degrees}°`.replace("-", "\u2212"), 5, y(degrees) - 3);
    }
    for (let t = 1; t < this.seconds; t++) {
      pen.beginPath();
      pen.moveTo(x(t), 0);
      pen.lineTo(x(t), height);
      pen.stroke();
      if (this.seconds <= 8 || t % 2 === 0) pen.fillText(`${t} s`, x(t) + 3, height - 5);
    }
    if (!this.points.length) {
      pen.font = "15px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.fillStyle = css("--card");
      pen.fillRect(width / 2 - 130, height / 2 - 28, 260, 54);
      pen.fillStyle = css("--ink");
      pen.fillText("Draw a curve here, from left to right.", width / 2, height / 2 - 8);
      pen.fillText("The arm follows it when you let go.", width / 2, height / 2 + 16);
      pen.textAlign = "start";
    }
    const line = (points, color, dash, size) => {
      pen.strokeStyle = color;
      pen.lineWidth = size;
      pen.lineJoin = pen.lineCap = "round";
      pen.setLineDash(dash);
      pen.beginPath();
      points.forEach(([t, degrees], i) => (i ? pen.lineTo(x(t), y(degrees)) : pen.moveTo(x(t), y(degrees))));
      pen.stroke();
      pen.setLineDash([]);
    };
    line(this.points, css("--orange"), [8, 6], 3);
    line(this.trace, css("--blue"), [], 3);
  }
}
