// STOP: sent again and again, on the socket and over HTTP, until the robot says that its torque
// is off. What the button reads is what is known, never what is hoped for.

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

  const read = (next) => {
    if (next === state) return;
    state = next;
    const [word, what] = TEXTS[next];
    const small = document.createElement("small");
    small.textContent = what;
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
    read(performance.now() - press.at > DOUBT_MS ? "doubt" : "stopping");
    setTimeout(repeat, AGAIN_MS);
  };

  return {
    press() {
      if (press) return;
      press = { name: crypto.getRandomValues(new Uint32Array(3)).join("-"), at: performance.now() };
      repeat();
    },
    show(frame) {
      if (press && frame.confirmed.includes(press.name)) confirmed();
      else if (!press) read(frame.stopped ? "stopped" : frame.estop ? "stopping" : "ready");
    },
  };
}
