// What is going on, in words.

const NEAR = 1; // degrees: a goal is arrived at ...
const FAR = 2; // ... and left again
const PATIENCE = 3000; // ms after which an arm that is not there is no longer on its way
const WINDOW = 2000; // ms over which it is seen how fast the arm's time passes
const FAST = 1.5; // times as fast as the clock on the wall

export const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);
export const asDegrees = (angle) => `${(Math.round(10 * angle) / 10 + 0).toFixed(1)}°`.replace("-", "\u2212");

export const lasted = (seconds) => (seconds < 90 ? `${Math.max(seconds, 0).toFixed(0)} s` : `${(seconds / 60).toFixed(0)} min`);

// What the arm does, as far as the frames tell.
export class Movement {
  constructor() {
    this.there = false;
    this.since = 0; // when the goal was last changed [ms]
    this.goal = "";
    this.away = 0;
    this.clocks = []; // of the arm [s] and of the page [ms]
    this.opened = 0; // when the page saw it getting ready [ms]
  }

  see(frame, now) {
    const goal = JSON.stringify(frame.goal);
    if (goal !== this.goal) Object.assign(this, { goal, since: now, there: false });
    this.away = frame.goal ? Math.max(...frame.angle.map((angle, j) => Math.abs(angle - frame.goal[j]))) : 0;
    this.there = this.away <= (this.there ? FAR : NEAR);
    this.late = !this.there && now - this.since > PATIENCE;
    if (this.clocks.length && frame.time < this.clocks.at(-1)[0]) this.clocks = [];
    this.clocks.push([frame.time, now]);
    while (now - this.clocks[0][1] > WINDOW) this.clocks.shift();
  }

  // How many times as fast as on the wall the arm's time passes.
  get pace() {
    const [first, last] = [this.clocks[0], this.clocks.at(-1)];
    return last && last[1] - first[1] > WINDOW / 4 ? 1000 * (last[0] - first[0]) / (last[1] - first[1]) : 1;
  }

  words(state, old) {
    if (state.why) return capital(state.why);
    if (state.mode === "learning") {
      if (old) return "Learning: the arm waits, this is how it was last seen";
      return this.pace > FAST ? `Learning: ${this.pace.toFixed(0)} times as fast as in reality` : "Learning";
    }
    if (state.mode === "opening") {
      this.opened ||= performance.now();
      return `Getting ready: compiling, once on this machine; ${lasted((performance.now() - this.opened) / 1000)} so far`;
    }
    if (old) return "Nothing new is heard of the arm: this is how it was last seen";
    if (state.mode === "moving") {
      return this.there ? "Holding its goal" : this.late ? `Not at its goal: ${this.away.toFixed(0)}° away` : "Moving to its goal";
    }
    return {
      relaxed: "Relaxed: all muscles are vented", following: "Following the curve", holding: "Holding the end of the curve",
      stopped: "Stopped: everything is vented", failed: "Failed",
    }[state.mode] ?? "";
  }
}

// What can be done now.
export function hint(state, writes) {
  if (state.mode === "learning") return "It moves and learns by itself. Stop ends that, and what was recorded is kept.";
  if (state.mode === "failed") return "Look at the arm, then press Try again.";
  if (state.mode === "stopped" || state.mode === "opening") return "";
  if (!writes) return state.writer === null ? "Take control to move the arm." : "You are watching: ask for control to move the arm. Stop works for everybody.";
  if (!state.controller) return state.can_learn ? "Nothing can move it yet: let it learn." : "There is no controller to move it.";
  return "Drag the orange ring, or tap where to go.";
}

// What is being learned, and how far that is.
export function learningNow({ title, share, seconds, compiling, stopping }) {
  if (stopping) return "stopping as soon as it can; what was recorded is kept";
  const parts = [title ? title + (share == null ? "" : ` ${Math.round(100 * share)} %`) : "getting ready for the next step, on a new machine by compiling it"];
  if (compiling && title) parts.push("compiling, once on this machine");
  parts.push(`${seconds} s so far`);
  return capital(parts.join(", "));
}

// A finding `[words, noticed, until]` on the arm's clock, seen at `time` [s].
export function finding([words, noticed, until], time) {
  return `${words} (${until == null ? `noticed ${lasted(time - noticed)} ago` : `over for ${lasted(time - until)}`}).`;
}
