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
  // A scene moves while its button is on.
  for (const button of document.querySelectorAll("button.moving")) {
    const words = button.textContent;
    const picture = button.previousElementSibling;
    const still = picture.getAttribute("src");
    button.hidden = false;
    button.addEventListener("click", () => {
      const moves = picture.getAttribute("src") !== still;
      picture.src = moves ? still : picture.dataset.moving;
      button.textContent = moves ? words : "Stop";
    });
  }
  filter();
})();
