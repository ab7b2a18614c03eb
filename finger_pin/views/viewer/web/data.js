"use strict";

// Colours of tension: the upper three quarters of matplotlib's viridis, which is perceptually uniform and safe for
// colour-blind readers; its darkest quarter would vanish on the dark background. A loose tendon is grey.
const VIRIDIS = [
  [0.230, 0.322, 0.546], [0.207, 0.372, 0.553], [0.186, 0.419, 0.557], [0.167, 0.464, 0.558],
  [0.149, 0.508, 0.557], [0.132, 0.552, 0.553], [0.121, 0.596, 0.544], [0.125, 0.640, 0.527],
  [0.158, 0.684, 0.502], [0.220, 0.726, 0.466], [0.304, 0.765, 0.420], [0.404, 0.800, 0.363],
  [0.516, 0.831, 0.294], [0.637, 0.857, 0.217], [0.762, 0.876, 0.137], [0.886, 0.892, 0.095],
  [0.993, 0.906, 0.144],
];
const LOOSE = [0.62, 0.64, 0.67];
// Of a cord without a known tension, which no tension has.
const CORD = [0.93, 0.9, 0.82];

function tensionColour(tension, scale) {
  const place = Math.min(Math.max(tension / scale, 0), 1) * (VIRIDIS.length - 1);
  const low = Math.min(Math.floor(place), VIRIDIS.length - 2);
  const weight = place - low;
  return VIRIDIS[low].map((value, i) => value + weight * (VIRIDIS[low + 1][i] - value));
}

// How loose a tendon is drawn: 0 above `full` newtons, 1 at none.
function looseness(tension, full) {
  return Math.min(Math.max(1 - tension / full, 0), 1);
}

function decode(text, Type) {
  const bytes = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
  return new Type(bytes.buffer);
}

// Rows of equal length that arrive in chunks.
class Rows {
  constructor(width, Type) {
    this.width = width;
    this.data = new Type(256 * width);
    this.count = 0;
  }

  append(values) {
    const used = this.count * this.width;
    if (used + values.length > this.data.length) {
      const grown = new this.data.constructor(Math.max(2 * this.data.length, used + values.length));
      grown.set(this.data.subarray(0, used));
      this.data = grown;
    }
    this.data.set(values, used);
    this.count += values.length / this.width;
  }

  row(index) {
    return this.data.subarray(index * this.width, (index + 1) * this.width);
  }
}

// The frames of an animation, and the state at any time between them.
class Frames {
  constructor(config) {
    const points = config.tendons.reduce((sum, tendon) => sum + tendon.strand.length, 0);
    this.columns = {
      time: new Rows(1, Float64Array),
      pose: new Rows(7 * config.links.length, Float32Array),
      path: new Rows(3 * points, Int16Array),
      tension: new Rows(config.strands.length, Float32Array),
      tip: new Rows(3 * config.tips, Float32Array),
      joint: new Rows(config.joints.length, Float32Array),
      ...(config.objects && {
        object: new Rows(7 * config.objects.free.length, Float32Array),
        contact: new Rows(9 * config.objects.steepness.length, Float32Array),
      }),
      ...(config.ghost && { ghost: new Rows(7 * config.ghost.links.length, Float32Array) }),
    };
  }

  append(chunk) {
    for (const [name, rows] of Object.entries(this.columns)) {
      rows.append(decode(chunk[name], rows.data.constructor));
    }
  }

  get count() { return this.columns.time.count; }
  get start() { return this.count ? this.columns.time.data[0] : 0; }
  get end() { return this.count ? this.columns.time.data[this.count - 1] : 0; }

  // The frame at or before a time, the next one, and the weight of the next.
  locate(time) {
    const times = this.columns.time.data;
    let low = 0;
    let high = this.count - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle; else high = middle;
    }
    const gap = times[high] - times[low];
    return { low, high, weight: gap > 0 ? Math.min(Math.max((time - times[low]) / gap, 0), 1) : 0 };
  }

  mix(name, place) {
    const rows = this.columns[name];
    const before = rows.row(place.low);
    const after = rows.row(place.high);
    return Float32Array.from(before, (value, i) => value + place.weight * (after[i] - value));
  }

  poses(name, place) {
    const before = this.columns[name].row(place.low);
    const after = this.columns[name].row(place.high);
    const mixed = this.mix(name, place);
    for (let i = 0; i < mixed.length; i += 7) {
      MeshCat.THREE.Quaternion.slerpFlat(mixed, i + 3, before, i + 3, after, i + 3, place.weight);
    }
    return mixed;
  }
}
