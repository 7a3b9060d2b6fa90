// Sound of the room in blocks of mono samples, without what telephones do to it.

export async function openMicrophone(onBlock) {
  const wanted = { echoCancellation: false, noiseSuppression: false, autoGainControl: false };
  if (!navigator.mediaDevices) throw new Error("this page may hear nothing: it must come over https or from localhost");
  let stream;
  try {
    stream = await navigator.mediaDevices.getUserMedia({ audio: wanted });
  } catch (error) {
    const why = error.name === "NotAllowedError" ? "the browser does not allow it" : "there is none";
    throw new Error(`no microphone: ${why}`);
  }
  const context = new AudioContext();
  await context.audioWorklet.addModule(new URL("capture.js", import.meta.url));
  const capture = new AudioWorkletNode(context, "capture", { numberOfOutputs: 0, channelCount: 1, channelCountMode: "explicit" });
  capture.port.onmessage = ({ data }) => onBlock(data);
  new MediaStreamAudioSourceNode(context, { mediaStream: stream }).connect(capture);
  await context.resume();
  return {
    rate_hz: context.sampleRate,
    close() {
      capture.port.onmessage = null;
      stream.getTracks().forEach((track) => track.stop());
      context.close();
    },
  };
}
