// Opens the tree of all points in the viewer; pipeline/web/content/points.py defines its files.
import { ServerError, ask, t } from "./base.js";

const LITTLE = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Open the points in the folder at `address`; nothing where there are none. onFailure: called with the
 *  error if they are lost later. */
export async function streamPoints(address, viewer, signal, onFailure) {
  if (!LITTLE) return;
  const head = await ask(`${address}/points.json`);
  const load = async (first, bytes) => {
    const range = { Range: `bytes=${first}-${first + bytes - 1}` };
    const points = await fetch(`${address}/points.bin`, { signal, headers: range })
      .then((answer) => (answer.status === 206 ? answer.arrayBuffer() : null)).catch(() => null);
    if (!points) throw new ServerError(t("lost"));
    return points;
  };
  if (!signal.aborted) await viewer.openTree(head, load, onFailure);
}
