"use strict";

// Colour of a tension: of a list of colours from none to the largest.
function tensionColour(tension, scale, colours) {
  const place = Math.min(Math.max(tension / scale, 0), 1) * (colours.length - 1);
  const low = Math.min(Math.floor(place), colours.length - 2);
  return mixed(colours[low], colours[low + 1], place - low);
}

const mixed = (from, to, weight) => from.map((value, i) => value + weight * (to[i] - value));

// How loose a tendon is drawn: 0 above `full` newtons, 1 at none.
function looseness(tension, full) {
  return Math.min(Math.max(1 - tension / full, 0), 1);
}

// The bytes of a part of the page, which are compressed.
function unpack(id) {
  const text = atob(document.getElementById(id).textContent);
  const packed = new Blob([Uint8Array.from(text, (character) => character.charCodeAt(0))]).stream();
  return new Response(packed.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
}

const KINDS = { "<f8": Float64Array, "<f4": Float32Array, "<i2": Int16Array };

// The frames of an animation, and the state at any time between them.
class Frames {
  // Columns are lists of a name, a kind of number and the length of a row; their numbers follow each other in a buffer.
  constructor(columns, buffer) {
    const bytes = columns.map(([, kind, width]) => width * KINDS[kind].BYTES_PER_ELEMENT);
    this.count = buffer.byteLength / bytes.reduce((sum, size) => sum + size, 0);
    let first = 0;
    this.columns = Object.fromEntries(columns.map(([name, kind, width], i) => {
      const data = new KINDS[kind](buffer.slice(first, (first += this.count * bytes[i])));
      return [name, { width, data: name === "path" ? this.summed(data, width) : data }];
    }));
    const times = this.columns.time.data;
    [this.start, this.end] = [times[0], times[this.count - 1]];
  }

  // Coordinates of paths come one after the other, each as its differences from frame to frame.
  summed(differences, width) {
    const data = new Int16Array(differences.length);
    for (let i = 0; i < width; i++) {
      for (let frame = 0, sum = 0; frame < this.count; frame++) {
        data[frame * width + i] = sum += differences[i * this.count + frame];
      }
    }
    return data;
  }

  row(name, index) {
    const { width, data } = this.columns[name];
    return data.subarray(index * width, (index + 1) * width);
  }

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
    return mixed(Float32Array.from(this.row(name, place.low)), this.row(name, place.high), place.weight);
  }

  poses(name, place) {
    const before = this.row(name, place.low);
    const after = this.row(name, place.high);
    const poses = this.mix(name, place);
    for (let i = 0; i < poses.length; i += 7) {
      MeshCat.THREE.Quaternion.slerpFlat(poses, i + 3, before, i + 3, after, i + 3, place.weight);
    }
    return poses;
  }
}
