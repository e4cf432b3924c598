(() => {
  const source = document.getElementById("gallery-data");
  if (!source) return;
  const { levels, plans } = JSON.parse(source.textContent);
  const box = document.getElementById("gallery");
  const chosen = document.getElementById("chosen");
  document.getElementById("gallery-section").hidden = false;
  // Sizes of a tile in pixels, rows that are drawn before they come into view, and tiles on paper.
  const [width, height, gap, ahead, most] = [168, 132, 10, 2, 300];
  // Most letters of a name below a tile.
  const longest = 24;
  const outcomes = ["proved-unsolvable", "bot-failed", "solved"];
  const signs = ["✗", "?", "✓"];
  const words = ["proved unsolvable", "unsolved, nothing proved", "solved"];
  const inner = document.createElement("div");
  box.append(inner);
  const tiles = new Map();
  let columns = 1;
  // The levels in view of the search, by their place in the data, and the place of the chosen one among them.
  let listed = levels.map((_, place) => place);
  let current = -1;

  const draw = (canvas, plan) => {
    const rows = plan.split("/").map((row) => row.replace(/(\d+)(\D)/g, (_, count, letter) => letter.repeat(Number(count))));
    const wide = Math.max(...rows.map((row) => row.length));
    // Pixels of the screen, so that edges are sharp.
    const dense = Math.ceil(window.devicePixelRatio || 1);
    const side = Math.max(1, Math.floor(dense * Math.min((width - 14) / wide, (height - 46) / rows.length)));
    canvas.width = side * wide;
    canvas.height = side * rows.length;
    canvas.style.width = `${canvas.width / dense}px`;
    const context = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const colours = { "#": "--wall", "=": "--platform", "^": "--hazard", S: "--text", G: "--goal" };
    for (const letter of Object.keys(colours)) colours[letter] = style.getPropertyValue(colours[letter]).trim();
    rows.forEach((row, y) => {
      for (let x = 0; x < row.length; x += 1) {
        const colour = colours[row[x]];
        if (!colour) continue;
        context.fillStyle = colour;
        // Start and goal are seen in small pictures, too.
        const more = row[x] === "S" || row[x] === "G" ? Math.max(side, 4 * dense) : side;
        context.fillRect(x * side - (more - side) / 2, y * side - (more - side) / 2, more, more);
      }
    });
  };
  // Names of one folder differ in their begin or in their end, so a long one loses its folders, and then its middle.
  const short = (name) => {
    const file = name.length > longest ? name.slice(name.lastIndexOf("/") + 1) : name;
    if (file.length <= longest) return file;
    const begin = Math.ceil((longest - 1) / 2);
    return `${file.slice(0, begin)}…${file.slice(begin + 1 - longest)}`;
  };
  const tile = (index) => {
    const level = levels[listed[index]];
    const made = document.createElement("div");
    made.id = `tile-${index}`;
    made.className = `tile ${outcomes[level.o]}${level.f > 0 ? " found" : ""}${level.d ? " pinned" : ""}`;
    made.setAttribute("role", "option");
    made.setAttribute("aria-selected", String(index === current));
    const found = level.f > 0 ? `, ${level.f} finding${level.f === 1 ? "" : "s"}` : "";
    const pin = level.d ? `; ${level.d}` : "";
    made.setAttribute("aria-label", `${level.n}: ${words[level.o]}${found}, ${level.w}${pin}`);
    made.title = `${level.n}${pin}`;
    const picture = document.createElement("div");
    picture.className = "plan";
    if (level.p >= 0) {
      const canvas = document.createElement("canvas");
      draw(canvas, plans[level.p]);
      picture.append(canvas);
    }
    const name = document.createElement("span");
    name.textContent = short(level.n);
    const sign = document.createElement("b");
    sign.textContent = `${signs[level.o]}${level.f > 0 ? "!" : ""} `;
    const note = document.createElement("small");
    note.append(sign, `${level.w}${pin}`);
    made.append(picture, name, note);
    made.addEventListener("click", () => choose(index));
    return made;
  };
  const paint = (all = false) => {
    columns = Math.max(1, Math.floor((box.clientWidth - gap) / (width + gap)));
    const wide = Math.floor((box.clientWidth - gap) / columns);
    const rows = Math.ceil(listed.length / columns);
    inner.style.height = `${rows * (height + gap) + gap}px`;
    const first = all ? 0 : Math.max(0, Math.floor(box.scrollTop / (height + gap)) - ahead);
    const last = all ? Math.ceil(most / columns) : Math.ceil((box.scrollTop + box.clientHeight) / (height + gap)) + ahead;
    const wanted = new Set();
    for (let index = first * columns; index < Math.min(last * columns, listed.length); index += 1) wanted.add(index);
    for (const [index, made] of tiles) {
      if (!wanted.has(index)) {
        made.remove();
        tiles.delete(index);
      }
    }
    for (const index of wanted) {
      if (!tiles.has(index)) {
        tiles.set(index, tile(index));
        inner.append(tiles.get(index));
      }
      const made = tiles.get(index);
      made.style.left = `${gap + (index % columns) * wide}px`;
      made.style.width = `${wide - gap}px`;
      made.style.top = `${gap + Math.floor(index / columns) * (height + gap)}px`;
    }
  };
  const move = (index) => {
    tiles.get(current)?.setAttribute("aria-selected", "false");
    current = Math.min(Math.max(index, 0), listed.length - 1);
    const top = Math.floor(current / columns) * (height + gap);
    if (top < box.scrollTop) box.scrollTop = top;
    if (top + height + 2 * gap > box.scrollTop + box.clientHeight) box.scrollTop = top + height + 2 * gap - box.clientHeight;
    paint();
    tiles.get(current)?.setAttribute("aria-selected", "true");
    box.setAttribute("aria-activedescendant", `tile-${current}`);
    if (!chosen.hidden) fill();
  };
  // The details are those of the table.
  const rows = new Map();
  for (const body of document.getElementById("levels")?.tBodies ?? []) rows.set(body.rows[0].cells[0].textContent, body);
  const fill = () => {
    const level = levels[listed[current]];
    if (!level) return;
    const heading = document.createElement("h3");
    heading.textContent = level.n;
    const outcome = document.createElement("p");
    outcome.className = outcomes[level.o];
    outcome.textContent = `${words[level.o]}; ${level.w}${level.d ? `; ${level.d}` : ""}`;
    const card = rows.get(level.n)?.querySelector(".card");
    const none = document.createElement("p");
    none.textContent = "It has no details here: results.json has them.";
    chosen.replaceChildren(heading, outcome, ...(card ? card.cloneNode(true).childNodes : [none]));
  };
  const choose = (index) => {
    move(index);
    chosen.hidden = false;
    fill();
    chosen.scrollIntoView({ block: "nearest" });
  };
  box.addEventListener("keydown", (event) => {
    const page = columns * Math.max(1, Math.floor(box.clientHeight / (height + gap)));
    const steps = { ArrowRight: 1, ArrowLeft: -1, ArrowDown: columns, ArrowUp: -columns, PageDown: page, PageUp: -page };
    if (event.key in steps) move(current < 0 ? 0 : current + steps[event.key]);
    else if (event.key === "Home") move(0);
    else if (event.key === "End") move(listed.length - 1);
    else if (event.key === "Escape") chosen.hidden = true;
    else if ((event.key === "Enter" || event.key === " ") && current >= 0) choose(current);
    else return;
    event.preventDefault();
  });
  const repaint = () => {
    for (const made of tiles.values()) made.remove();
    tiles.clear();
    paint();
  };
  const form = document.getElementById("filter");
  form?.addEventListener("input", () => {
    const find = form.elements.words.value.trim().toLowerCase();
    const kind = form.elements.kind.value;
    const isOfKind = (level) => kind === "" || kind === outcomes[level.o] || (kind === "findings" && level.f > 0);
    const isListed = ({ n, w, d }) => `${n} ${w} ${d ?? ""}`.toLowerCase().includes(find);
    listed = levels.map((_, place) => place).filter((place) => isOfKind(levels[place]) && isListed(levels[place]));
    current = -1;
    chosen.hidden = true;
    repaint();
  });
  box.addEventListener("scroll", () => paint());
  new ResizeObserver(() => paint()).observe(box);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  window.addEventListener("beforeprint", () => paint(true));
  window.addEventListener("afterprint", () => paint());
  paint();
})();
