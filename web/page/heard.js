// Beat and bar as they are heard.

const LOCKS = { lost: "no beat", locked: "", holding: "counting on", changing: "moving to another beat" };
const byId = (id) => document.getElementById(id);

export function showMusic({ phase, tempo_bpm, confidence, lock, presence, place, meter }) {
  const heard = lock !== "lost" && tempo_bpm > 0;
  byId("tempo").textContent = heard ? tempo_bpm.toFixed(0) : "–";
  byId("lock").textContent = LOCKS[lock];
  byId("bar").textContent = heard && place > 0 ? `beat ${place} of ${meter}` : "";
  byId("presence").textContent = presence > 0.45 ? "music" : "no music";
  byId("phase").value = heard ? phase : 0;
  const glow = heard ? Math.exp(-5 * phase) * confidence : 0;
  byId("lamp").style.background = `rgb(${42 + 213 * glow}, ${48 + 150 * glow}, ${58 + 20 * glow})`;
}
