// The first day of an arm by questions. When it is over, the live page is at the same address.

const TURN = 300; // ms between two looks
const $ = (id) => document.getElementById(id);
const at = (path) => `setup/${path}${location.search}`;
const post = (path, body = "") => fetch(at(path), { method: "POST", body }).catch(() => {});
const make = (name, properties) => Object.assign(document.createElement(name), properties);
let asked = null;

function ask({ question, choices, numbers, asked: number }) {
  if (asked === `${number} ${question}`) return;
  asked = `${number} ${question}`;
  $("question").textContent = question;
  const answer = (text) => { post("answer", `${number} ${text}`); $("answers").replaceChildren(); };
  const words = !question ? [] : choices.length ? choices : ["enter"];
  const field = numbers && question ? [make("input", { id: "number", inputMode: "decimal", autocomplete: "off" })] : [];
  $("answers").replaceChildren(...field, ...words.map((word) => make("button", {
    type: choices.length ? "button" : "submit", textContent: word.charAt(0).toUpperCase() + word.slice(1),
    onclick: choices.length ? () => answer(word) : null,
  })));
  $("answers").onsubmit = (event) => { event.preventDefault(); answer(field[0]?.value ?? ""); };
  field[0]?.focus();
}

function show(now) {
  ask(now);
  $("bars").replaceChildren(...now.bars.flatMap(([name, share, value]) => [
    make("p", { textContent: `${name}: ${value}` }), make("progress", { value: share }),
  ]));
  $("said").replaceChildren(...now.said.slice(-30).map((text) => make("p", { textContent: text })));
  $("doing").hidden = !now.doing;
  if (now.doing) Object.assign($("doing"), { max: now.doing[2], value: now.doing[1], title: now.doing[0] });
}

async function look() {
  try {
    const found = await fetch(at("shown"));
    if (found.status === 404) return location.reload(); // the arm is there
    if (found.ok) show(await found.json());
    $("role").textContent = found.ok ? "" : "refused: open the address that pneumarm has printed";
  } catch {
    $("role").textContent = "not connected: the arm is vented";
  }
  setTimeout(look, TURN);
}

$("stop").onclick = () => post("stop");
look();
