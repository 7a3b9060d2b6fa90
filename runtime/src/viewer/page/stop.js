// STOP: sent again and again, on the socket and over HTTP, until the robot says that its torque
// is off (on the page of a stage: every robot). What the button reads is what is known, never
// what is hoped for.

const AGAIN_MS = 250;
// Longer than any robot needs to turn torque off and verify it.
const DOUBT_MS = 1000;

const TEXTS = {
  ready: ["STOP", "torque off now · Esc or Space"],
  stopping: ["STOPPING", "waiting for the robot"],
  doubt: ["NOT CONFIRMED", "use the power switch"],
  stopped: ["STOPPED", "torque is off"],
};

export function makeStop(button, { send, post }) {
  // The press that waits to be confirmed: its name, and when it was.
  let press = null;
  let posting = false;
  let state = "";
  // Robots of a stage that have not confirmed.
  let waiting = [];

  const read = (next, robots = []) => {
    const [word, what] = TEXTS[next];
    const told = robots.length === 0 ? what : `${what}: ${robots.join(", ")}`;
    if (next + told === state) return;
    state = next + told;
    const small = document.createElement("small");
    small.textContent = told;
    button.replaceChildren(word, small);
    button.className = next;
  };
  read("ready");

  const confirmed = () => {
    // Told on both ways, so that the program need not wait for this page.
    const seen = { do: "seen", press: press.name };
    send(seen);
    post(seen).catch(() => {});
    press = null;
    read("stopped");
  };
  const postOnce = async (asked) => {
    if (posting) return;
    posting = true;
    try {
      const answer = await post({ do: "estop", press: asked.name });
      if (answer.stopped && press === asked) confirmed();
    } catch {
      // Nobody answered: once more.
    }
    posting = false;
  };
  const repeat = () => {
    if (!press) return;
    send({ do: "estop", press: press.name });
    postOnce(press);
    read(performance.now() - press.at > DOUBT_MS ? "doubt" : "stopping", waiting);
    setTimeout(repeat, AGAIN_MS);
  };

  return {
    press() {
      if (press) return;
      press = { name: crypto.getRandomValues(new Uint32Array(3)).join("-"), at: performance.now() };
      repeat();
    },
    show(frame) {
      waiting = frame.unconfirmed ?? [];
      if (press && [frame.confirmed].flat().includes(press.name)) confirmed();
      else if (!press) read(frame.stopped ? "stopped" : frame.estop ? "stopping" : "ready");
    },
  };
}

// Escape and the space bar; that presses the button that has the focus, and no other.
export function stopByKeys(stop) {
  addEventListener("keydown", (event) => {
    const taken = event.target.matches("button, input, select, summary, a");
    if (event.repeat || (event.key !== "Escape" && (event.key !== " " || taken))) return;
    event.preventDefault();
    stop.press();
  });
}
