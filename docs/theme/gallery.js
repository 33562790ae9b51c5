// Plays the films of the gallery that are in view, unless the reader's system is set to reduce motion.
const films = [...document.querySelectorAll("video.film")];
const button = document.querySelector("#films");
const inView = new Set();
const held = new Set(); // films that the reader has paused
let arePlaying = !window.matchMedia("(prefers-reduced-motion: reduce)").matches;

function start(film) {
  if (arePlaying && inView.has(film) && !held.has(film)) film.play().catch(() => {}); // a browser can refuse to play
}

function tell() {
  button.textContent = arePlaying ? "Pause all films" : "Play films in view";
}

const observer = new IntersectionObserver((seen) => {
  for (const { target, isIntersecting } of seen) {
    inView[isIntersecting ? "add" : "delete"](target);
    if (isIntersecting) start(target);
    else target.pause();
  }
}, { threshold: 0.3 });

/** Add a button at the corner of an entry, because a browser's own controls would cover the still. */
function addButton(film) {
  const its = Object.assign(document.createElement("button"), { type: "button" });
  const name = () => {
    its.textContent = film.paused ? "Play" : "Pause";
    its.setAttribute("aria-label", `${its.textContent}: ${film.getAttribute("aria-label")}`);
  };
  its.addEventListener("click", () => (film.paused ? film.play() : film.pause()));
  for (const event of ["play", "pause"]) film.addEventListener(event, name);
  name();
  film.controls = false;
  film.after(its);
}

for (const film of films) {
  addButton(film);
  film.addEventListener("pause", () => arePlaying && inView.has(film) && held.add(film));
  film.addEventListener("play", () => held.delete(film));
  observer.observe(film);
}
if (button) {
  button.hidden = false;
  tell();
  button.addEventListener("click", () => {
    arePlaying = !arePlaying;
    held.clear();
    films.forEach(arePlaying ? start : (film) => film.pause());
    tell();
  });
}
