(() => {
  const table = document.getElementById("levels");
  const form = document.getElementById("filter");
  const count = document.getElementById("count");
  const levels = [...table.tBodies];
  const texts = new Map();
  const text = (level) => {
    if (!texts.has(level)) texts.set(level, level.textContent.toLowerCase());
    return texts.get(level);
  };
  const filter = () => {
    const words = form.elements.words.value.trim().toLowerCase();
    const kind = form.elements.kind.value;
    let shown = 0;
    for (const level of levels) {
      const isOfKind = kind === "" || level.dataset.k.split(" ").includes(kind);
      level.hidden = !(isOfKind && (words === "" || text(level).includes(words)));
      if (!level.hidden) shown += 1;
    }
    count.textContent = `${shown} of ${levels.length} levels`;
  };
  const headings = [...table.tHead.rows[0].cells];
  headings.forEach((heading, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...heading.childNodes);
    heading.append(button);
    button.addEventListener("click", () => {
      const sign = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      headings.forEach((other) => other.removeAttribute("aria-sort"));
      heading.setAttribute("aria-sort", sign === 1 ? "ascending" : "descending");
      const value = (level) => Number(level.rows[0].cells[column].dataset.v);
      levels.sort((one, other) => sign * (value(one) - value(other)));
      table.append(...levels);
    });
  });
  form.addEventListener("input", filter);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.hidden = false;
  const maps = document.getElementById("maps");
  if (maps) {
    const show = () => { document.body.dataset.map = maps.elements.map.value; };
    maps.addEventListener("change", show);
    maps.hidden = false;
    show();
  }
  // A clip plays once, after a click. Another click ends it. Details are shown in other places, too, so the page listens.
  let plays = 0;
  for (const button of table.querySelectorAll("button.clip")) button.hidden = false;
  document.addEventListener("click", (event) => {
    const button = event.target.closest("button.clip");
    if (!button) return;
    const shown = button.nextElementSibling;
    if (shown?.tagName === "IMG") {
      shown.remove();
      button.textContent = "Play the failure";
      return;
    }
    const clip = document.createElement("img");
    clip.alt = "The plan of the level, with a dot that follows the path of the failure";
    // A new address each time: a played clip would stay at its end.
    plays += 1;
    const source = button.dataset.clip;
    clip.src = source.startsWith("data:") ? `${source}#${plays}` : `${source}?${plays}`;
    button.after(clip);
    button.textContent = "Stop";
  });
  // A scene goes on or back by a tick, or plays until it is stopped. All of its ticks are parts of one picture.
  for (const scene of document.querySelectorAll(".scene[data-film]")) {
    const [pictures, columns, first, pause] =
      ["pictures", "columns", "first", "pause"].map((name) => Number(scene.dataset[name]));
    const steps = scene.querySelector(".steps");
    const [back, play, on] = steps.querySelectorAll("button");
    const tick = steps.querySelector("output");
    let film = null;
    let shown = Number(scene.dataset.shown);
    let timer = 0;
    const show = (number) => {
      if (!film) {
        const frame = document.createElement("div");
        frame.className = "film";
        frame.style.aspectRatio = scene.dataset.ratio;
        film = document.createElement("img");
        film.src = scene.dataset.film;
        film.style.width = `${100 * columns}%`;
        frame.append(film);
        scene.querySelector("img").replaceWith(frame);
      }
      shown = Math.min(Math.max(number, 0), pictures - 1);
      film.style.left = `${-100 * (shown % columns)}%`;
      film.style.top = `${-100 * Math.floor(shown / columns)}%`;
      film.alt = `The game in tick ${first + shown}`;
      tick.textContent = `tick ${first + shown}`;
    };
    const stop = () => {
      clearInterval(timer);
      timer = 0;
      play.textContent = "Play";
      tick.removeAttribute("aria-live");
    };
    const step = (ticks) => {
      stop();
      show(shown + ticks);
    };
    back.addEventListener("click", () => step(-1));
    on.addEventListener("click", () => step(1));
    steps.addEventListener("keydown", (event) => {
      const ticks = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (!ticks) return;
      event.preventDefault();
      step(ticks);
    });
    play.addEventListener("click", () => {
      if (timer) {
        stop();
        return;
      }
      // A screen reader would read out every tick.
      tick.setAttribute("aria-live", "off");
      play.textContent = "Stop";
      show(!film || shown === pictures - 1 ? 0 : shown);
      timer = setInterval(() => show((shown + 1) % pictures), pause);
    });
    steps.hidden = false;
  }
  filter();
})();
