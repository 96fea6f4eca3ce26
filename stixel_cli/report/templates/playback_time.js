// Time: play, pause, step, scrub.
let frame = 0, source = 0, playing = false, clock = 0, before = 0;
const scrub = find("scrub");
scrub.max = LAST;

function show(k) {
  frame = Math.min(LAST, Math.max(0, k));
  clock = times[frame];
  scrub.value = frame;
  const text = `k = ${frame}, t = ${times[frame].toFixed(2)} s`;
  scrub.setAttribute("aria-valuetext", text);
  find("now").textContent = text;
  find("first").disabled = find("back").disabled = frame === 0;
  find("last").disabled = find("forward").disabled = frame === LAST;
  drawMap();
  drawCamera();
  charts.forEach(drawCursor);
}

function setPlaying(on) {
  playing = on;
  find("play").setAttribute("aria-label", on ? "Pause" : "Play");
  find("play-icon").setAttribute("d", on ? "M6 4v12M14 4v12" : "M5 3.5v13l11-6.5z");
}

function play() {
  if (frame === LAST) show(0);
  setPlaying(true);
  before = performance.now();
  requestAnimationFrame(advance);
}

function pause() {
  setPlaying(false);
}

function advance(now) {
  if (!playing) return;
  clock += Math.min(0.25, Math.max(0, (now - before) / 1e3)) * Number(find("speed").value);
  before = now;
  const reached = clock;
  let k = frame;
  while (k < LAST && times[k + 1] <= reached) k += 1;
  if (k !== frame) {
    show(k);
    clock = reached;
  }
  if (frame === LAST) pause();
  else requestAnimationFrame(advance);
}

function go(k) {
  pause();
  show(k);
}

find("play").addEventListener("click", () => playing ? pause() : play());
find("first").addEventListener("click", () => go(0));
find("back").addEventListener("click", () => go(frame - 1));
find("forward").addEventListener("click", () => go(frame + 1));
find("last").addEventListener("click", () => go(LAST));
scrub.addEventListener("input", () => go(Number(scrub.value)));
document.addEventListener("keydown", (event) => {
  const { target, key } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || target.tagName === "SELECT") return;
  if (key === " " && (target.tagName === "BUTTON" || target.type === "checkbox")) return;
  const step = event.shiftKey ? 10 : 1;
  const actions = {
    " ": () => playing ? pause() : play(),
    ArrowLeft: () => go(frame - step),
    ArrowRight: () => go(frame + step),
    Home: () => go(0),
    End: () => go(LAST),
  };
  if (!actions[key]) return;
  event.preventDefault();
  actions[key]();
});

// Remove the focus from a clicked button, so that Space plays. A button reached by keyboard keeps it.
document.addEventListener("click", (event) => {
  const control = event.target.closest("button, [type=checkbox]");
  if (event.detail && control) control.blur();
});

describe();
describeOrigin();
show(0);
