// The song from left to right: sections, bars, beats, cues, and where it is now. A press
// chooses the moment of the next cue.

const COLOURS = ["#3d6fa8", "#8a5a9c", "#4b8b6a", "#a8703d", "#7f7f3a", "#9c4a5f"];

export function makeTimeline(canvas, note, list, scene, ask) {
  let outline = { length_s: 0, beats_s: [], bars_s: [], sections: [] };
  let number = 0;
  let chosen_s = null;
  let frame = null;
  let listed = "";

  const span = () => Math.max(outline.length_s, ...(frame?.cues ?? []).map(([at_s]) => at_s + 1), (frame?.music_s ?? 0) + 1, 1);
  const clock = (seconds) => `${Math.floor(seconds / 60)}:${(seconds % 60).toFixed(1).padStart(4, "0")}`;
  // The beat next to a moment, if it is near.
  const onBeat = (at_s) => {
    const near = outline.beats_s.reduce((best, beat) => (Math.abs(beat - at_s) < Math.abs(best - at_s) ? beat : best), Infinity);
    return Math.abs(near - at_s) < 0.5 ? near : at_s;
  };
  const choose = (at_s) => {
    chosen_s = at_s;
    note.textContent = at_s === null ? "Cues are given at once." : `The next cue comes at ${clock(at_s)}. Escape: at once.`;
    draw();
  };

  function draw() {
    const ratio = Math.min(devicePixelRatio, 2);
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    const x = (at_s) => (at_s / span()) * width;
    const { sections } = outline;
    pen.font = "600 13px system-ui, sans-serif";
    sections.forEach(([at_s, name], place) => {
      const end = sections[place + 1]?.[0] ?? outline.length_s;
      pen.fillStyle = COLOURS[(name.charCodeAt(0) - 65) % COLOURS.length] ?? COLOURS[0];
      pen.fillRect(x(at_s), 0, Math.max(x(end) - x(at_s) - 1, 1), 20);
      pen.fillStyle = "#fff";
      pen.fillText(name, x(at_s) + 5, 15);
    });
    const marks = (times, from, to, colour) => {
      if (times.length > width / 3) return; // too close to be told apart
      pen.fillStyle = colour;
      for (const at_s of times) pen.fillRect(x(at_s), from, 1, to - from);
    };
    marks(outline.beats_s, 34, 42, "#667085");
    marks(outline.bars_s, 24, 42, "#98a1b0");
    pen.fillStyle = "#ffcc4d";
    for (const [at_s] of frame?.cues ?? []) {
      pen.beginPath();
      pen.moveTo(x(at_s), 44);
      pen.lineTo(x(at_s) + 6, 56);
      pen.lineTo(x(at_s) - 6, 56);
      pen.fill();
    }
    if (chosen_s !== null) {
      pen.fillStyle = "#53d18b";
      pen.fillRect(x(chosen_s) - 1, 0, 2, height);
    }
    if (frame && frame.music_s !== null && frame.music_s >= 0) {
      pen.fillStyle = "#ff5a5f";
      pen.fillRect(x(frame.music_s) - 1, 0, 3, height);
    }
  }

  function showList(cues) {
    const text = JSON.stringify(cues);
    if (text === listed) return;
    listed = text;
    list.replaceChildren(...cues.map(([at_s, words], place) => {
      const line = document.createElement("li");
      const when = document.createElement("time");
      when.textContent = clock(at_s);
      line.append(when, words);
      if (scene.operator) {
        const button = Object.assign(document.createElement("button"), { type: "button", textContent: "remove" });
        button.setAttribute("aria-label", `remove ${words}`);
        button.onclick = () => ask({ remove: place });
        line.append(button);
      }
      return line;
    }));
  }

  if (scene.operator) {
    canvas.onclick = (event) => choose(onBeat((event.offsetX / canvas.clientWidth) * span()));
    addEventListener("keydown", (event) => event.key === "Escape" && choose(null));
  }
  choose(null);
  return {
    moment() {
      const at = chosen_s === null ? {} : { at_s: chosen_s };
      if (chosen_s !== null) choose(null);
      return at;
    },
    async show(next) {
      frame = next;
      draw();
      showList(frame.cues);
      if (frame.outline === number) return;
      number = frame.outline;
      const answer = await fetch("api/part/outline");
      if (answer.ok) outline = await answer.json();
    },
  };
}
