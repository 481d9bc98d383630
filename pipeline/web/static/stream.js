// Opens the tree of all points in the viewer; pipeline/web/content/points.py defines its files.
import { ServerError, ask, t } from "./base.js";

const LITTLE = new Uint8Array(new Uint16Array([1]).buffer)[0] === 1;

/** Open the points in the folder at `address`; nothing where there are none. onFailure: called with the
 *  error if they are lost later. */
export async function streamPoints(address, viewer, signal, onFailure) {
  if (!LITTLE) return;
  const head = await ask(`${address}/points.json`);
  const load = async (first, bytes) => {
    const answer = await fetch(`${address}/points.bin`, { signal, headers: { Range: `bytes=${first}-${first + bytes - 1}` } }).catch(() => null);
    if (answer?.status !== 206) throw new ServerError(t("lost"));
    return answer.arrayBuffer();
  };
  if (!signal.aborted) await viewer.openTree(head, load, onFailure);
}
