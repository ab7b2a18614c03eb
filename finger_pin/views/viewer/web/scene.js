"use strict";

const SIDES = 10;

// A tube along a polyline whose points and colours change from frame to frame.
class Tube {
  constructor(count, radius, options) {
    const { BufferAttribute, BufferGeometry, Mesh, MeshPhongMaterial } = MeshCat.THREE;
    this.count = count;
    this.radius = radius;
    this.geometry = new BufferGeometry();
    for (const name of ["position", "normal", "color"]) {
      this.geometry.setAttribute(name, new BufferAttribute(new Float32Array(3 * count * SIDES), 3));
    }
    const index = [];
    for (let ring = 0; ring + 1 < count; ring++) {
      for (let side = 0; side < SIDES; side++) {
        const [a, b] = [ring * SIDES + side, ring * SIDES + ((side + 1) % SIDES)];
        index.push(a, b, a + SIDES, b, b + SIDES, a + SIDES);
      }
    }
    this.geometry.setIndex(index);
    this.mesh = new Mesh(this.geometry, new MeshPhongMaterial({ shininess: 40, ...options }));
    this.mesh.frustumCulled = false;
  }

  // Rings are carried along the path without twist, so that shading does not flicker.
  shape(points) {
    const { Vector3 } = MeshCat.THREE;
    const { position, normal } = this.geometry.attributes;
    const at = (i) => new Vector3(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
    let tangent = new Vector3(1, 0, 0);
    let across = null;
    const out = new Vector3();
    for (let i = 0; i < this.count; i++) {
      const centre = at(i);
      const along = at(Math.min(i + 1, this.count - 1)).sub(at(Math.max(i - 1, 0)));
      if (along.lengthSq() > 1e-14) tangent = along.normalize();
      if (across === null) across = new Vector3(0, 1, 0).addScaledVector(tangent, 0.31);
      across.addScaledVector(tangent, -across.dot(tangent)).normalize();
      const third = new Vector3().crossVectors(tangent, across);
      for (let side = 0; side < SIDES; side++) {
        const angle = (2 * Math.PI * side) / SIDES;
        out.copy(across).multiplyScalar(Math.cos(angle)).addScaledVector(third, Math.sin(angle));
        const vertex = i * SIDES + side;
        normal.setXYZ(vertex, out.x, out.y, out.z);
        position.setXYZ(vertex, centre.x + this.radius * out.x, centre.y + this.radius * out.y, centre.z + this.radius * out.z);
      }
    }
    position.needsUpdate = normal.needsUpdate = true;
  }

  paint(colourOf) {
    const colours = this.geometry.attributes.color;
    for (let vertex = 0; vertex < this.count * SIDES; vertex++) {
      colours.setXYZ(vertex, ...colourOf(Math.floor(vertex / SIDES)));
    }
    colours.needsUpdate = true;
  }
}

// One tendon: its tube, and knots where it is anchored, ends, or carries its lumped mass.
class TendonView {
  constructor(viewer, config, tendon) {
    const { Mesh, MeshPhongMaterial, SphereGeometry } = MeshCat.THREE;
    this.strand = tendon.strand;
    this.tube = new Tube(tendon.strand.length, config.tubeRadius, { vertexColors: true });
    viewer.set_object([ROOT, "tendons", tendon.name], this.tube.mesh);
    this.knots = tendon.knots.map((index, i) => {
      const knot = new Mesh(new SphereGeometry(2 * config.tubeRadius, 20, 14), new MeshPhongMaterial({ shininess: 40 }));
      viewer.set_object([ROOT, "knots", tendon.name, String(i)], knot);
      return { index, knot };
    });
  }

  show(points, colours) {
    this.points = points;
    this.tube.shape(points);
    this.tube.paint((ring) => colours[this.strand[ring]]);
    for (const { index, knot } of this.knots) {
      knot.position.set(points[3 * index], points[3 * index + 1], points[3 * index + 2]);
      knot.material.color.setRGB(...colours[this.strand[index]]);
    }
  }
}

// The path of a fingertip: what is past in full colour, what is to come faint.
class Trace {
  constructor(viewer, config, frames, finger) {
    this.frames = frames;
    const look = { color: 0x000000, emissive: 0xff86b4 };
    this.past = new Tube(TRACE_POINTS, 0.6 * config.tubeRadius, look);
    this.rest = new Tube(TRACE_POINTS, 0.3 * config.tubeRadius, { ...look, transparent: true, opacity: 0.35 });
    viewer.set_object([ROOT, "fingertip_trace", String(finger), "past"], this.past.mesh);
    viewer.set_object([ROOT, "fingertip_trace", String(finger), "rest"], this.rest.mesh);
    const tips = new Float32Array(3 * TRACE_POINTS);
    for (let i = 0; i < TRACE_POINTS; i++) {
      const frame = Math.round((i * (frames.count - 1)) / (TRACE_POINTS - 1));
      tips.set(frames.row("tip", frame).subarray(3 * finger, 3 * finger + 3), 3 * i);
    }
    this.past.shape(tips);
    this.rest.shape(tips);
  }

  show(place) {
    const done = this.frames.count > 1 ? (place.low + place.weight) / (this.frames.count - 1) : 0;
    this.past.geometry.setDrawRange(0, 6 * SIDES * Math.floor(done * (TRACE_POINTS - 1)));
  }
}

// A closed contact: an arrow for the force on the second body, which ends where bodies touch, and the friction cone
// around the normal, in which the arrow lies as long as the contact sticks. Only its angle says something: it is as
// long as the arrow's part along the normal, but no larger than a finger is wide.
class ContactView {
  constructor(viewer, config, steepness, index) {
    const { ConeGeometry, CylinderGeometry, DoubleSide, Group, Mesh, MeshPhongMaterial } = MeshCat.THREE;
    this.length = config.objects.length;
    this.tallest = config.objects.cone / Math.hypot(1, steepness);
    this.group = new Group();
    // All of them have their end at the origin and are open along -y.
    const [radius, paint] = [0.6 * config.tubeRadius, new MeshPhongMaterial({ color: FORCE_COLOUR })];
    this.headLength = 6 * radius;
    this.head = new Mesh(new ConeGeometry(2.5 * radius, 1, 20).translate(0, -0.5, 0), paint);
    this.shaft = new Mesh(new CylinderGeometry(radius, radius, 1, 12).translate(0, -0.5, 0), paint);
    this.arrow = new Group();
    this.arrow.add(this.head, this.shaft);
    const cone = new ConeGeometry(steepness, 1, 40, 1, true).translate(0, -0.5, 0);
    const look = { color: 0x9ad0ff, transparent: true, opacity: 0.25, side: DoubleSide, depthWrite: false };
    this.cone = new Mesh(cone, new MeshPhongMaterial(look));
    this.group.add(this.arrow, this.cone);
    viewer.set_object([ROOT, "contacts", String(index)], this.group);
  }

  show(numbers) {
    const { Vector3 } = MeshCat.THREE;
    const [point, force, normal] = [0, 3, 6].map((first) => new Vector3().fromArray(numbers, first));
    const size = this.length * force.length();
    this.group.visible = size > 1e-6 && normal.lengthSq() > 0.5;
    if (!this.group.visible) return;
    const along = force.clone().normalize();
    this.arrow.position.copy(point);
    this.arrow.quaternion.setFromUnitVectors(new Vector3(0, 1, 0), along);
    this.head.scale.y = Math.min(this.headLength, 0.6 * size);
    this.shaft.position.y = -0.9 * this.head.scale.y;
    this.shaft.scale.y = size - 0.9 * this.head.scale.y;
    this.cone.position.copy(point);
    this.cone.quaternion.setFromUnitVectors(new Vector3(0, -1, 0), normal.normalize());
    this.cone.scale.setScalar(Math.min(Math.max(-this.length * force.dot(normal), 1e-6), this.tallest));
  }
}

const ROOT = "finger_pin";
const TRACE_POINTS = 800;
// Of contact forces, which no tension has.
const FORCE_COLOUR = 0xff5a5a;

class FingerScene {
  constructor(viewer, config, frames) {
    this.viewer = viewer;
    this.config = config;
    this.frames = frames;
    for (const command of config.commands) viewer.handle_command(command);
    this.links = config.links.map((name) => viewer.scene_tree.find([ROOT, name]).object);
    this.ghostLinks = (config.ghost?.links ?? []).map((name) => viewer.scene_tree.find([ROOT, "ghost", name]).object);
    this.free = (config.objects?.free ?? []).map((name) => viewer.scene_tree.find([ROOT, name]).object);
    this.contacts = (config.objects?.steepness ?? []).map((each, i) => new ContactView(viewer, config, each, i));
    this.tendons = config.tendons.map((tendon) => new TendonView(viewer, config, tendon));
    this.traces = Array.from({ length: config.tips }, (_, i) => new Trace(viewer, config, frames, i));
    this.root = viewer.scene_tree.find([ROOT]).object;
    this.box = [Math.min, Math.max].map((pick) => [0, 1, 2].map((i) => pick(...config.inView.map((point) => point[i]))));
    // In a hand a finger's name stands for its tendons.
    const named = config.tendons.map((tendon) => tendon.name.split(".")[0]);
    this.labels = named.map((name, i) => {
      if (named.indexOf(name) < i) return null;
      const label = document.createElement("div");
      label.textContent = name;
      document.getElementById("labels").append(label);
      return label;
    });
    this.dress();
  }

  // Light, ground and background for an object of centimetres; rims make translucent solids readable.
  dress() {
    const { EdgesGeometry, GridHelper, LineBasicMaterial, LineSegments } = MeshCat.THREE;
    const { viewer } = this;
    const rim = new LineBasicMaterial({ color: 0xc8d4e6, transparent: true, opacity: 0.22, depthWrite: false });
    const solids = [];
    for (const link of this.links) link.traverse((object) => { if (object.isMesh) solids.push(object); });
    for (const solid of solids) solid.add(new LineSegments(new EdgesGeometry(solid.geometry, 30), rim));
    viewer.set_property(["Background"], "top_color", [0.17, 0.21, 0.28]);
    viewer.set_property(["Background"], "bottom_color", [0.06, 0.08, 0.11]);
    viewer.set_property(["Axes"], "visible", false);
    const intensity = { AmbientLight: 0.62, FillLight: 0.18, PointLightNegativeX: 0.42, PointLightPositiveX: 0.22 };
    for (const [name, value] of Object.entries(intensity)) {
      viewer.set_property(["Lights", name, "<object>"], "intensity", value);
    }
    viewer.set_property(["Lights", "PointLightNegativeX", "<object>"], "position", [0.8, -1.2, 1.6]);
    const [low, high] = this.box;
    const cells = Math.ceil((2.2 * Math.max(high[0] - low[0], high[1] - low[1], high[2] - low[2])) / this.config.grid);
    const grid = new GridHelper(cells * this.config.grid, cells, 0x4a586c, 0x303b4b);
    grid.rotateX(Math.PI / 2);
    grid.position.set((low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2] - 2 * this.config.margin);
    viewer.set_object(["Grid"], grid);
  }

  show(place, colours) {
    this.pose(this.links, "pose", place);
    if (this.config.ghost) this.pose(this.ghostLinks, "ghost", place);
    if (this.config.objects) {
      this.pose(this.free, "object", place);
      const numbers = this.frames.mix("contact", place);
      this.contacts.forEach((contact, i) => contact.show(numbers.subarray(9 * i, 9 * i + 9)));
    }
    const points = this.frames.mix("path", place).map((value) => value * this.config.quantum);
    let first = 0;
    for (const tendon of this.tendons) {
      const size = 3 * tendon.strand.length;
      tendon.show(points.subarray(first, first + size), colours);
      first += size;
    }
    for (const trace of this.traces) trace.show(place);
    this.viewer.set_dirty();
  }

  pose(links, name, place) {
    const poses = this.frames.poses(name, place);
    links.forEach((link, i) => {
      link.position.fromArray(poses, 7 * i);
      link.quaternion.fromArray(poses, 7 * i + 3);
    });
  }

  // The camera looks at the whole motion, in the part of the window that the panel and the bar leave free.
  frame(name) {
    this.view = name;
    const { Vector3 } = MeshCat.THREE;
    const { camera, controls } = this.viewer;
    const away = new Vector3(...{ oblique: [0.42, -1, 0.5], side: [0, -1, 0.0], top: [0, -0.001, 1] }[name]).normalize();
    const toWorld = (v) => new Vector3(v.x, v.z, -v.y);
    const right = new Vector3(0, 0, 1).cross(away).normalize();
    const up = away.clone().cross(right);
    const [width, height] = [window.innerWidth, window.innerHeight];
    const panel = document.getElementById("panel").getBoundingClientRect();
    const beside = panel.right < 0.45 * width;
    const [left, top] = beside ? [panel.right + 20, 0] : [0, panel.bottom];
    const bottom = height - document.getElementById("bar").getBoundingClientRect().top;
    camera.fov = 30;
    camera.near = 0.002;
    camera.far = 20;
    const slope = Math.tan((camera.fov * Math.PI) / 360);
    const [reachX, reachY] = [(slope * 0.92 * (width - left)) / height, (slope * 0.92 * (height - top - bottom)) / height];
    // Move until the sides that are seen at the largest angles are equally far out, then back off until all fits.
    const points = this.config.inView.map((point) => new Vector3(...point));
    const centre = points.reduce((sum, point) => sum.add(point), new Vector3()).divideScalar(points.length);
    const { margin } = this.config;
    let distance = 0;
    for (let pass = 0; pass < 12; pass++) {
      const edges = { left: Infinity, right: -Infinity, low: Infinity, high: -Infinity };
      let needed = 0;
      for (const point of points) {
        const offset = point.clone().sub(centre);
        const [x, y, near] = [offset.dot(right), offset.dot(up), offset.dot(away)];
        needed = Math.max(needed, near + (Math.abs(x) + margin) / reachX, near + (Math.abs(y) + margin) / reachY);
        const scale = distance > 0 ? distance / (distance - near) : 1;
        edges.left = Math.min(edges.left, x * scale);
        edges.right = Math.max(edges.right, x * scale);
        edges.low = Math.min(edges.low, y * scale);
        edges.high = Math.max(edges.high, y * scale);
      }
      if (pass < 11) centre.addScaledVector(right, (edges.left + edges.right) / 2).addScaledVector(up, (edges.low + edges.high) / 2);
      distance = needed;
    }
    const pixel = (2 * slope * distance) / height;
    centre.addScaledVector(right, (-left / 2) * pixel).addScaledVector(up, ((top - bottom) / 2) * pixel);
    controls.target.copy(toWorld(centre));
    camera.position.copy(toWorld(centre.clone().addScaledVector(away, distance)));
    controls.minDistance = 0.1 * distance;
    controls.maxDistance = 10 * distance;
    controls.update();
    this.placed = camera.position.clone();
    this.viewer.set_dirty();
  }

  // A window of another size needs another place, unless the user has chosen one.
  reframe() {
    if (this.viewer.camera.position.distanceTo(this.placed) < 1e-9) this.frame(this.view);
  }

  // Names stand where the tendons begin, and make room for each other.
  placeLabels() {
    const { camera } = this.viewer;
    const places = this.tendons.map((tendon, i) => {
      const at = this.root.localToWorld(new MeshCat.THREE.Vector3().fromArray(tendon.points || [0, 0, 0])).project(camera);
      return this.labels[i] && { label: this.labels[i], x: ((at.x + 1) / 2) * window.innerWidth, y: ((1 - at.y) / 2) * window.innerHeight };
    }).filter(Boolean);
    places.sort((a, b) => a.y - b.y);
    for (let pass = 0; pass < 40; pass++) {
      places.forEach((place, i) => places.slice(0, i).forEach((other) => {
        const missing = Math.abs(place.x - other.x) < 40 ? 18 - (place.y - other.y) : 0;
        if (missing > 0) { place.y += missing / 2; other.y -= missing / 2; }
      }));
    }
    places.forEach((place) => {
      // A long name at the edge of a narrow window is read over the finger rather than cut off.
      const left = place.x > 0 ? place.label.offsetWidth + 4 : -Infinity;
      const [x, y] = [Math.max(place.x - 6, left), place.y].map((value) => value.toFixed(1));
      place.label.style.transform = `translate(${x}px, ${y}px) translate(-100%, -50%)`;
    });
  }
}
