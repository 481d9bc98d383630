// Streams points from the server to the viewer; pipeline/web/content/points.py defines the format.
const LITTLE = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Read the file at `address` into `viewer`; resolves with the head of the file, null if there is none. */
export async function streamPoints(address, viewer, signal) {
  try {
    const answer = await fetch(address, { signal });
    if (!answer.ok || !LITTLE) return null;
    return await read(new Source(answer.body.getReader()), viewer);
  } catch (error) {
    if (error.name === "AbortError") return null;
    throw error;
  }
}

async function read(source, viewer) {
  const head = JSON.parse(new TextDecoder().decode(await source.line()));
  viewer.describe(head);
  for (let start; (start = await source.take(8)); ) {
    const [group, count] = new Uint32Array(start.buffer);
    const xyz = new Int16Array((await source.take(6 * count)).buffer);
    const residual = new Int16Array((await source.take(2 * count)).buffer);
    const intensity = await source.take(count);
    const shade = await source.take(count);
    viewer.addPoints(xyz, shade, { origin: head.origin, step_m: head.step_m, group: head.groups[group], residual, intensity });
  }
  return head;
}

/** Reader of a requested number of bytes from a stream of chunks. */
class Source {
  constructor(reader) {
    Object.assign(this, { reader, held: [], size: 0 });
  }

  /** Take exactly that many bytes, in a buffer of their own; null at the end. */
  async take(count) {
    while (this.size < count) if (!(await this.#more())) return null;
    const taken = new Uint8Array(count);
    for (let at = 0; at < count; ) {
      const first = this.held[0];
      const part = first.subarray(0, count - at);
      taken.set(part, at);
      at += part.length;
      if (part.length === first.length) this.held.shift();
      else this.held[0] = first.subarray(part.length);
    }
    this.size -= count;
    return taken;
  }

  async line() {
    for (;;) {
      let length = 0;
      for (const part of this.held) {
        const end = part.indexOf(10);
        if (end >= 0) return this.take(length + end + 1);
        length += part.length;
      }
      if (!(await this.#more())) return this.take(this.size);
    }
  }

  async #more() {
    const { done, value } = await this.reader.read();
    if (done) return false;
    this.held.push(value);
    this.size += value.length;
    return true;
  }
}
