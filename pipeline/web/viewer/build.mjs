// Builds pipeline/report/static/viewer.js. Run `npm ci && npm run build` after a change in this folder.
import { createHash } from "node:crypto";
import { copyFileSync, mkdirSync, readFileSync, readdirSync } from "node:fs";
import { build } from "esbuild";

const OUT = new URL("../../report/static/", import.meta.url).pathname;

// Digest of all sources by name; tests/report/test_viewer.py computes the same, or the bundle is stale.
const sources = ["build.mjs", "package-lock.json", ...readdirSync("src").map((name) => `src/${name}`)];
const digest = createHash("sha256");
for (const name of sources.sort()) digest.update(`${name}\0`).update(readFileSync(name)).update("\0");

const licence = readFileSync("node_modules/three/LICENSE", "utf8").replaceAll("\u00a9", "(c)").trim();
mkdirSync(OUT, { recursive: true });
await build({
  entryPoints: ["src/viewer.js"],
  outfile: `${OUT}viewer.js`,
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "Wheelplane3D",
  target: "es2022",
  charset: "ascii", // a page of any encoding may hold it
  legalComments: "inline",
  banner: { js: `/* wheelplane viewer, sources sha256:${digest.digest("hex")}\n\nthree.js, which is part of it:\n\n${licence}\n*/` },
});
copyFileSync("node_modules/three/LICENSE", `${OUT}LICENSE-three.txt`);
