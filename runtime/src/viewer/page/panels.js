// Everything that is not 3-D: music, health, joints, events.

const LOCKS = { lost: "no beat", locked: "", holding: "counting on", changing: "moving to another beat" };
const byId = (id) => document.getElementById(id);
const DEG = 180 / Math.PI;
const ACTIVITIES = {
  waiting: "ready to start",
  starting: "getting ready",
  listening: "waiting for music",
  prelude: "moving to the first pose",
  dancing: "dancing",
  finale: "coming to rest",
  playing: "recording",
  over: "finished",
};
const SAFETY = {
  disarmed: "torque off",
  arming: "turning torque on",
  running: "running",
  holding: "holding",
  stopping: "turning torque off",
  fault: "something is wrong",
};
const TRACK_S = 6;
// A reason stays long enough to be read.
const REASON_S = 0.8;
const REASONS = {
  limit: "end of range", speed: "top speed", balance: "balance", collision: "collision",
  torque: "torque", heat: "heat", supply: "low voltage",
};
const WARM_C = 55;
const HOT_C = 65;

export function makePanels(scene) {
  const joints = scene.joints.map(makeJoint);
  byId("tracks").append(...joints.map((joint) => joint.row));
  const figures = makeFigures();
  let log = "";

  // What is heard, and how the robot is now.
  function show(frame, newest) {
    const held = newest.activity === "waiting" && newest.estop;
    badge("activity", held ? "release the stop to start" : ACTIVITIES[newest.activity], newest.activity === "dancing" ? "good" : "warn");
    const safety = newest.estop ? "emergency stop" : newest.hold ? "holding" : SAFETY[newest.safety];
    const quality = { running: "good", "something is wrong": "bad", "emergency stop": "bad" };
    badge("safety", safety, quality[safety] ?? "warn");
    byId("safety").hidden = scene.recording_s !== null;
    showMusic(frame);
    figures(newest, scene);
    joints.forEach((joint, index) => joint.show(frame, index));
    const events = JSON.stringify(newest.events);
    if (events !== log) showEvents(newest.events);
    log = events;
  }
  return { show };
}

function badge(id, text, quality) {
  const element = byId(id);
  if (element.textContent !== text) element.textContent = text;
  element.className = `badge ${quality}`;
}

function showMusic({ beat, bands }) {
  const heard = beat.lock !== "lost" && beat.tempo_bpm > 0;
  byId("tempo").textContent = heard ? beat.tempo_bpm.toFixed(0) : "–";
  byId("lock").textContent = LOCKS[beat.lock];
  byId("bar").textContent = heard && beat.place !== null ? `beat ${beat.place} of ${beat.meter}` : "";
  byId("presence").textContent = beat.presence > 0.45 ? "music" : "no music";
  byId("phase").value = heard ? beat.phase : 0;
  const glow = heard ? Math.exp(-5 * beat.phase) * beat.confidence : 0;
  byId("lamp").style.background = `rgb(${42 + 213 * glow}, ${48 + 150 * glow}, ${58 + 20 * glow})`;
  const canvas = byId("spectrum");
  const { width, height } = canvas;
  const pen = canvas.getContext("2d");
  pen.clearRect(0, 0, width, height);
  const step = width / bands.length;
  bands.forEach((level, band) => {
    pen.fillStyle = `hsl(${205 - 170 * level} 80% ${35 + 25 * level}%)`;
    pen.fillRect(band * step + 1, height * (1 - level), step - 2, height * level);
  });
}

// The servo with which most answers went wrong.
function mostLost(frame, scene) {
  const counts = frame.servo_errors.map(([lost, damaged]) => lost + damaged);
  const most = Math.max(0, ...counts);
  return most === 0 ? "–" : `${scene.joints[counts.indexOf(most)].name}, ${most}`;
}

// Simulated servos count; real ones do not, and before torque nobody has.
function brokenLimits(frame, scene) {
  if (frame.violations !== null) return `${frame.violations}`;
  return scene.recording_s !== null || frame.safety === "disarmed" ? "–" : "real servos: unknown";
}

// Name, how to tell it, and when it is worth a colour.
function makeFigures() {
  const rows = [
    ["robot rate", (f, s) => `${f.bus.rate_hz.toFixed(1)} / ${s.control_hz} Hz`, (f, s) => f.bus.rate_hz < 0.95 * s.control_hz],
    ["commands apart", (f) => `${f.bus.gap_p50_ms.toFixed(1)} ms`, () => false],
    ["99th percentile", (f) => `${f.bus.gap_p99_ms.toFixed(1)} ms`, (f, s) => f.bus.gap_p99_ms > 1500 / s.control_hz],
    ["worst", (f) => `${f.bus.gap_max_ms.toFixed(1)} ms`, (f, s) => f.bus.gap_max_ms > 2000 / s.control_hz],
    ["link's delay", (f) => `${f.bus.delay_ms.toFixed(1)} ms`, (f, s) => f.bus.delay_ms > 500 / s.control_hz],
    ["late moves", (f) => `${f.late_frames}`, (f) => f.late_frames > 0],
    ["answers late or lost", (f) => `${f.bus.timeouts}`, (f) => f.bus.timeouts > 0],
    ["answers damaged", (f) => `${f.bus.crc_errors}`, (f) => f.bus.crc_errors > 0],
    ["asked again", (f) => `${f.bus.retries}`, (f) => f.bus.retries > 0],
    ["most with", mostLost, (f) => f.servo_errors.some(([lost, damaged]) => lost + damaged > 0)],
    ["limited moves", (f) => `${f.interventions}`, () => false],
    ["limits broken", brokenLimits, (f) => f.violations > 0],
    ["idling", (f) => `${Math.round(f.idle_share * 100)} %`, () => false],
    ["music", (f) => `${f.music_s.toFixed(1)} s`, () => false],
    ["pages open", (f) => `${f.viewers}`, () => false],
    ["torque on for", (f) => `${f.robot_s.toFixed(0)} s`, () => false],
  ];
  const values = rows.map(([name]) => {
    const term = document.createElement("dt");
    const value = document.createElement("dd");
    term.textContent = name;
    byId("figures").append(term, value);
    return value;
  });
  return (frame, scene) => {
    rows.forEach(([, tell, bad], index) => {
      values[index].textContent = tell(frame, scene);
      values[index].className = bad(frame, scene) ? "warn" : "";
    });
  };
}

// One joint: its last seconds between its limits, degrees, temperature.
function makeJoint({ name, lower_rad, upper_rad }) {
  const row = document.createElement("div");
  row.className = "joint";
  const [label, canvas, degrees, heat, why] = ["b", "canvas", "span", "span", "i"].map((kind) =>
    document.createElement(kind),
  );
  label.textContent = name;
  const limits = `${name}: ${(lower_rad * DEG).toFixed(0)} to ${(upper_rad * DEG).toFixed(0)} degrees`;
  label.title = limits;
  let counted = "";
  canvas.width = 240;
  canvas.height = 26;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `${limits}, its last seconds`);
  row.append(label, canvas, degrees, heat, why);
  let told = -Infinity;
  const past = [];
  const height = (rad) => {
    const share = (rad - lower_rad) / (upper_rad - lower_rad);
    return canvas.height - 2 - (canvas.height - 4) * Math.min(Math.max(share, 0), 1);
  };
  const line = (pen, value, colour) => {
    pen.strokeStyle = colour;
    pen.beginPath();
    const now = past.at(-1).time;
    for (const sample of past) pen.lineTo((1 - (now - sample.time) / TRACK_S) * canvas.width, height(sample[value]));
    pen.stroke();
  };
  const show = (frame, index) => {
    const time = frame.music_s;
    if (past.length > 0 && Math.abs(time - past.at(-1).time) > TRACK_S) past.length = 0;
    past.push({ time, position: frame.positions_rad[index], target: frame.targets_rad[index] });
    while (past[0].time < time - TRACK_S || past[0].time > time) past.shift();
    const pen = canvas.getContext("2d");
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.lineWidth = 1;
    pen.strokeStyle = "#6b2f33";
    pen.strokeRect(0.5, 1.5, canvas.width - 1, canvas.height - 3);
    line(pen, "target", "#6a7586");
    pen.lineWidth = 1.6;
    line(pen, "position", "#5ab0ff");
    degrees.textContent = `${(frame.positions_rad[index] * DEG).toFixed(1)}°`;
    const errors = frame.servo_errors[index];
    if (`${errors}` !== counted) {
      counted = `${errors}`;
      const [lost, damaged, again] = errors;
      label.className = lost + damaged > 0 ? "warm" : "";
      label.title = `${limits}; answers late or lost ${lost}, damaged ${damaged}, asked again ${again}`;
    }
    const celsius = frame.temperatures_c[index];
    heat.textContent = celsius === null ? "–" : `${celsius.toFixed(0)}°`;
    const reason = frame.held_back[index];
    if (reason) {
      told = time;
      why.textContent = REASONS[reason];
    } else if (Math.abs(time - told) > REASON_S && why.textContent) why.textContent = "";
    heat.className = celsius >= HOT_C ? "hot" : celsius >= WARM_C ? "warm" : "";
  };
  return { row, show };
}

function showEvents(events) {
  const lines = events.toReversed().map(({ time_s, state, cause }) => {
    const line = document.createElement("li");
    const when = document.createElement("time");
    when.textContent = time_s === null ? "" : `${time_s.toFixed(2)} s`;
    line.append(when, `${state}: ${cause}`);
    return line;
  });
  byId("log").replaceChildren(...lines);
}
