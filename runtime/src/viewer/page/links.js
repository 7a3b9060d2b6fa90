// The two links of the page as QR codes: one to steer with, one only to watch.

const MODULE = 4;
const TEXTS = { audience: "only watch", operator: "steer and watch" };

export async function showLinks(section) {
  const answer = await fetch("api/links");
  if (!answer.ok) return;
  const links = await answer.json();
  for (const [name, text] of Object.entries(TEXTS)) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const link = document.createElement("a");
    link.href = links[name].address;
    link.textContent = text;
    caption.append(link);
    figure.append(draw(links[name].code, text), caption);
    section.querySelector(".row").append(figure);
  }
  // What only this machine can reach, a phone cannot.
  const local = ["127.0.0.1", "[::1]"].includes(new URL(links.audience.address).hostname);
  if (local) {
    const hint = document.createElement("small");
    hint.textContent = "This page is open to this machine alone; --view-bind 0.0.0.0:8080 lets phones in.";
    section.append(hint);
  }
  section.hidden = false;
}

function draw(rows, text) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = rows.length * MODULE;
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-label", `QR code of the link to ${text}`);
  const pen = canvas.getContext("2d");
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.fillStyle = "#000";
  rows.forEach((row, y) => [...row].forEach((dark, x) => {
    if (dark === "1") pen.fillRect(x * MODULE, y * MODULE, MODULE, MODULE);
  }));
  return canvas;
}
