"use strict";

// Time, buttons and read-outs. Also the page's interface to scripts: `fingerPlayer`.
class Player {
  constructor(config, frames) {
    this.config = config;
    this.frames = frames;
    this.viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
    this.scene = new FingerScene(this.viewer, config, frames);
    this.scale = config.tensionScale;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.sharpness = 1;
    this.due = this.started = 0;
    this.build();
    this.scene.frame("oblique");
    this.seek(frames.start);
    this.play();
    requestAnimationFrame((now) => this.tick(now));
  }

  tick(now) {
    this.advance(now);
    this.scene.placeLabels();
    requestAnimationFrame((later) => this.tick(later));
  }

  // `now` in ms, of the browser's clock.
  advance(now) {
    if (this.started) this.pace(now, now - this.started);
    this.started = 0;
    if (!this.playing || now < this.due) return;
    const next = this.time + (this.speed * (now - this.shown)) / 1000;
    this.shown = this.started = now;
    if (next <= this.frames.end) this.seek(next);
    else if (this.element.loop.checked) this.seek(this.frames.start);
    else { this.seek(this.frames.end); this.pause(); }
  }

  // Without a graphics processor a picture takes long. Then rest after each, so that buttons react, and draw coarser
  // pictures while playing.
  pace(now, cost) {
    this.due = cost > 50 ? now + cost : 0;
    if (cost > 80 && this.playing && this.sharpness > 0.5) this.sharpen(0.8 * this.sharpness);
  }

  sharpen(part) {
    if (part === this.sharpness) return;
    this.sharpness = part;
    this.viewer.renderer.setPixelRatio(part * window.devicePixelRatio);
    this.viewer.set_3d_pane_size();
  }

  play() {
    if (this.time >= this.frames.end) this.seek(this.frames.start);
    this.shown = performance.now();
    this.playing = true;
    this.refresh();
  }

  pause() {
    this.playing = false;
    this.sharpen(1);
    this.refresh();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, this.frames.start), this.frames.end);
    const place = this.frames.locate(this.time);
    const tensions = this.frames.mix("tension", place);
    const { slackTension, colours: palette } = this.config;
    const colours = Array.from(tensions, (tension) =>
      mixed(tensionColour(tension, this.scale, palette.tension), palette.slack, looseness(tension, slackTension)));
    this.scene.show(place, [...colours, palette.cord]);
    this.readOut(tensions, colours, this.frames.mix("joint", place));
    this.refresh();
  }

  readOut(tensions, colours, angles) {
    this.rows.forEach(({ bar, value }, i) => {
      const slack = looseness(Math.abs(tensions[i]), this.config.slackTension) > 0.5;
      bar.style.width = `${Math.min(100, (100 * Math.max(tensions[i], 0)) / this.scale)}%`;
      bar.style.background = css(colours[i]);
      value.textContent = slack ? "slack" : this.hand ? tensions[i].toFixed(1) : `${tensions[i].toFixed(2)} N`;
      value.classList.toggle("slack", slack);
    });
    this.angles.forEach((cell, i) => {
      const slides = this.config.slides.includes(this.config.joints[i]);
      cell.textContent = slides ? `${(1e3 * angles[i]).toFixed(1)} mm` : degrees(angles[i], this.hand ? 0 : 1);
    });
  }

  refresh() {
    const { play, scrub, clock } = this.element;
    play.classList.toggle("playing", this.playing);
    play.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    scrub.value = this.time;
    clock.textContent = `${this.time.toFixed(2)} / ${this.frames.end.toFixed(2)} s`;
  }

  build() {
    const names = ["play", "restart", "scrub", "clock", "speed", "loop", "legend", "ticks", "scale", "readings"];
    this.element = Object.fromEntries(names.map((name) => [name, document.getElementById(name)]));
    document.getElementById("title").textContent = this.config.title;
    for (const [name, text] of [["forces", this.config.forces], ["cords", this.config.cords], ["ghost", this.config.ghost?.title], ["objects", this.config.objects?.note]]) {
      const note = document.getElementById(name);
      note.hidden = !text;
      note.lastElementChild.textContent = text;
    }
    document.querySelector(".grid-note").textContent = ` · grid ${1000 * this.config.grid} mm`;
    this.hand = this.config.joints.some((name) => name.includes("."));
    document.getElementById("panel").classList.toggle("hand", this.hand);
    const tendons = this.config.strands.length > 0;
    for (const section of document.querySelectorAll(".tendons")) section.hidden = !tendons;
    // Without any tension its colours say nothing.
    this.element.scale.hidden = !this.frames.columns.tension.data.some((tension) => tension > 0);
    this.drawLegend();
    Object.assign(this.element.scrub, { min: this.frames.start, max: this.frames.end });
    // The tables of a hand would cover half of a phone.
    const narrow = window.matchMedia("(max-width: 600px), (max-height: 500px)");
    const fold = () => { this.element.readings.open = !(this.hand && narrow.matches); };
    narrow.addEventListener("change", fold);
    this.element.readings.addEventListener("toggle", () => this.scene.reframe());
    fold();
    const [tensions, joints] = ["tensions", "joints"].map((name) => document.getElementById(name));
    this.rows = this.hand ? byFinger(tensions, this.config.strands, 1) : this.config.strands.map((name) => {
      const row = tensions.insertRow();
      Object.assign(row.insertCell(), { className: "name", textContent: name, title: name });
      const gauge = Object.assign(row.insertCell(), { className: "gauge", innerHTML: "<div><div></div></div>" });
      return { bar: gauge.firstChild.firstChild, value: Object.assign(row.insertCell(), { className: "value" }) };
    });
    this.angles = this.hand ? byFinger(joints, this.config.joints, 0).map(({ value }) => value) : this.config.joints.map((name) => {
      const row = joints.insertRow();
      Object.assign(row.insertCell(), { className: "name", textContent: name, title: name });
      return Object.assign(row.insertCell(), { className: "value" });
    });
    const { play, restart, scrub, speed } = this.element;
    play.onclick = () => (this.playing ? this.pause() : this.play());
    restart.onclick = () => this.seek(this.frames.start);
    scrub.oninput = () => {
      const wanted = Number(scrub.value);
      this.pause();
      this.seek(wanted);
    };
    speed.onchange = () => { this.speed = Number(speed.value); };
    for (const button of document.querySelectorAll("[data-view]")) {
      button.onclick = () => this.scene.frame(button.dataset.view);
    }
    window.addEventListener("keydown", (event) => this.key(event));
    window.addEventListener("resize", () => this.scene.reframe());
    // A phone that is turned.
    window.matchMedia("(orientation: portrait)").addEventListener("change", () => this.scene.frame(this.scene.view));
  }

  key(event) {
    if (event.target.matches("select, input") || event.ctrlKey || event.metaKey || event.altKey) return;
    const step = { ArrowLeft: -0.05, ArrowRight: 0.05 }[event.key];
    const view = { 1: "oblique", 2: "side", 3: "top" }[event.key];
    if (event.key === " ") this.element.play.onclick();
    else if (event.key === "Home") this.element.restart.onclick();
    else if (step) { this.pause(); this.seek(this.time + step); }
    else if (view) this.scene.frame(view);
    else return;
    event.preventDefault();
  }

  drawLegend() {
    const { legend, ticks } = this.element;
    const pen = legend.getContext("2d");
    for (let x = 0; x < legend.width; x++) {
      pen.fillStyle = css(tensionColour(x / (legend.width - 1), 1, this.config.colours.tension));
      pen.fillRect(x, 0, 1, 1);
    }
    ticks.replaceChildren(...[0, 0.5, 1].map((part) => {
      const tick = document.createElement("span");
      tick.style.left = `${100 * part}%`;
      tick.textContent = `${Number((part * this.scale).toPrecision(3))}${part === 1 ? " N" : ""}`;
      return tick;
    }));
  }
}

// A column for each finger, a row for each of its own names; with bars under the values if asked.
function byFinger(table, names, bars) {
  const parted = names.map((name) => name.split("."));
  const [fingers, own] = [0, 1].map((part) => [...new Set(parted.map((each) => each[part]))]);
  const head = table.insertRow();
  for (const name of ["", ...fingers]) Object.assign(head.insertCell(), { className: "finger", textContent: name, title: name });
  const cells = own.map((name) => {
    const row = table.insertRow();
    const short = name.replace(" proximal", " prox.").replace(" distal", " dist.");
    Object.assign(row.insertCell(), { className: "name", textContent: short, title: name });
    return fingers.map(() => Object.assign(row.insertCell(), { className: "value" }));
  });
  return parted.map(([finger, name], i) => {
    const cell = cells[own.indexOf(name)][fingers.indexOf(finger)];
    cell.title = names[i];
    cell.innerHTML = bars ? "<span></span><div class='gauge'><div><div></div></div></div>" : "<span></span>";
    return { value: cell.firstChild, bar: bars ? cell.lastChild.firstChild.firstChild : null };
  });
}

// What rounds to zero has no sign.
const degrees = (angle, digits) => `${((180 / Math.PI) * angle).toFixed(digits).replace(/^-(?=[0.]*$)/, "")}°`;

const css = (colour) => `rgb(${colour.map((value) => Math.round(255 * value)).join(",")})`;

async function start() {
  const [meshcat, scene, frames] = await Promise.all(["meshcat", "scene", "frames"].map(unpack));
  const text = (bytes) => new TextDecoder().decode(bytes);
  document.head.append(Object.assign(document.createElement("script"), { textContent: text(meshcat) }));
  const config = JSON.parse(text(scene));
  window.fingerPlayer = new Player(config, new Frames(config.columns, frames));
}

start().catch((error) => {
  document.getElementById("title").textContent = `This browser cannot play the page: ${error.message}`;
  throw error;
});
