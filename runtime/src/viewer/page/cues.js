// A card for everybody and one for each follower: how it is, and its cue buttons.

const CANONS = [0, 1, 2, 4];
const WORDS = {
  waiting: "ready", starting: "getting ready", listening: "waiting for the leader", prelude: "moving to the first pose",
  dancing: "dancing", finale: "coming to rest", over: "finished",
};

export function makeCues(section, scene, ask, moment) {
  const cards = new Map();
  const cue = (follower, change) => ask({ cue: { follower, ...change, ...moment() } });
  const everybody = makeCard("all", "everybody", scene, cue);
  section.append(everybody.element);
  return {
    show(frame) {
      everybody.show(together(frame.robots));
      const there = new Set(frame.robots.map((robot) => robot.id));
      for (const [id, card] of cards) {
        if (there.has(id)) continue;
        card.element.remove();
        cards.delete(id);
      }
      for (const robot of frame.robots) {
        if (!cards.has(robot.id)) {
          const card = makeCard(robot.name, robot.name, scene, cue);
          cards.set(robot.id, card);
          section.append(card.element);
        }
        cards.get(robot.id).show({ ...robot, canon: robot.canon ?? 0 });
      }
    },
  };
}

// What all robots have in common.
function together(robots) {
  const same = (key, usual) => {
    const values = new Set(robots.map((robot) => robot[key] ?? usual));
    return values.size === 1 ? [...values][0] : undefined;
  };
  return { mirror: same("mirror", false), canon: same("canon", 0), amplitude: same("amplitude", 1), style: same("style", "") };
}

function element(kind, parts = {}, ...children) {
  const made = Object.assign(document.createElement(kind), parts);
  made.append(...children);
  return made;
}

function makeCard(follower, title, scene, cue) {
  const card = element("article", { className: "card" });
  card.dataset.follower = follower;
  const state = element("p", { className: "state" });
  card.append(element("h2", { textContent: title }), state);
  const press = (text, change, label) => {
    const button = element("button", { type: "button", textContent: text });
    button.setAttribute("aria-label", `${title}: ${label}`);
    button.onclick = () => cue(follower, change());
    return button;
  };
  let mirrored = false;
  const mirror = press("mirror", () => ({ mirror: !mirrored }), "mirror");
  const canons = CANONS.map((beats) => {
    const label = beats === 0 ? "on the beat" : `${beats} ${beats === 1 ? "beat" : "beats"} later`;
    const button = press(beats === 0 ? "together" : `+${beats}`, () => ({ canon: beats }), label);
    button.title = label;
    return [beats, button];
  });
  const amplitude = element("input", { type: "range", min: 0, max: 100, value: 100 });
  amplitude.setAttribute("aria-label", `${title}: amplitude`);
  amplitude.onchange = () => cue(follower, { amplitude: amplitude.value / 100 });
  const style = element("select", {}, new Option("its style", ""), ...scene.styles.map((name) => new Option(name, name)));
  style.setAttribute("aria-label", `${title}: style`);
  style.onchange = () => style.value && cue(follower, { style: style.value });
  const controls = element("div", { className: "row" }, mirror, ...canons.map(([, button]) => button), element("small", { textContent: "beats later" }), style);
  const size = element("label", { className: "row size" }, "amplitude", amplitude);
  if (scene.operator) card.append(controls, size);

  function show(robot) {
    mirrored = robot.mirror ?? false;
    mirror.setAttribute("aria-pressed", mirrored);
    for (const [beats, button] of canons) button.setAttribute("aria-pressed", robot.canon === beats);
    if (!amplitude.matches(":active, :focus")) amplitude.value = 100 * (robot.amplitude ?? 1);
    if (document.activeElement !== style) style.value = robot.style ?? "";
    if (!robot.name) return; // everybody
    const words = robot.stopped ? "emergency stop" : (WORDS[robot.activity] ?? "no picture yet");
    const late = robot.late_ms === undefined ? "" : `, ${robot.late_ms.toFixed(1)} ms late`;
    const way = `, news take ${robot.way_ms.toFixed(0)} ms`;
    const text = `${words}${late}${way}${robot.lost ? `, ${robot.lost} lost` : ""}`;
    if (state.textContent !== text) state.textContent = text;
    card.classList.toggle("bad", Boolean(robot.stopped || robot.violations));
  }
  return { element: card, show };
}
