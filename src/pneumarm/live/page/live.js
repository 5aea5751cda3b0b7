// The page of a live arm: shows what comes over the connection, and sends what people want.

import { ArmDrawing } from "./arm.js";
import { Charts, Paper } from "./charts.js";
import { Movement, asDegrees, capital, finding, hint, lasted, learningNow } from "./words.js";

const BEAT = 250; // ms between two signs of life: who controls the arm and is silent has it held, then vented
const SENT = 33; // ms between two goals while one is dragged
const FADED = 120; // s after which what was wrong and is over is shown no more
const OLD = 1500; // ms after which what is shown is no longer what is

const $ = (id) => document.getElementById(id);
let socket = null, state = null, built = "", again = 500, beaten = 0, joint = 0, muscle = 1, frame = null, seen = 0;

function send(order) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(order));
}

// No stop is lost: without a connection it is sent as soon as there is one.
let toStop = false;
function stop() {
  toStop = socket?.readyState !== WebSocket.OPEN;
  if (toStop) notify("Not connected: the stop is sent as soon as this page is. Use the switch at the arm.");
  send({ do: "stop" });
}

const writes = () => state !== null && state.writer === state.you;

function beat() {
  const now = performance.now();
  if (now - beaten >= BEAT) {
    beaten = now;
    send({ do: "beat" });
  }
}

// ---- connection

function connect() {
  const scheme = location.protocol === "https:" ? "wss:" : "ws:";
  socket = new WebSocket(`${scheme}//${location.host}/connection${location.search}`);
  let first = true;
  socket.onmessage = ({ data }) => {
    const message = JSON.parse(data);
    if (message.frame?.angle) showFrame(message.frame);
    if (message.state) {
      showState(message.state);
      if (first && toStop) stop();
      if (first && message.state.writer === null) send({ do: "take" });
      first = false;
      again = 500;
    }
    if (message.refused) notify(message.refused);
    beat(); // timers sleep in a page that is not looked at; messages do not
  };
  socket.onclose = () => {
    document.body.dataset.role = "lost";
    $("role").textContent = "not connected: a moving arm holds, then is vented";
    $("control").hidden = true;
    state = null;
    showMode();
    setTimeout(connect, again);
    again = Math.min(again * 1.6, 4000);
  };
}

let silence = 0;
function notify(text) {
  $("notice").textContent = text;
  $("notice").hidden = !text;
  clearTimeout(silence);
  if (text) silence = setTimeout(() => { $("notice").hidden = true; }, 9000);
}

// ---- what is shown

function showFrame(now) {
  frame = now;
  seen = performance.now();
  if (!built) return;
  if (document.body.classList.contains("empty")) document.body.classList.remove("empty");
  movement.see(now, seen);
  drawing.show(now);
  charts.add(now, movement.pace);
  if (state?.mode === "following") paper.follow(now);
  [...$("angles").children].forEach((place, j) => {
    place.children[1].textContent = asDegrees(now.angle[j]);
    place.children[2].textContent = now.goal ? `goal ${asDegrees(now.goal[j])}` : "no goal";
  });
  showMode();
}

// What the arm is doing, and whether what is shown is how it is now.
function showMode() {
  const old = performance.now() - seen > OLD, lost = state === null;
  document.body.classList.toggle("old", old || lost);
  document.body.classList.toggle("blind", Boolean(state?.blind?.length)); // then the drawing tells nothing
  const words = lost ? "Not connected: this is how it was last seen" : movement.words(state, old);
  if ($("mode").textContent !== words) $("mode").textContent = words;
  const help = state ? hint(state, writes()) : "";
  if ($("hint").textContent !== help) $("hint").textContent = help;
  document.body.classList.toggle("goals", !lost && writes() && Boolean(state.controller) && !stopped() && state.mode !== "learning");
}

function build(now) {
  const key = JSON.stringify([now.arm, now.drawing, now.range, now.goals, now.most_bar, now.muscles]);
  if (key === built) return;
  built = key;
  drawing.build(now);
  charts.build(now);
  paper.build(now.goals, now.range);
  $("arm-name").textContent = now.arm;
  $("legend").textContent = [
    now.joints > 1 ? "Valves: \u25bd lets air in, \u25b3 lets it out; filled while open." : "",
    now.to_scale ? "" : "The measures of this arm are not known: it is not drawn to scale.",
  ].join(" ").trim();
  document.body.classList.toggle("one-muscle", now.muscles < 2);
  $("angles").replaceChildren(...now.drawing.links.map((_, j) => {
    const place = document.createElement("div");
    place.append(document.createElement("small"), document.createElement("b"), document.createElement("span"));
    place.firstChild.textContent = now.joints > 1 ? `joint ${j + 1}` : "angle";
    return place;
  }));
  document.querySelectorAll(".joints").forEach((row) => {
    row.hidden = now.joints < 2;
    choice(row, Array.from({ length: now.joints }, (_, j) => [j, `joint ${j + 1}`]), () => joint, (j) => {
      joint = j;
      charts.choose(j);
      paper.joint = j;
      paper.clear();
      showFaults(state);
    });
  });
  choice($("muscles"), [[1, "muscle 1"], [2, "muscle 2"]], () => muscle, (m) => {
    muscle = m;
    showFaults(state);
  });
}

function choice(row, options, chosen, choose) {
  row.replaceChildren(...options.map(([value, words]) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = words;
    button.setAttribute("aria-pressed", value === chosen());
    button.onclick = () => {
      choose(value);
      [...row.children].forEach((other, i) => other.setAttribute("aria-pressed", options[i][0] === value));
    };
    return button;
  }));
}

// Replace what is in `place` by what `make` returns, unless `key` is as before: what is being pressed stays there.
const keys = new Map();
function fill(place, key, make) {
  const text = JSON.stringify(key);
  if (keys.get(place) === text) return;
  keys.set(place, text);
  $(place).replaceChildren(...make());
}

function showState(now) {
  const before = state;
  state = now;
  if (now.drawing) build(now);
  document.body.dataset.mode = now.mode ?? "relaxed";
  document.body.dataset.role = writes() ? "writer" : "watcher";
  showMode();
  const stopped = now.mode === "stopped" || now.mode === "failed";
  $("stop").textContent = !stopped ? "Stop" : now.mode === "failed" ? "Try again" : "Release";
  $("stop").disabled = stopped && !writes();
  for (const id of ["hold", "relax"]) $(id).disabled = stopped || !writes() || now.mode === "learning" || (id === "hold" && !now.controller);
  $("draw").hidden = !now.controller;
  showRole(now);
  showLearning(now);
  showHealth(now);
  showChoices(now);
  showFaults(now);
  if (now.notice && now.notice !== before?.notice) notify(now.notice);
  if (before?.mode === "following" && now.mode !== "following") paper.ended();
  const curve = now.figures?.[now.controller]?.curve;
  $("followed").textContent = now.mode === "following" ? "following it \u2026" : curve == null ? "" : `last one followed within ${curve.toFixed(2)}° (RMS)`;
}

function showRole(now) {
  const others = now.pages - 1;
  const watching = others ? `, ${others} other page${others > 1 ? "s" : ""} open` : "";
  $("role").textContent = (writes() ? "you control the arm" : now.writer === null ? "nobody controls the arm" : "watching") + watching;
  const button = $("control");
  button.hidden = false;
  if (writes()) {
    button.textContent = now.asking === null ? "Let go" : "Somebody asks: hand over";
    button.classList.toggle("main", now.asking !== null);
    button.onclick = () => send({ do: "hand-over" });
  } else {
    button.textContent = now.writer === null ? "Take control" : now.asking === now.you ? "Asked for control" : "Ask for control";
    button.disabled = now.asking === now.you && now.writer !== null;
    button.classList.toggle("main", now.writer === null);
    button.onclick = () => send({ do: "take" });
  }
  if (writes()) button.disabled = false;
}

function showLearning(now) {
  const learning = now.learning, busy = now.mode === "learning";
  $("learn").hidden = !(now.can_learn || busy || learning?.done);
  $("learn-words").textContent = busy ? "" : learning?.done ? `Learned in ${lasted(learning.seconds)}; the report is ${learning.report}` : now.controller ? "" : "Nothing has learned to move this arm yet.";
  $("learn").classList.toggle("over", !busy && Boolean(learning?.done)); // then there is more to look at
  $("begin").hidden = busy || !now.can_learn;
  $("begin").disabled = !writes();
  $("begin").textContent = learning && !learning.done ? "Go on learning" : `Learn to move it: about ${now.minutes} min of the arm's time, then some of computing`;
  fill("stages", learning?.stages, () => (learning?.stages ?? []).map((stage) => {
    const line = document.createElement("li");
    line.className = stage.state;
    line.textContent = stage.words;
    if (stage.figures) line.append(Object.assign(document.createElement("small"), { textContent: stage.figures }));
    return line;
  }));
  $("progress").hidden = !busy;
  if (learning?.share == null) $("progress").removeAttribute("value");
  else $("progress").value = learning.share;
  $("learn-now").textContent = busy && learning ? learningNow(learning) : "";
}

function showHealth(now) {
  const learns = now.mode === "learning", time = frame?.time ?? 0;
  const lines = (now.wrong ?? []).map((one) => ["", finding(one, time)]);
  if (learns) lines.push(["over", "While it learns, what is noticed is written into the report."]);
  else if (!lines.length) lines.push(now.familiar ? ["fine", "Nothing unusual."] : ["over", "Nothing unusual so far. The monitor does not know this arm yet: it needs 20 s of movement."]);
  for (const one of now.was_wrong ?? []) {
    const left = 1 - (time - one[2]) / FADED;
    if (left > 0) lines.push(["over", finding(one, time), 0.3 + 0.7 * left]);
  }
  fill("wrong", lines, () => lines.map(([kind, text, opacity = 1]) => {
    const line = Object.assign(document.createElement("li"), { className: kind, textContent: text });
    line.style.opacity = opacity;
    return line;
  }));
  const counts = learns ? {} : {
    "the guard": now.guard, "control periods missed": now.missed,
    "air used": now.air == null ? null : `${now.air.toFixed(2)} normal litres`,
  };
  fill("counts", counts, () => Object.entries(counts).filter(([, value]) => value != null).flatMap(([name, value]) => [
    Object.assign(document.createElement("dt"), { textContent: name }), Object.assign(document.createElement("dd"), { textContent: value }),
  ]));
}

function showChoices(now) {
  const choices = now.choices ?? [];
  $("controllers").hidden = !choices.length;
  fill("choices", [choices, now.figures, now.controller, now.in_use, writes()], () => choices.map(([name, version]) => {
    const row = document.createElement("tr"), figures = now.figures?.[name];
    const number = (value, digits, unit) => (value == null ? "–" : `${value.toFixed(digits)}${unit}`);
    const acts = document.createElement("td");
    acts.append(now.controller === name ? "moves it" : button("Use", () => send({ do: "choose", controller: name })));
    row.append(acts);
    const cells = [
      name + (version !== null && version === now.in_use ? " (in use)" : ""),
      figures?.goals ? `${figures.settled} of ${figures.goals}` : "–",
      number(figures?.time, 2, " s"), number(figures?.rest, 2, "°"), number(figures?.curve, 2, "°"),
    ];
    for (const text of cells) row.append(Object.assign(document.createElement("td"), { textContent: text }));
    if (version !== null && version !== now.in_use) row.children[1].append(" ", button("Put back", () => send({ do: "put-back", version })));
    return row;
  }));
}

function button(words, press) {
  const made = Object.assign(document.createElement("button"), { type: "button", textContent: words, onclick: press });
  made.disabled = !writes();
  return made;
}

function showFaults(now) {
  $("faults").hidden = !now?.faults || now.mode === "learning";
  if ($("faults").hidden) return;
  fill("offered", [now.offered, now.faults, joint, muscle, writes()], () => Object.entries(now.offered).map(([kind, [words, place]]) => {
    const at = [kind, place === "arm" ? 0 : joint + 1, place === "muscle" ? muscle : 0];
    const on = now.faults.some((one) => one.every((value, i) => value === at[i]));
    const made = button(words, () => send({ do: "faults", kind, joint: joint + 1, muscle, on: !on }));
    made.setAttribute("aria-pressed", on);
    return made;
  }));
  const elsewhere = (j, m) => [now.joints > 1 && j ? `joint ${j}` : "", m && now.muscles > 1 ? `muscle ${m}` : ""].filter(Boolean).join(", ");
  fill("on", [now.faults, writes()], () => [...(now.faults.length ? ["on:"] : []), ...now.faults.map(([kind, j, m]) => {
    const words = [now.offered[kind][0], elsewhere(j, m)].filter(Boolean).join(", ");
    const made = button(`${words} \u00d7`, () => send({ do: "faults", kind, joint: j || 1, muscle: m || 1, on: false }));
    made.title = "switch it off";
    return made;
  })]);
}

// ---- what people want

let sent = 0, waiting = 0;
function goTo(degrees, last) {
  if (state && state.writer === null) send({ do: "take" });
  clearTimeout(waiting);
  const now = performance.now(), order = { do: "goal", degrees };
  if (last || now - sent >= SENT) {
    sent = now;
    send(order);
  } else waiting = setTimeout(() => goTo(degrees, true), SENT);
}

const movement = new Movement();
const drawing = new ArmDrawing($("arm"), goTo);
const charts = new Charts();
const paper = new Paper($("paper"), (seconds, values) => {
  if (state && state.writer === null) send({ do: "take" });
  const others = drawing.goal;
  send({ do: "draw", seconds, degrees: values.map((one) => others.map((goal, j) => (j === joint ? one : goal))) });
  $("again").disabled = false;
});

// On pressing, not on letting go: a stop is to be quick.
const stopped = () => state?.mode === "stopped" || state?.mode === "failed";
$("stop").addEventListener("pointerdown", () => { if (!stopped()) stop(); else pressedStopped = true; });
let pressedStopped = false;
$("stop").addEventListener("click", (event) => {
  if (event.detail === 0 && !stopped()) stop(); // by the keyboard
  else if (event.detail === 0) send({ do: "release" });
  else if (pressedStopped) send({ do: "release" });
  pressedStopped = false;
});
addEventListener("keydown", (event) => {
  if (event.key === "Escape" && !stopped()) stop();
});
$("hold").onclick = () => send({ do: "hold" });
$("relax").onclick = () => send({ do: "relax" });
$("begin").onclick = () => send({ do: "learn" });
$("again").onclick = () => paper.play();
$("sine").onclick = () => paper.sine();
$("seconds").onchange = () => {
  paper.seconds = Number($("seconds").value);
  paper.clear();
  $("again").disabled = true;
};

setInterval(() => { beat(); showMode(); }, BEAT);
connect();
