"use strict";
// The page of skills: tiles of a grid, and one skill with sliders. A page in a file has all tiles with it.
const at = (id) => document.getElementById(id);
const kept = JSON.parse(at("data").textContent);
const isServed = kept === null;
let about, skills, names, z;
const tiles = new Map();
const key = (skill) => skill.map((value) => value.toFixed(3)).join(",");

function element(name, words, parent) {
  const made = document.createElement(name);
  if (words !== undefined) made.textContent = words;
  if (parent) parent.append(made);
  return made;
}

function problem(words) {
  at("problem").hidden = !words;
  at("problem").textContent = words || "";
}

async function ask(path, options) {
  const answer = await fetch(path, options);
  const value = await answer.json();
  if (!answer.ok) throw new Error(value.error);
  return value;
}

async function tile(skill) {
  const name = key(skill);
  if (!tiles.has(name)) {
    if (!isServed) return null;
    tiles.set(name, await ask(`/tile?z=${name}`));
  }
  return tiles.get(name);
}

function nameOf(skill) {
  let best = null, nearest = Infinity;
  for (const region of names) {
    const distance = Math.hypot(...region.z.map((value, index) => value - skill[index]));
    if (distance <= region.radius && distance < nearest) [best, nearest] = [region.name, distance];
  }
  return best;
}

const facts = (one) => `return ${one.return.toFixed(2)}, ${one.end} after ${one.ticks} tick${one.ticks === 1 ? "" : "s"}`;

function fill(button, one, skill) {
  button.replaceChildren();
  const image = element("img", undefined, button);
  image.src = one.picture;
  image.alt = `Rollout of z = ${key(skill)}: ${facts(one)}`;
  const words = element("span", undefined, button);
  const name = nameOf(skill);
  if (name) element("b", `${name}: `, words);
  words.append(facts(one));
}

async function drawGrid() {
  const grid = at("grid");
  grid.style.gridTemplateColumns = `repeat(${about.columns}, minmax(0, 1fr))`;
  const buttons = skills.map((skill) => {
    const button = element("button", "…", grid);
    button.type = "button";
    button.className = "tile";
    button.dataset.z = key(skill);
    button.addEventListener("click", () => choose(skill.slice()));
    return button;
  });
  for (const [index, skill] of skills.entries()) {
    try {
      fill(buttons[index], await tile(skill), skill);
    } catch (error) {
      buttons[index].textContent = error.message;
    }
  }
}

let latest = 0;
async function choose(skill) {
  z = skill;
  const turn = ++latest;
  for (const button of document.querySelectorAll(".tile")) button.setAttribute("aria-current", String(button.dataset.z === key(z)));
  for (const slider of document.querySelectorAll("#sliders input")) {
    slider.value = z[slider.dataset.dim];
    slider.nextElementSibling.textContent = z[slider.dataset.dim].toFixed(2);
  }
  at("name").textContent = nameOf(z) || "One skill";
  at("words").value = nameOf(z) || "";
  try {
    const one = await tile(z);
    // A slider may have moved on meanwhile.
    if (turn !== latest || !one) return;
    const image = element("img");
    image.src = one.picture;
    image.alt = `Rollout of z = ${key(z)}`;
    at("shown").replaceChildren(image);
    at("facts").textContent = `${facts(one)}. z = ${key(z)}`;
    problem("");
  } catch (error) {
    if (turn === latest) problem(error.message);
  }
}

function listNames() {
  at("names").replaceChildren();
  for (const region of names) {
    element("li", `${region.name}: within ${region.radius} of ${key(region.z)}`, at("names"));
  }
}

async function keep(event) {
  event.preventDefault();
  const region = { name: at("words").value.trim(), z, radius: Number(at("radius").value) };
  try {
    names = (await ask("/name", { method: "POST", body: JSON.stringify(region) })).names;
    listNames();
    at("name").textContent = nameOf(z) || "One skill";
    for (const [index, button] of [...document.querySelectorAll(".tile")].entries()) {
      const one = tiles.get(key(skills[index]));
      if (one) fill(button, one, skills[index]);
    }
    problem("");
  } catch (error) {
    problem(error.message);
  }
}

async function begin() {
  const all = kept || (await ask("/about"));
  ({ about, skills, names } = all);
  for (const one of all.tiles || []) tiles.set(key(one.z), one);
  document.title = `Skills of ${about.game}`;
  at("title").textContent = document.title;
  at("about").textContent =
    `${about.policy} on level ${about.mode} ${about.level}, from tick ${about.tick} on, ${about.ticks} ticks with each skill. In play a skill is kept for ${about.interval} ticks.`;
  at("axes").textContent = `Across: value ${about.dims[0]} of z, down: value ${about.dims[1]}. Choose a tile to see it larger.`;
  at("help").textContent = isServed
    ? "An empty name takes the name of this region away."
    : "This page is a file: the command without --out has sliders and keeps names.";
  if (isServed) {
    at("naming").hidden = false;
    at("naming").addEventListener("submit", keep);
    for (let dim = 0; dim < about.latent; dim += 1) {
      const label = element("label", `z ${dim}`, at("sliders"));
      const slider = element("input", undefined, label);
      Object.assign(slider, { type: "range", min: -1, max: 1, step: 0.05 });
      slider.dataset.dim = dim;
      element("output", "0.00", label);
      slider.addEventListener("input", () => choose(z.map((value, index) => (index === dim ? Number(slider.value) : value))));
    }
  }
  listNames();
  choose(skills[Math.floor(skills.length / 2)].slice());
  await drawGrid();
}

begin().catch((error) => problem(error.message));
