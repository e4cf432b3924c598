(() => {
  const get = (id) => document.getElementById(id);
  // Saves by number, the shown save (null for the newest), and the shown level (null for the one that changed last).
  const saves = new Map();
  let shownSave = null;
  let shownLevel = null;
  const title = document.title;

  // Returns the state of every level after a save: that of the last save which tested it.
  const levelsAfter = (last) => {
    const levels = new Map();
    for (const save of [...saves.values()].sort((a, b) => a.number - b.number)) {
      if (save.number > last) break;
      for (const level of save.gone ?? []) levels.delete(level);
      for (const state of save.levels) levels.set(state.level, state);
    }
    return levels;
  };
  const newest = () => Math.max(0, ...saves.keys());
  const kind = (state) => {
    if (state.problem) return "broken";
    if (!state.verdict.outcome) return "testing";
    if (state.verdict.findings.length > 0 && state.verdict.outcome === "solved") return "bot-failed";
    return state.verdict.outcome;
  };
  // Returns the level of a save with the worst outcome.
  const worst = (save) => [...(save?.levels ?? [])].sort((a, b) => rank[kind(a)] - rank[kind(b)])[0];
  const rank = { broken: 0, "proved-unsolvable": 1, "bot-failed": 2, testing: 3, solved: 4 };
  const outcomes = { solved: "solved", "bot-failed": "not solved, nothing proved", "proved-unsolvable": "unsolvable" };
  const signed = (number) => (number > 0 ? `+${number}` : `−${-number}`);
  const plural = (count, what) => `${count} ${what}${count === 1 ? "" : "s"}`;

  const short = (state) => {
    if (state.problem) return "not tested";
    const { verdict, before } = state;
    if (!verdict.outcome) return "testing…";
    let words = outcomes[verdict.outcome];
    if (verdict.outcome === "solved" && verdict.ticks) {
      words = plural(verdict.ticks, "tick");
      if (before?.ticks && before.ticks !== verdict.ticks) words += ` (${signed(verdict.ticks - before.ticks)})`;
    }
    if (verdict.lost > 0) words += `, ${plural(verdict.lost, "death")}`;
    if (verdict.findings.length > 0) words += `, ${plural(verdict.findings.length, "finding")}`;
    return words;
  };
  // The verdict in a few words, and the rest of what is known.
  const headline = (state) => {
    if (state.problem) return "Not tested";
    const { verdict, before } = state;
    if (!verdict.outcome) return "Testing…";
    let words = outcomes[verdict.outcome];
    words = words[0].toUpperCase() + words.slice(1);
    if (verdict.outcome === "solved" && verdict.ticks) words += ` in ${plural(verdict.ticks, "tick")} by ${verdict.solved_by}`;
    if (before?.outcome && before.outcome !== verdict.outcome) words += ` (before: ${outcomes[before.outcome]})`;
    else if (before?.ticks && verdict.ticks && before.ticks !== verdict.ticks) words += ` (${signed(verdict.ticks - before.ticks)} since the save before)`;
    return verdict.is_final || !verdict.outcome ? words : `${words}. Testing goes on…`;
  };
  const more = (state) => {
    if (state.problem) return state.problem;
    const { verdict, before } = state;
    const words = [];
    if (verdict.why) words.push(verdict.why);
    if (verdict.stored) words.push(`the stored solution ${verdict.stored}`);
    if (verdict.reached?.open) words.push(`the explorer reaches ${verdict.reached.visited} of the ${plural(verdict.reached.open, "square")} that no wall cuts off`);
    if (verdict.lost > 0 || before?.lost > 0) {
      const since = before && before.lost !== verdict.lost ? ` (${signed(verdict.lost - before.lost)})` : "";
      words.push(`${plural(verdict.lost, "death")}${since}`);
    }
    if (verdict.solved_at_start) words.push("it is solved in its first tick: the agent may start at its goal");
    const text = words.join("; ");
    return text === "" ? "" : `${text[0].toUpperCase()}${text.slice(1)}.`;
  };

  const item = (words, small, isCurrent, choose) => {
    const entry = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    button.append(words);
    const note = document.createElement("small");
    note.textContent = small;
    button.append(note);
    if (isCurrent) button.setAttribute("aria-current", "true");
    button.addEventListener("click", choose);
    entry.append(button);
    return [entry, button];
  };
  // Keeps the focus where it was, since lists are made anew.
  const replace = (list, entries) => {
    const focused = [...list.querySelectorAll("button")].indexOf(document.activeElement);
    const top = list.scrollTop;
    list.replaceChildren(...entries);
    list.scrollTop = top;
    if (focused >= 0) list.querySelectorAll("button")[Math.min(focused, entries.length - 1)]?.focus();
  };

  let order = [];
  const draw = () => {
    const last = shownSave ?? newest();
    const levels = levelsAfter(last);
    const save = saves.get(last);
    const changed = worst(save)?.level;
    const current = levels.has(shownLevel) ? shownLevel : levels.has(changed) ? changed : levels.keys().next().value;
    const all = [...levels.values()];
    order = all.sort((a, b) => rank[kind(a)] - rank[kind(b)] || a.level.localeCompare(b.level, undefined, { numeric: true }));
    const words = get("words").value.trim().toLowerCase();
    const listed = order.filter((state) => state.level.toLowerCase().includes(words));
    replace(get("levels-list"), listed.slice(0, 500).map((state) => {
      const [entry, button] = item(state.level, short(state), state.level === current, () => {
        shownLevel = state.level;
        draw();
      });
      button.classList.add(kind(state));
      return entry;
    }));
    const bad = all.filter((state) => kind(state) !== "solved" && kind(state) !== "testing").length;
    const isWell = bad === 0 && all.length > 0 && !save?.problem;
    get("counts").textContent = `${plural(all.length, "level")}, ${isWell ? "all well" : save?.problem ? "with a problem" : `${bad} to look at`}`;
    document.title = isWell ? `✓ ${title}` : `✗ ${bad > 0 ? `${bad} ` : ""}${title}`;
    get("problem").textContent = save?.problem ?? "";
    get("problem").hidden = !save?.problem;
    const list = [...saves.values()].sort((a, b) => b.number - a.number);
    replace(get("saves-list"), list.map((one) => {
      const time = new Date(one.at).toLocaleTimeString();
      const what = one.problem ? "problem" : [...one.levels.map((state) => state.level), ...(one.gone ?? []).map((level) => `${level} gone`)];
      const gone = one.gone?.length > 0 && one.levels.length === 0 ? " gone" : "";
      const small = Array.isArray(what) ? (what.length === 0 ? "as before" : what.length > 2 ? `${plural(what.length, "level")}${gone}` : what.join(", ")) : what;
      const [entry, button] = item(`${one.number}, ${time}`, small, one.number === last, () => {
        shownSave = one.number === newest() ? null : one.number;
        shownLevel = worst(one)?.level ?? shownLevel;
        draw();
      });
      const shown = worst(one);
      button.classList.add(one.problem ? "broken" : shown ? kind(shown) : "testing");
      return entry;
    }));
    get("latest").hidden = shownSave === null && shownLevel === null;
    show(levels.get(current));
  };
  const show = (state) => {
    get("shown").dataset.kind = state ? kind(state) : "";
    if (!state) {
      get("name").textContent = "No level";
      for (const id of ["verdict", "more", "took"]) get(id).textContent = "";
      for (const id of ["picture", "findings"]) get(id).replaceChildren();
      get("picture").dataset.now = "";
      get("legend").hidden = true;
      return;
    }
    get("legend").hidden = false;
    get("name").textContent = state.level;
    get("verdict").textContent = headline(state);
    get("more").textContent = more(state);
    get("verdict").className = kind(state);
    const picture = get("picture");
    if (picture.dataset.now !== (state.verdict.picture ?? "")) {
      picture.dataset.now = state.verdict.picture ?? "";
      // The picture is made by the program, of numbers alone.
      picture.innerHTML = state.verdict.picture ?? "";
    }
    for (const entry of get("legend").children) {
      entry.hidden = !(state.verdict.picture ?? "").includes(entry.dataset.of);
    }
    // A proof that there is no path is a finding, too, and is shown above.
    const findings = state.verdict.findings.filter((finding) => finding.message !== state.verdict.why);
    get("findings").replaceChildren(...findings.map((finding) => {
      const entry = document.createElement("li");
      const name = document.createElement("b");
      name.textContent = finding.detector;
      const by = finding.tester ? ` (${finding.tester}${finding.tick === null ? "" : `, tick ${finding.tick}`})` : "";
      entry.append(name, `${by}: ${finding.message}`);
      return entry;
    }));
    get("took").textContent = state.problem ? "" : `Tested in ${state.seconds.toFixed(2)} s.`;
  };

  get("words").addEventListener("input", draw);
  get("latest").addEventListener("click", () => {
    shownSave = null;
    shownLevel = null;
    draw();
  });
  document.addEventListener("keydown", (event) => {
    if (event.target.tagName === "INPUT" || event.altKey || event.ctrlKey || event.metaKey) return;
    const step = { ArrowDown: 1, ArrowUp: -1, j: 1, k: -1 }[event.key];
    const turn = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) {
      const at = order.findIndex((state) => state.level === get("name").textContent);
      shownLevel = order[Math.min(Math.max(at + step, 0), order.length - 1)]?.level ?? null;
    } else if (turn) {
      const numbers = [...saves.keys()].sort((a, b) => a - b);
      const at = numbers.indexOf(shownSave ?? newest());
      const wanted = numbers[Math.min(Math.max(at + turn, 0), numbers.length - 1)];
      shownSave = wanted === newest() ? null : wanted;
      // The level that changed then, as after a click.
      shownLevel = null;
    } else return;
    event.preventDefault();
    draw();
  });

  const events = new EventSource("/events");
  events.addEventListener("open", () => {
    get("link").textContent = "";
    document.body.classList.remove("ended");
  });
  events.addEventListener("error", () => {
    get("link").textContent = "The watch has ended: start it again, and this page goes on.";
    document.title = `⚠ ${title}`;
    document.body.classList.add("ended");
  });
  events.addEventListener("all", (event) => {
    saves.clear();
    for (const save of JSON.parse(event.data)) saves.set(save.number, save);
    draw();
  });
  events.addEventListener("save", (event) => {
    const save = JSON.parse(event.data);
    saves.set(save.number, save);
    draw();
  });
})();
