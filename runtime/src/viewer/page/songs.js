// Songs for the next dances: dropped anywhere on the page, or chosen; or what this browser hears.

import { openMicrophone } from "./microphone.js";

export function makeSongs(panel, scene) {
  const [button, listen, input, told] = panel.querySelectorAll("button, input, output");
  if (!scene.operator || !scene.takes_songs) return { show() {} };
  panel.hidden = false;
  let refused = "";

  const add = async (files) => {
    refused = "";
    for (const file of files) {
      const options = { method: "POST", body: file };
      try {
        const answer = await fetch(`api/song/${encodeURIComponent(file.name)}`, options);
        const { error } = await answer.json();
        if (error) refused = error;
      } catch {
        refused = `${file.name}: the program cannot be reached, or the file is too large`;
      }
    }
  };
  button.onclick = () => input.click();
  input.onchange = () => add(input.files).then(() => (input.value = ""));
  let microphone = null;
  const close = () => {
    microphone?.close();
    microphone = null;
    listen.textContent = "use this microphone";
    listen.setAttribute("aria-pressed", "false");
  };
  // Browsers let a page listen where nobody can have changed it on its way.
  listen.hidden = !navigator.mediaDevices;
  listen.onclick = async () => {
    refused = "";
    if (microphone) return close();
    try {
      microphone = await openMicrophone(close);
      listen.textContent = "close the microphone";
      listen.setAttribute("aria-pressed", "true");
    } catch (error) {
      refused = error.message;
    }
  };
  const over = (event, is) => {
    event.preventDefault();
    document.body.classList.toggle("dropping", is);
  };
  addEventListener("dragover", (event) => over(event, true));
  addEventListener("dragleave", (event) => over(event, false));
  addEventListener("drop", (event) => {
    over(event, false);
    add(event.dataTransfer.files);
  });

  return {
    show({ queue }) {
      const text = refused || (queue.length ? `next: ${queue.join(", ")}` : "");
      if (told.textContent !== text) told.textContent = text;
    },
  };
}
